"""One sequence in every pixel, shifted by a tiled mask."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.draws import fractions
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import InEveryPixel
from qmcjax.sequences import Sequence, as_sequence, roberts, rotate

_STRIDE = (0.5698402909980532, 0.7548776662466927)
"""1/p**2 and 1/p, where p**3 = p + 1: their multiples modulo 1 stay far apart."""

MAX_DIMS_IN_TIME = 64
"""Those of the sequence whose points shift frames."""


@frozen_pytree
class Dithered(InEveryPixel):
    """Sample s of a pixel is point s of the sequence plus the pixel's vector in a mask, modulo 1."""

    offsets: Array
    """uint32 (rows, columns, channels): fractions."""
    sequence: Sequence
    frame: Array | None = None
    """uint32 scalar."""

    def at_frame(self, frame: Array | int) -> "Dithered":
        """Return the sampler of a frame of an animation, moved by multiples of the golden ratio.

        Frame t is shifted by point t of :func:`qmcjax.sequences.roberts` with as many dimensions, at most 64.
        All frames are the same program.

        Parameters
        ----------
        frame : int, or integer Array of shape (), in [0, 2**32)
        """
        if self.dims > MAX_DIMS_IN_TIME:
            raise ValueError(
                f"sequence must have at most {MAX_DIMS_IN_TIME} dimensions for frames, got {self.dims}"
            )
        return replace(self, frame=checks.frame(frame))

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        x, y = state
        moved = self.sequence if self.frame is None else rotate(self.sequence, roberts(self.dims)(self.frame))
        rotated = moved.rotated_coordinate
        return jnp.stack([rotated(sample, j, self._offset(x, y, j), dtype) for j in dims], axis=-1)

    def _offset(self, x: Array, y: Array, dim: int) -> Array:
        rows, columns, channels = self.offsets.shape
        copy, channel = divmod(dim, channels)
        down, right = (int(copy * s % 1 * n) for s, n in zip(_STRIDE, (rows, columns), strict=True))
        row = (y % np.uint32(rows) + np.uint32(down)) % np.uint32(rows)
        column = (x % np.uint32(columns) + np.uint32(right)) % np.uint32(columns)
        return self.offsets[:, :, channel].at[row, column].get(mode="promise_in_bounds")


def dither(mask: ArrayLike, sequence: Sequence) -> Dithered:
    """Sample every pixel with the same points, shifted on the torus by its value in a tiled mask.

    With a blue noise mask, :func:`blue_noise_mask`, the values of neighbours differ, and so do their errors:
    at few samples per pixel the noise is less visible than with independent shifts.

    Parameters
    ----------
    mask : float or uint32 ArrayLike, shape (rows, columns) or (rows, columns, channels)
        Floats in [0, 1), rounded down to 32-bit fractions; or these fractions. Pixel (x, y) has the shift
        ``mask[y % rows, x % columns]``. Further coordinates of the sequence reuse the channels of the mask,
        each time translated by another long vector.
    sequence : Sequence
        Preferably uniform on the torus, like :func:`qmcjax.sequences.lattice`. Shifts do not preserve
        elementary intervals.

    Returns
    -------
    Dithered
        ``sampler.at_frame(t)`` is the sampler of frame t of an animation. Sums are exact in base 2; for any
        other sequence they are rounded once from float64, never to 1. A new mask of the same shape does not
        recompile.

    Notes
    -----
    A single sample has the spectrum of the mask where the integrand is nearly linear. With more samples, the
    errors are periodic functions of the shift that vary faster, and their spectrum approaches white noise.

    Each sample of a pixel is uniform over keys if each point of the sequence is, as after ``rotate``.

    References
    ----------
    .. [1] I. Georgiev, M. Fajardo, "Blue-noise Dithered Sampling", SIGGRAPH Talks, 2016.
    .. [2] R. Cranley, T. N. L. Patterson, "Randomization of Number Theoretic Methods for Multiple
       Integration", SIAM J. Numer. Anal. 13, 1976.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> sampler = dither([[0.0, 0.25], [0.5, 0.75]], sequences.sobol(1))
    >>> print(sampler(1, 2, 0, dims=(0,)), sampler(1, 2, 1, dims=(0,)))
    [0.25] [0.75]
    """
    offsets = fractions("mask", mask)
    if offsets.ndim not in (2, 3):
        raise ValueError(
            f"mask must have the shape (rows, columns) or (rows, columns, channels), got {offsets.shape}"
        )
    offsets = offsets[:, :, None] if offsets.ndim == 2 else offsets
    return Dithered(offsets, as_sequence("sequence", sequence))


def blue_noise_mask(channels: int = 2) -> NDArray[np.float64]:
    """Return a tileable blue noise mask.

    Parameters
    ----------
    channels : int
        1 for numbers, 2 for vectors.

    Returns
    -------
    float64 array, shape (128, 128) or (64, 64, 2)
        In (0, 1), exact in float32. The n pixels of a channel have the values (k + 1/2) / n, each once.
        Except for the halves, the vectors are the first 4096 points of the Sobol' sequence, a (0,12,2)-net.

    Notes
    -----
    Scalar masks were made by the void-and-cluster method [1]_, with a filter of standard deviation 1.5.
    Vectors were arranged to minimise the energy of [2]_, the sum over pairs of pixels p, q of values u, v in
    d = 2 dimensions of ``exp(-|p - q|**2 / 2.1**2 - |u - v|**(d/2))``; only pixels wrap around.

    References
    ----------
    .. [1] R. Ulichney, "The Void-and-Cluster Method for Dither Array Generation", 1993.
    .. [2] I. Georgiev, M. Fajardo, "Blue-noise Dithered Sampling", SIGGRAPH Talks, 2016.

    Examples
    --------
    >>> mask = blue_noise_mask(1)
    >>> print(mask.shape, mask.min() * 2**15, mask.mean())
    (128, 128) 1.0 0.5
    """
    channels = checks.integer("channels", channels, 1, 2)
    (ranks,) = tables.arrays("samplers", "masks.npz", "scalars" if channels == 1 else "vectors")
    return (ranks + 0.5) / (ranks.shape[0] * ranks.shape[1])

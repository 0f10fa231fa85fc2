"""Replications of one net over the screen, each shifted by whole pixels and jittered."""

from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import log_side
from qmcjax.samplers._base import Fits
from qmcjax.samplers._kinds import ForImage
from qmcjax.sequences import Invertible, Sequence, SequenceLike, as_sequence, inverted, uniform


@frozen_pytree
class PaddedReplications(ForImage):
    """Sample s of all pixels: a net with one point per pixel, shifted by vector s of a sequence."""

    net: Invertible
    offsets: Sequence
    jitter: bool = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        return self.net.dims

    @property
    def fits(self) -> Fits:
        return Fits((self.width, self.height), self.offsets.limit, why="for the sequence of offsets")

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        x, y = state
        # Whole pixels from the leading digits, in two shifts, because a shift by 32 is undefined. Subtracting
        # them from the point keeps its position inside the pixel.
        shifts = [self._offset(sample, j) >> 1 >> (31 - self.log_side) for j in range(2)]
        ones = np.uint32(2**self.log_side - 1)
        column, row = (x + shifts[0]) & ones, (y + shifts[1]) & ones
        index = self.net.index_in_cell(column, row, self.log_side, jnp.zeros_like(sample))
        words = [self._word(index, sample, j) for j in dims]
        return jnp.stack([to_unit(word, dtype) for word in words], axis=-1)

    def _word(self, index: Array, sample: Array, dim: int) -> Array:
        word = self.net.word(index, dim)
        if dim >= 2:
            return word + self._offset(sample, dim)
        inside = word << self.log_side
        if self.jitter:
            inside = inside + (self._offset(sample, self.dims + dim) >> self.log_side)
        return inside

    def _offset(self, sample: Array, dim: int) -> Array:
        return self.offsets.fixed_point(sample, dim)


def padded_replications(
    net: Invertible | SequenceLike,
    width: int,
    height: int,
    offsets: SequenceLike | Array | int,
    jitter: bool = True,
) -> PaddedReplications:
    """Sample the screen repeatedly with one point of a net per pixel, with a new shift each time.

    Sample s of all pixels is one instance of the net, shifted on the torus by whole pixels: each pixel keeps
    one point, and the toroidal minimum distance is that of the net. The points of all instances lie on one
    grid of ``4**k`` cells per side, where ``2**k`` is the smallest power of two that covers the image. Jitter
    moves all points of an instance by the same fraction of such a cell. Each instance is as uniform as the
    net; points of different instances can lie arbitrarily close together.

    Parameters
    ----------
    net : sequence in base 2
        As for :func:`full_screen`, except for the Halton sequence: a net of ``4**k`` points, or the first
        ``4**k`` points of a digital sequence.
    width, height : int, in [1, 65536]
    offsets : Sequence, or jax.random.key, or int in [0, 2**32)
        Vector s contains the shifts of instance s, one for each coordinate of the net, followed by its jitter
        in x and y. The shifts of coordinates 0 and 1 are rounded down to whole pixels of the padded raster;
        the others are not rounded. A key stands for ``uniform(dims, key)``; a new one does not recompile.
    jitter : bool
        False keeps the positions of the net inside pixels and needs no jitter in ``offsets``.

    Returns
    -------
    PaddedReplications
        ``fits.spp``, the largest number of samples, is the number of vectors of offsets.

    Notes
    -----
    Shifts by whole pixels preserve one point per pixel and the Latin hypercube property. Other elementary
    intervals can lose points, as the thesis says; those of the Hammersley net do not (counted for all shifts
    of 64 and of 256 points).

    The thesis has two coordinates; further ones have no pixels and are shifted here by any fraction. For
    points on a finer grid than that of ``4**k`` cells, as after a digital shift, jitter may carry: then it
    wraps around inside the pixel.

    Each sample of a pixel is uniform over keys if ``offsets`` is a key, with jitter. All samples have the
    points of one net: coordinates of one sample and those of another, as after ``split``, depend on each
    other in an image, not over keys. Chi-squared of their joint counts is up to 3 times that of random points
    in the mean over keys, and 23 times for single ones (12 coordinates, 64 x 64 pixels, 100 keys).

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.5, "Progressive Integration by Padded
       Replications".
    .. [2] T. Kollig, A. Keller, "Efficient Bidirectional Path Tracing by Randomized Quasi-Monte Carlo
       Integration", 2002.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> net = sequences.larcher_pillichshammer_net(6)
    >>> sampler = padded_replications(net, 8, 8, sequences.halton(2), jitter=False)
    >>> print(sampler(0, 0, 1), samplers.full_screen(net, 8, 8)(4, 2, 0))  # shifted by 8 / 2 and 8 / 3 pixels
    [0.875 0.875] [0.875 0.875]
    """
    width, height = checks.image_size(width, height)
    jitter = checks.flag("jitter", jitter)
    cells = log_side(width, height)
    net = inverted(net, cells)
    if net.size is not None and net.points_per_cell(cells) != 1:
        raise ValueError(
            f"net must have one point in each of {2**cells} x {2**cells} pixels, "
            f"got {net.points_per_cell(cells)}"
        )
    needed = net.dims + 2 * jitter
    if callable(offsets):
        offsets = as_sequence("offsets", offsets)
    else:
        offsets = uniform(needed, checks.prng_key("offsets", offsets))
    if offsets.dims < needed:
        raise ValueError(
            f"offsets must have {needed} dimensions, for {net.dims} shifts"
            f"{' and 2 of jitter' if jitter else ''}, got {offsets.dims}"
        )
    return PaddedReplications(width, height, net, offsets, jitter)

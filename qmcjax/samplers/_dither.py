"""Blue noise: one sequence in every pixel, shifted by a mask, or with ranking and scrambling keys."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks, draws, tables
from qmcjax.core.bits import hash_pair, to_unit
from qmcjax.core.draws import fractions
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._kinds import InEveryPixel
from qmcjax.samplers.masks import mask_ranks
from qmcjax.sequences import (
    BinarySequence,
    InTime,
    Mapped,
    OwenHash,
    Sequence,
    SequenceLike,
    as_sequence,
    in_time,
    roberts,
    rotate,
    sobol,
)

_LOG_BLOCK = 4
"""Binary logarithm of the side of the blocks in which further copies of the mask have a translation each."""

MAX_DIMS_IN_TIME = 64
"""Most dimensions of the sequence that shifts frames."""


@frozen_pytree
class Dithered(InEveryPixel):
    """Sample s of a pixel is point s of the sequence plus the pixel's vector of a mask, modulo 1."""

    offsets: Array
    """uint32 (rows, columns, channels): fractions."""
    sequence: Sequence
    frame: Array | None = None
    """uint32 scalar."""

    def _in_time(self) -> "Dithered":
        if self.dims > MAX_DIMS_IN_TIME:
            raise ValueError(
                f"sequence must have at most {MAX_DIMS_IN_TIME} dimensions for frames, got {self.dims}"
            )
        return replace(self, frame=jnp.uint32(0))

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the offsets of the pixels: further copies of the mask are translated block by block."""
        rows, columns, channels = self.offsets.shape
        down, right = (max(min(_LOG_BLOCK, n.bit_length() - 2), 0) for n in (rows, columns))
        block, found = hash_pair(x >> right, y >> down), {}
        for j in dims:
            copy, channel = divmod(j, channels)
            row, column = y % np.uint32(rows), x % np.uint32(columns)
            if copy:
                move = hash_pair(block, jnp.uint32(copy))
                row = (row + (move >> 16) % np.uint32(rows)) % np.uint32(rows)
                column = (column + (move & np.uint32(0xFFFF)) % np.uint32(columns)) % np.uint32(columns)
            found[j] = self.offsets[:, :, channel].at[row, column].get(mode="promise_in_bounds")
        return found

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        moved = self.sequence if self.frame is None else rotate(self.sequence, roberts(self.dims)(self.frame))
        rotated = moved.rotated_coordinate
        return jnp.stack([rotated(sample, j, state[j], dtype) for j in dims], axis=-1)


def dither(mask: ArrayLike, sequence: SequenceLike) -> Dithered:
    """Sample every pixel with the same points, shifted on the torus by its value in a tiled mask.

    With a blue noise mask, as from :func:`blue_noise_mask`, the values of neighbours differ, and so do their
    errors: at low sampling rates the noise is less visible than with independent shifts.

    Parameters
    ----------
    mask : ArrayLike, shape (rows, columns) or (rows, columns, channels)
        Floats in [0, 1), rounded down to 32-bit fractions, or these fractions as uint32. uint8 and uint16 are
        levels: k of 256 is (k + 1/2) / 256, as in :func:`qmcjax.bridges.read_mask`. Pixel (x, y) is shifted
        by ``mask[y % rows, x % columns]``. Further coordinates of the sequence reuse the channels of the
        mask.
    sequence : Sequence
        Preferably uniform on the torus, like :func:`qmcjax.sequences.lattice`. Shifts do not preserve
        elementary intervals.

    Returns
    -------
    Dithered
        ``sampler.at_frame(t)`` is the sampler of frame t of an animation: shifted by point t of
        :func:`qmcjax.sequences.roberts`, in at most 64 dimensions. Sums are exact in base 2; for other
        sequences they are rounded once from float64, never to 1. A new mask of the same shape does not
        recompile.

    Notes
    -----
    With one sample, the error has the spectrum of the mask where the integrand is nearly linear. With more
    samples, the error varies faster, as a periodic function of the shift, and its spectrum approaches white
    noise.

    Each sample of a pixel is uniform over keys if each point of the sequence is, as after ``rotate``. Over
    keys, coordinates are as independent as those of the sequence. In one image, groups of as many coordinates
    as the mask has channels are as independent as random points with equal strata are: in all but the first
    group, a hash translates the mask anew in each block of 16 x 16 pixels, or of half the side of a smaller
    mask. Filtered errors of these groups are up to 1.1 times those of the first one.

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
    levels = getattr(mask, "dtype", None)
    if levels in (np.uint8, np.uint16):
        half = np.uint32(1 << (31 - 8 * np.dtype(levels).itemsize))
        mask = (2 * jnp.asarray(mask).astype(jnp.uint32) + np.uint32(1)) * half
    try:
        offsets = fractions("mask", mask)
    except ValueError as error:
        raise ValueError(f"{error} (bridges.read_mask reads the levels of an image)") from None
    if offsets.ndim not in (2, 3):
        raise ValueError(
            f"mask must have the shape (rows, columns) or (rows, columns, channels), got {offsets.shape}"
        )
    offsets = offsets[:, :, None] if offsets.ndim == 2 else offsets
    return Dithered(offsets, as_sequence("sequence", sequence))


_STORED = {1: (128, "scalars"), 2: (64, "vectors")}
"""By channels: sides and names of masks that need not be made."""


def blue_noise_mask(
    channels: int = 2, side: int | None = None, frames: int | None = None
) -> NDArray[np.float64]:
    """Return a tileable blue noise mask.

    The default masks are stored. All others are made, by SciPy if they are vectors: keep the array,
    for example by ``numpy.save``. A mask of one channel and 512 x 512 pixels takes half a minute, one of
    two channels and 64 x 64 pixels seconds, in proportion to the pixels of all frames.

    Parameters
    ----------
    channels : int, in [1, 8]; 1 for scalars, more for vectors
    side : int, optional
        A power of two in [16, 512], by default 128 for scalars, 64 for vectors.
    frames : int, in [1, 64], optional
        For animations: the frames of a period. ``dither(mask[t], sequence)`` samples frame t.

    Returns
    -------
    float64 array, shape (side, side), with ``channels`` > 1 (side, side, channels); before it (frames,)
        In (0, 1), exact in float32. Each value (k + 1/2) / n occurs once among the n pixels of a frame in
        each channel. Except for the 1/2, vectors are the first n points of the Sobol' sequence.

    Notes
    -----
    Scalar masks are made by the void-and-cluster method [1]_, with a filter of standard deviation 1.5. With
    frames, it adds up the pixels of a frame and the frames of a pixel [3]_; then each frame is ranked.
    Vectors are arranged to minimise the energy of [2]_: the sum over pairs of pixels p, q with values u, v
    in d dimensions of ``exp(-|p - q|**2 / 2.1**2 - |u - v|**(d/2))``, in one frame or in one pixel of two
    frames; only pixels and frames wrap around. For scalars, voids and clusters leave less power at low
    frequencies than this energy, in less time.

    References
    ----------
    .. [1] R. Ulichney, "The Void-and-Cluster Method for Dither Array Generation", 1993.
    .. [2] I. Georgiev, M. Fajardo, "Blue-noise Dithered Sampling", SIGGRAPH Talks, 2016.
    .. [3] A. Wolfe, N. Morrical, T. Akenine-Moeller, R. Ramamoorthi, "Spatiotemporal Blue Noise Masks", 2022.

    Examples
    --------
    >>> mask = blue_noise_mask(1)
    >>> print(mask.shape, mask.min() * 2**15, mask.mean())
    (128, 128) 1.0 0.5
    >>> print(blue_noise_mask(1, side=16, frames=4).shape)
    (4, 16, 16)
    """
    channels = checks.integer("channels", channels, 1, 8)
    stored, name = _STORED.get(channels, (64, ""))
    side = checks.power_of_two("side", stored if side is None else side, 512)
    if side < 16:
        raise ValueError(f"side must be a power of two in [16, 512], got {side}")
    count = 1 if frames is None else checks.integer("frames", frames, 1, 64)
    if frames is None and name and side == stored:
        (ranks,) = tables.arrays("samplers", "masks.npz", name)
    else:
        ranks = mask_ranks(channels, side, count)
        ranks = ranks if channels > 1 else ranks[..., 0]
        ranks = ranks[0] if frames is None else ranks
    return (ranks + 0.5) / side**2


@frozen_pytree
class Ranked(InEveryPixel):
    """Sample s of a pixel is point s ^ ranking key of one sequence, xored with the scrambling keys."""

    sequence: BinarySequence

    ranks: Array
    """uint32 (rows, columns), powers of two: ranking keys."""
    scrambles: Array
    """uint32 (rows, columns, dims): scrambling keys, as 32-bit fractions."""
    translation: Array
    """uint32 (2,): offsets of x and y."""

    def _in_time(self) -> "Ranked":
        return self if isinstance(self.sequence, InTime) else replace(self, sequence=in_time(self.sequence))

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        rows, columns = self.ranks.shape
        column = (x + self.translation[0]) & np.uint32(columns - 1)
        return (y + self.translation[1]) & np.uint32(rows - 1), column

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:

        def keys(table: Array) -> Array:
            return table.at[state].get(mode="promise_in_bounds")

        index = sample ^ keys(self.ranks)
        return jnp.stack(
            [to_unit(self.sequence.word(index, j) ^ keys(self.scrambles[:, :, j]), dtype) for j in dims],
            axis=-1,
        )


def ranked(dims: int, key: Array | int) -> Ranked:
    """Sample with scrambling and ranking keys that distribute errors as blue noise.

    All pixels share one Owen-scrambled Sobol' sequence. The scrambling keys of a pixel, one per dimension,
    are xored to its points, its ranking key to their indices. The keys repeat in tiles of 64 x 64 pixels.

    Parameters
    ----------
    dims : int, 2, 3 or 4: optimised for all these dimensions together
    key : jax.random.key, or int in [0, 2**32)
        Translates the tile at random. A new key does not recompile.

    Returns
    -------
    Ranked
        Optimised for 1, 2, 4, 8 and 16 samples. Other numbers work, but the errors have more low frequencies.
        ``sampler.at_frame(t)`` is the sampler of frame t of an animation. Over aligned blocks of frames and
        samples, each coordinate of a pixel is stratified, by :func:`qmcjax.sequences.in_time`.

    Notes
    -----
    Neither kind of key changes the stratification of a pixel's points: each aligned block of 2**k samples is
    a (t,k,dims)-net with the t of the Sobol' sequence, 0 in two dimensions.

    The keys of a tile are a fixed pool; only their arrangement was searched. With this pool, the first
    samples of all pixels of a tile are the first 4096 points of the Sobol' sequence, in their leading 12
    digits, and each further sample number has the 4096 points of 16 digitally shifted blocks of 256. So, over
    all translations, the expectation of each sample of each pixel is the mean of the integrand over such
    points, and means over a tile have small errors for any number of samples. Each sample of a pixel,
    including the first, is uniform over keys up to the cells of these points, not exactly.

    The search minimised the mean squared error after a Gaussian filter of standard deviation 1.5 pixels, over
    1024 random half-spaces as integrands and prefixes of 1, 2, 4, 8 and 16 samples with weights 4, 2, 1, 1,
    1. It is our own, optimises both kinds of keys at once, and differs from that of [1]_. The gain decreases
    with samples and dimensions: ``_data/README.md`` lists measured spectra.

    References
    ----------
    .. [1] E. Heitz, L. Belcour, V. Ostromoukhov, D. Coeurjolly, J.-C. Iehl, "A Low-Discrepancy Sampler that
       Distributes Monte Carlo Errors as a Blue Noise in Screen Space", SIGGRAPH Talks, 2019.

    Examples
    --------
    >>> sampler = ranked(2, key=0)
    >>> print(sampler(3, 5, 7) == sampler(67, 5, 7))
    [ True  True]
    """
    dims = checks.integer("dims", dims, 2, 4)
    names = "seeds", f"ranks_{dims}", f"keys_{dims}"
    seeds, ranks, scrambles = tables.arrays("samplers", "ranked.npz", *names)
    return Ranked(
        Mapped(sobol(dims), OwenHash(jnp.asarray(seeds[:dims]))),
        jnp.asarray(ranks, jnp.uint32),
        jnp.asarray(scrambles, jnp.uint32) << 16,
        draws.bits(checks.prng_key("key", key), (2,), jnp.uint32),
    )

"""One sequence over the whole screen: each pixel takes the points that fall into it."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import reverse, to_unit
from qmcjax.core.digits import (
    digit_spans,
    permuted_digit,
    permuted_radical_inverse,
    radical_inverse,
    reflection_tables,
)
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import log_side
from qmcjax.samplers._base import Fits, more_samples
from qmcjax.samplers._kinds import ForImage
from qmcjax.sequences import Invertible, RadicalInverses, SequenceLike, inverted


@frozen_pytree
class HaltonFullScreen(ForImage):
    """A Halton sequence scaled to the smallest raster of 2**a x 3**b pixels that covers the image.

    The first a binary digits of an index determine its column, the first b ternary digits its row. So every
    pixel contains exactly one of any 2**a 3**b consecutive points.
    """

    sequence: RadicalInverses
    flips: Array
    """uint32: bit k is set if the permutation of binary digit k swaps."""
    inverses: Array | None
    """uint32 (b, 3): row k maps ternary digit k of the second component to that of the index."""
    tables: Array | None
    """uint16: the reflection tables of the ternary digits from the b-th on."""

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def raster(self) -> tuple[int, int]:
        """Columns and rows of the raster."""
        log_columns, log_rows = _exponents(self.width, self.height)
        return 2**log_columns, 3**log_rows

    @property
    def fits(self) -> Fits:
        columns, rows = self.raster
        why = f"for 2**32 indices over a raster of {columns} x {rows}"
        return Fits((self.width, self.height), checks.INDEX_LIMIT // (columns * rows), why=why)

    def index(self, x: Array, y: Array, sample: Array) -> Array:
        """Return the index of the point of a pixel in a block: ``sample * 2**a * 3**b`` or following."""
        return self._index(x, y, sample)[0]

    def _index(self, x: Array, y: Array, sample: Array) -> tuple[Array, Array]:
        """Return the index and index // 3**b, its ternary digits after those of the row."""
        log_columns, log_rows = _exponents(self.width, self.height)
        columns, rows = self.raster
        ones = np.uint32(columns - 1)
        # The column determines the index modulo 2**a; higher bits are masked below. Two shifts, because a
        # shift by 32 is undefined.
        by_column = (reverse(x) >> 1 >> (31 - log_columns)) ^ self.flips
        # The row determines it modulo 3**b: its last digit is digit b - 1 of the index.
        by_row = jnp.zeros_like(y)
        for k in reversed(range(log_rows)):
            y, digit = y // np.uint32(3), y % np.uint32(3)
            if self.inverses is not None:
                digit = permuted_digit(self.inverses[k], digit)
            by_row = by_row * np.uint32(3) + digit
        # Garner's form of the Chinese remainder theorem, with the power of three first: the second digit is
        # only needed modulo a power of two, which wrapping integers give exactly.
        second = ((by_column - by_row) * np.uint32(pow(rows, -1, columns))) & ones
        rest = sample * np.uint32(columns) + second
        return rest * np.uint32(rows) + by_row, rest

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        x, y = state
        index, rest = self._index(x, y, sample)
        log_columns, _ = _exponents(self.width, self.height)

        def coordinate(dim: int) -> Array:
            # The first digits select the pixel; the others give the offset full precision at any resolution.
            if dim == 0:
                return to_unit(reverse((index ^ self.flips) >> log_columns), dtype)
            if dim == 1:
                if self.tables is None:
                    return radical_inverse(rest, 3, dtype)
                return permuted_radical_inverse(rest, 3, self.tables, dtype)
            return self.sequence.coordinate(index, dim, dtype)

        return jnp.stack([coordinate(j) for j in dims], axis=-1)


def halton_full_screen(sequence: RadicalInverses, width: int, height: int) -> HaltonFullScreen:
    """Invert a Halton sequence with bases 2 and 3 first, as in :func:`full_screen`, for checked sizes."""
    if sequence.bases[:2] != (2, 3):
        raise ValueError(
            f"net must have the bases 2 and 3 first to fill a raster, got bases={sequence.bases}"
        )
    log_columns, log_rows = _exponents(width, height)
    if 2**log_columns * 3**log_rows > checks.INDEX_LIMIT:
        raise ValueError(
            f"width, height must be covered by at most 2**32 = 2**a x 3**b pixels, got {width} x {height}, "
            f"which takes 2**{log_columns} x 3**{log_rows}"
        )
    if sequence.tables is None:
        return HaltonFullScreen(width, height, sequence, jnp.uint32(0), None, None)
    return HaltonFullScreen(width, height, sequence, *_inverted(sequence.tables, log_rows))


def _exponents(width: int, height: int) -> tuple[int, int]:
    """Return the smallest a and b with 2**a >= width and 3**b >= height."""
    log_rows = 0
    while 3**log_rows < height:
        log_rows += 1
    return (width - 1).bit_length(), log_rows


@partial(jax.jit, static_argnames="log_rows")
def _inverted(tables: Array, log_rows: int) -> tuple[Array, Array, Array]:
    """Return the permutations that a screen of 3**log_rows rows needs."""
    binary, start = _permutations(tables, 2, 0)
    ternary, _ = _permutations(tables, 3, start)
    flips = jnp.sum(binary[:, 0] << jax.lax.iota(jnp.uint32, 32), dtype=jnp.uint32)
    inverses = jnp.argsort(ternary[:log_rows], axis=1).astype(jnp.uint32)
    # Digits beyond those of uint32 indices stay 0, as in the sequence.
    beyond = jnp.tile(jnp.arange(3, dtype=jnp.uint32), (log_rows, 1))
    return flips, inverses, jnp.concatenate(reflection_tables(jnp.concatenate([ternary[log_rows:], beyond])))


def _permutations(tables: Array, base: int, start: int) -> tuple[Array, int]:
    """Return the digit permutations of one base from its reflection tables, and where these end.

    The entry of a base**k in a table of s digits has digit k, permuted, as its digit s - 1 - k.
    """
    rows = []
    for span in digit_spans(base):
        powers = base ** np.arange(span, dtype=np.uint32)[:, None]
        reflected = tables[start + powers * np.arange(base, dtype=np.uint32)].astype(jnp.uint32)
        rows.append(reflected // powers[::-1] % np.uint32(base))
        start += base**span
    return jnp.concatenate(rows), start


@frozen_pytree
class FullScreen(ForImage):
    """A net scaled to the pixel raster."""

    net: Invertible

    @property
    def dims(self) -> int:
        return self.net.dims

    @property
    def fits(self) -> Fits:
        exact = self.net.size is not None
        why = "the net's points in a pixel of this image" if exact else "for this sequence and image"
        return Fits((self.width, self.height), self.net.points_per_cell(self.log_side), exact, why)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        x, y = state
        index = self.net.index_in_cell(x, y, self.log_side, sample)
        # The leading bits of the first two coordinates select the pixel. After shifting them out, the rest
        # has full precision at any resolution.
        words = [self.net.word(index, j) << (self.log_side if j < 2 else 0) for j in dims]
        return jnp.stack([to_unit(word, dtype) for word in words], axis=-1)

    def finer(self, count: int) -> "FullScreen":
        if self.net.size is not None:
            more_samples(self.fits.spp, count, self.fits.spp)
        return self


def full_screen(net: Invertible | SequenceLike, width: int, height: int) -> FullScreen | HaltonFullScreen:
    """Sample the whole screen with one net: each pixel takes the points that fall into it.

    Inverting the net in integer arithmetic gives the indices of a pixel's points, without tables.

    Parameters
    ----------
    net : sequence in base 2, or Halton sequence
        An invertible one: a digital sequence, a net with ``index_in_cell``, or
        :func:`qmcjax.sequences.digital_shift` or ``art_owen`` of one of these. If ``2**k`` is the smallest
        power of two that covers the image, a net of ``2**m`` points has ``2**(m - 2 k)`` in every pixel,
        and a digital (0,2)-sequence has one of each block of ``4**k`` points. A Halton sequence, with or
        without permuted digits, has one of each ``2**a * 3**b`` points in every pixel of the smallest raster
        of ``2**a`` by ``3**b`` pixels that covers the image.
    width, height : int, in [1, 65536]; for a Halton sequence ``2**a * 3**b`` must be at most 2**32

    Returns
    -------
    FullScreen or HaltonFullScreen
        ``fits.spp`` is the number of points per pixel. A net must be rendered with exactly this number of
        samples. For a sequence it is the largest number that 32-bit indices allow: with the Halton sequence
        11506 for 512 x 512 pixels, 958 for 1920 x 1080, and 26 for 8192 x 8192.

    Notes
    -----
    The leading digits of a point determine its pixel. A digital shift flips them, which is undone before the
    net is inverted. For the Halton sequence, column and row give the index modulo 2**a and 3**b.

    Each sample of a pixel is uniform over keys after a digital shift, and for randomly permuted digits. With
    ``jittered``, only all samples of a pixel together are, since each has its own cell. Others have no key.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4 and 5.2.5.
    .. [2] A. Keller, "Myths of computer graphics", Monte Carlo and Quasi-Monte Carlo Methods 2004, 2006 (the
       Halton sequence over the pixel raster).

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> sampler = samplers.full_screen(sequences.larcher_pillichshammer_net(20), 256, 256)
    >>> print(sampler.fits.spp, sampler(255, 255, 15))
    16 [0.96875    0.33325195]
    >>> print(samplers.full_screen(sequences.halton(2), 2, 3)(1, 2, 0))  # point 5, (0.625, 0.777...), of 6
    [0.25       0.33333334]
    """
    width, height = checks.image_size(width, height)
    if isinstance(net, RadicalInverses):
        return halton_full_screen(net, width, height)
    return FullScreen(width, height, inverted(net, log_side(width, height)))

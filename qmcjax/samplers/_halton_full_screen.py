"""The Halton sequence over the whole screen: each pixel takes the points that fall into it."""

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
from qmcjax.samplers._base import ForImage
from qmcjax.sequences import RadicalInverses


@frozen_pytree
class HaltonFullScreen(ForImage):
    """A Halton sequence scaled to the smallest raster of 2**a x 3**b pixels that covers the image.

    The first a binary digits of an index give its column, the first b ternary digits its row: so one of each
    2**a 3**b consecutive points lies in every pixel.
    """

    sequence: RadicalInverses
    flips: Array
    """uint32: bit k is set if the permutation of binary digit k swaps."""
    inverses: Array | None
    """uint32 (b, 3): row k maps ternary digit k of the second component to that of the index."""
    tables: Array | None
    """uint16: the reflection tables of the ternary digits from the b-th on."""

    _sized = "sequence"

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def raster(self) -> tuple[int, int]:
        log_columns, log_rows = _exponents(self.width, self.height)
        return 2**log_columns, 3**log_rows

    @property
    def spp(self) -> int:
        """Largest number of samples with all indices below 2**32."""
        columns, rows = self.raster
        return checks.INDEX_LIMIT // (columns * rows)

    def index(self, x: Array, y: Array, sample: Array) -> Array:
        """Return the index of the point of a pixel in a block: ``sample * 2**a * 3**b`` or following."""
        return self._index(x, y, sample)[0]

    def _index(self, x: Array, y: Array, sample: Array) -> tuple[Array, Array]:
        """Return the index and index // 3**b, its ternary digits after those of the row."""
        log_columns, log_rows = _exponents(self.width, self.height)
        columns, rows = self.raster
        ones = np.uint32(columns - 1)
        # The column gives the index modulo 2**a; the bits above are masked below. In two steps: a shift by 32
        # is not defined.
        by_column = (reverse(x) >> 1 >> (31 - log_columns)) ^ self.flips
        # The row gives it modulo 3**b: its last digit is digit b - 1 of the index.
        by_row = jnp.zeros_like(y)
        for k in reversed(range(log_rows)):
            y, digit = y // np.uint32(3), y % np.uint32(3)
            if self.inverses is not None:
                digit = permuted_digit(self.inverses[k], digit)
            by_row = by_row * np.uint32(3) + digit
        # Garner's form of the Chinese remainder theorem with the power of three first: the second digit
        # is needed modulo a power of two only, exact in words that wrap.
        second = ((by_column - by_row) * np.uint32(pow(rows, -1, columns))) & ones
        rest = sample * np.uint32(columns) + second
        return rest * np.uint32(rows) + by_row, rest

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        x, y = state
        index, rest = self._index(x, y, sample)
        log_columns, _ = _exponents(self.width, self.height)

        def coordinate(dim: int) -> Array:
            # The first digits are the pixel; the others give the offset full precision at any resolution.
            if dim == 0:
                return to_unit(reverse((index ^ self.flips) >> log_columns), dtype)
            if dim == 1:
                if self.tables is None:
                    return radical_inverse(rest, 3, dtype)
                return permuted_radical_inverse(rest, 3, self.tables, dtype)
            return self.sequence.coordinate(index, dim, dtype)

        return jnp.stack([coordinate(j) for j in dims], axis=-1)

    @property
    def _limited(self) -> str:
        return "for 2**32 indices over a raster of {} x {}".format(*self.raster)


def halton_full_screen(sequence: RadicalInverses, width: int, height: int) -> HaltonFullScreen:
    """Invert a Halton sequence with the bases 2 and 3 first: :func:`full_screen`, for checked sizes."""
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
    """Return the permutations of a sequence that a screen of 3**log_rows rows needs."""
    binary, start = _permutations(tables, 2, 0)
    ternary, _ = _permutations(tables, 3, start)
    flips = jnp.sum(binary[:, 0] << jax.lax.iota(jnp.uint32, 32), dtype=jnp.uint32)
    inverses = jnp.argsort(ternary[:log_rows], axis=1).astype(jnp.uint32)
    # Digits beyond those of uint32 indices stay 0, as in the sequence.
    beyond = jnp.tile(jnp.arange(3, dtype=jnp.uint32), (log_rows, 1))
    return flips, inverses, jnp.concatenate(reflection_tables(jnp.concatenate([ternary[log_rows:], beyond])))


def _permutations(tables: Array, base: int, start: int) -> tuple[Array, int]:
    """Return the digit permutations of one base from its reflection tables, and the end of these.

    The entry of a base**k in a table of s digits has digit k, permuted, as its digit s - 1 - k.
    """
    rows = []
    for span in digit_spans(base):
        powers = base ** np.arange(span, dtype=np.uint32)[:, None]
        reflected = tables[start + powers * np.arange(base, dtype=np.uint32)].astype(jnp.uint32)
        rows.append(reflected // powers[::-1] % np.uint32(base))
        start += base**span
    return jnp.concatenate(rows), start

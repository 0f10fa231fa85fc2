"""Products of generator matrices over F2, and their inverses: from a cell of a raster to its points.

Nets implement their own inverse; a digital sequence is inverted by linear equations over F2. Each aligned
block of ``4**k`` points of a (0,2)-sequence, a frame, has one point in every cell of a raster of ``2**k``
cells per side. The frame gives the upper bits of the index, the cell the lower ``2 k``.
"""

import math
from dataclasses import field
from functools import partial
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax.core.bits import reverse, traced_once
from qmcjax.core.jax_internals import alike
from qmcjax.core.pytrees import frozen_pytree

_TABLE_FROM = 4096
"""Number of indices above which tables of the products with all bytes pay off."""


def product(columns: Array, index: Array) -> Array:
    """Xor the columns that the bits of the index select: (32[, dims]), (...) -> (...[, dims])."""
    if math.prod(index.shape) < _TABLE_FROM:
        return selected(columns, index)
    byte = jax.lax.iota(jnp.uint32, 256)
    words = jnp.zeros((*index.shape, *columns.shape[1:]), jnp.uint32)
    for shift in (0, 8, 16, 24):
        table = selected(columns[shift : shift + 8], byte)
        # A byte is always within its table: skip bounds checks.
        words = words ^ table.at[(index >> shift) & np.uint32(255)].get(mode="promise_in_bounds")
    return words


def packed(matrices: NDArray) -> NDArray[np.uint32]:
    """Pack matrices over F2, (dims, up to 32 rows, columns), into words: columns, the first row in bit 31."""
    weights = np.uint32(1) << np.arange(31, 31 - matrices.shape[1], -1, dtype=np.uint32)
    return np.einsum("jrc,r->jc", matrices.astype(np.uint32), weights)


@traced_once
def selected(columns: Array | np.ndarray, index: Array) -> Array:
    """Xor the columns that the bits of the index select, one by one."""
    words = jnp.zeros((*index.shape, *columns.shape[1:]), jnp.uint32)
    for k in range(columns.shape[0]):
        # 0 - 1 wraps to all ones: a mask instead of a comparison and a select.
        mask = np.uint32(0) - ((index >> k) & np.uint32(1))
        if columns.ndim == 1:
            words = words ^ (mask & columns[k])
        else:
            words = words ^ (mask[..., None] & columns[k].reshape((1,) * index.ndim + (-1,)))
    return words


@runtime_checkable
class Invertible(Protocol):
    """A point set in base 2 that returns the indices of its points in a cell of a raster."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        ...

    @property
    def size(self) -> int | None:
        """Number of points; None if each sample is another frame of a sequence."""
        ...

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        ...

    def points_per_cell(self, log_side: int) -> int:
        """Return the number of points in each cell of a raster of ``2**log_side`` cells per side."""
        ...

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of a point in a cell."""
        ...


@frozen_pytree
class NetByFrames:
    """A (0,2)-sequence split into frames with one point in each cell of a raster."""

    sequence: Any
    """Digital, in base 2."""
    inverse: Array
    """uint32 (2 * log_side,): column i contains the lower index bits that change with digit i of the cell."""
    log_side: int = field(metadata={"static": True})

    called = "net_by_frames"
    reported = ("dims",)

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def size(self) -> None:
        """None: only 32-bit indices limit the number of frames."""
        return

    def word(self, index: Array, dim: int) -> Array:
        return self.sequence.word(index, dim)

    def points_per_cell(self, log_side: int) -> int:
        if log_side != self.log_side:
            raise ValueError(f"log_side must be {self.log_side}, as of the frames, got {log_side}")
        return 4 ** (16 - log_side)

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of the point of a cell in a frame: ``sample * 4**log_side`` or following."""
        if log_side == 0:
            return sample
        # With 2**16 cells per side there is one frame; a shift by 32 is undefined.
        start = sample << (2 * log_side) if log_side < 16 else jnp.zeros_like(sample)
        ones = np.uint32(2**log_side - 1)
        wrong_x = reverse(x << (32 - log_side)) ^ self.sequence.bit_reversed(start, 0)
        wrong_y = reverse(y << (32 - log_side)) ^ self.sequence.bit_reversed(start, 1)
        wrong = (wrong_x & ones) | ((wrong_y & ones) << log_side)
        return start | selected(self.inverse, wrong)


@frozen_pytree
class MappedCells:
    """An invertible net after a map of its coordinates, which permutes the cells."""

    net: Invertible
    f: Any
    """With the methods ``word(word, dim)`` and ``inverse(word, dim)``."""

    reported = ("dims", "size")

    @property
    def called(self) -> str:
        return self.f.called

    @property
    def dims(self) -> int:
        return self.net.dims

    @property
    def size(self) -> int | None:
        return self.net.size

    def word(self, index: Array, dim: int) -> Array:
        return self.f.word(self.net.word(index, dim), dim)

    def points_per_cell(self, log_side: int) -> int:
        return self.net.points_per_cell(log_side)

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of a point in a cell: that of the net's point in the cell that was moved here."""

        def before(place: Array, dim: int) -> Array:
            # Two shifts, because a shift by 32 is undefined.
            return self.f.inverse(place << (31 - log_side) << 1, dim) >> 1 >> (31 - log_side)

        return self.net.index_in_cell(before(x, 0), before(y, 1), log_side, sample)


def net_by_frames_of(sequence: Any, matrices: Array, log_side: int) -> NetByFrames:
    """Invert the digital sequence in base 2 with the given generator matrices, uint32 (dims, 32)."""
    if sequence.dims < 2:
        raise ValueError(f"net must have at least 2 dimensions to fill a raster, got {sequence.dims}")
    if log_side == 0:
        return NetByFrames(sequence, jnp.zeros(0, jnp.uint32), 0)
    columns, regular = _inverse(matrices[:2], log_side)
    if not isinstance(regular, Tracer) and not regular:
        raise ValueError(
            f"sequence must put one of each {4**log_side} points into every cell of a raster of "
            f"{2**log_side} x {2**log_side}: its first two matrices are not independent there"
        )
    return NetByFrames(sequence, columns, log_side)


@partial(jax.jit, static_argnames="log_side")
def _inverse(columns: Array, log_side: int) -> tuple[Array, Array]:
    """Return the inverse of the stacked leading rows of two matrices, and whether it exists."""
    count = 2 * log_side
    bit_reversed = reverse(columns[:, :count])
    bit = jax.lax.iota(jnp.uint32, count)
    # Row i of the system is for digit i of the cell, a word with one bit for each of the lower index bits.
    digits = jnp.concatenate(
        [(bit_reversed[j][None, :] >> bit[:log_side, None]) & np.uint32(1) for j in range(2)]
    )
    unit = jnp.uint32(1) << bit
    rows = jnp.sum(digits * unit[None, :], axis=1, dtype=jnp.uint32)

    def eliminate(c: Array, state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        left, right, regular = state
        has = (left >> c) & np.uint32(1)
        candidates = (has == 1) & (bit >= c)
        pivot = jnp.argmax(candidates).astype(jnp.uint32)
        # Adding the pivot row puts a one on the diagonal if it is zero; then clear the other rows.
        lacks = (bit == c) & (has == 0)
        left, right = (jnp.where(lacks, rows ^ rows[pivot], rows) for rows in (left, right))
        others = (((left >> c) & np.uint32(1)) == 1) & (bit != c)
        left, right = (jnp.where(others, rows ^ rows[c], rows) for rows in (left, right))
        return left, right, regular & jnp.any(candidates)

    _, solution, regular = jax.lax.fori_loop(
        np.uint32(0), np.uint32(count), eliminate, alike((rows, unit, jnp.bool_(True)))
    )
    bits = (solution[:, None] >> bit[None, :]) & np.uint32(1)
    return jnp.sum(bits * unit[:, None], axis=0, dtype=jnp.uint32), regular

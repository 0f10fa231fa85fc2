"""From a cell of a raster to the indices of the points of a net in it, also after a scrambling.

Nets invert themselves; for a digital sequence linear equations over F2 are solved. Each ``4**k`` consecutive
points of a (0,2)-sequence put one point into every cell of a raster of ``2**k`` cells per side: a frame. The
frame gives the upper bits of the index, the cell the lower ``2 k``.
"""

import abc
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core.bits import reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.core.varying import alike
from qmcjax.sequences._digital.matrix_products import selected


@runtime_checkable
class Invertible(Protocol):
    """A point set in base 2 that gives the indices of its points in a cell of a raster."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        ...

    @property
    def size(self) -> int | None:
        """Number of points; None if each further sample is a further frame of a sequence."""
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
    """uint32 (2 * log_side,): column i has the lower index bits that change with digit i of the cell."""
    log_side: int = field(metadata={"static": True})

    called = "net_by_frames"
    reported = ("dims",)

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def size(self) -> None:
        """None: the number of frames is limited by 32-bit indices only."""
        return

    def word(self, index: Array, dim: int) -> Array:
        return self.sequence.word(index, dim)

    def points_per_cell(self, log_side: int) -> int:
        """Return the number of frames."""
        if log_side != self.log_side:
            raise ValueError(f"log_side must be {self.log_side}, as of the frames, got {log_side}")
        return 4 ** (16 - log_side)

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of the point of a cell in a frame: ``sample * 4**log_side`` or following."""
        if log_side == 0:
            return sample
        # With 2**16 cells per side there is one frame; a shift by 32 is not defined.
        start = sample << (2 * log_side) if log_side < 16 else jnp.zeros_like(sample)
        ones = np.uint32(2**log_side - 1)
        wrong_x = reverse(x << (32 - log_side)) ^ self.sequence.bit_reversed(start, 0)
        wrong_y = reverse(y << (32 - log_side)) ^ self.sequence.bit_reversed(start, 1)
        wrong = (wrong_x & ones) | ((wrong_y & ones) << log_side)
        return start | selected(self.inverse, wrong)


@dataclass(frozen=True)
class Moved:
    """An invertible net after a scrambling; it permutes the cells, and subclasses undo that."""

    net: Invertible

    reported = ("dims", "size")

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.net.dims

    @property
    def size(self) -> int | None:
        """Number of points, None for frames."""
        return self.net.size

    def points_per_cell(self, log_side: int) -> int:
        """Return the number of points in each cell, as without the scrambling."""
        return self.net.points_per_cell(log_side)

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of a point in a cell: that of the net in the cell moved here."""
        x, y = self.before(x, 0, log_side), self.before(y, 1, log_side)
        return self.net.index_in_cell(x, y, log_side, sample)

    @abc.abstractmethod
    def before(self, place: Array, dim: int, log_side: int) -> Array:
        """Return the columns (dimension 0) or rows (1) that the scrambling moved to some places."""


@frozen_pytree
class Flipped(Moved):
    """An invertible net after a digital shift."""

    shifts: Array
    """uint32 (dims,): the digital shift."""

    called = "digital_shift"

    def word(self, index: Array, dim: int) -> Array:
        return self.net.word(index, dim) ^ self.shifts[dim]

    def before(self, place: Array, dim: int, log_side: int) -> Array:
        """Return the columns or rows that were moved to some places."""
        # In two steps: a shift by 32 is not defined.
        return place ^ (self.shifts[dim] >> 1 >> (31 - log_side))


def net_by_frames_of(sequence: Any, matrices: Array, log_side: int) -> NetByFrames:
    """Invert the digital sequence in base 2 of some generator matrices, uint32 (dims, 32)."""
    if sequence.dims < 2:
        raise ValueError(f"sequence must have at least 2 dimensions to fill a raster, got {sequence.dims}")
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
    # Row i of the system is digit i of the cell, as a word with one bit for each of the lower index bits.
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
        # Adding the pivot row puts a one on the diagonal where there is none; then the other rows are
        # cleared.
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

"""One scrambled sequence of all coordinates, its blocks given to pixels by a searched linear map."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax import orders
from qmcjax.core import tables
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._contiguous import Contiguous
from qmcjax.sequences import Digital, InTime, digital, in_time, niederreiter_xing, owen, sobol

SMALL_DIMS = 4
"""Most dimensions with Niederreiter-Xing's sequence or, in animations, searched frames: those of tables."""

_TIMES = (2, 0, 1, 3)
"""Coordinates of Sobol's sequence with the columns of the matrices of frames that were not searched."""

_PIXEL_BITS = 16

_NUMBERS = 12
"""Most digits of the numbers of samples that come first in their pixels, beyond the tables."""

_LINES_FROM = 4096
"""Number of pixels from which tables of columns and rows pay off."""


@cache
def _tables(dims: int) -> dict[int, NDArray[np.int64]]:
    """Read the indices of the bits of Morton codes, by binary logarithm of the samples."""
    return {
        int(digits): np.array([int(word, 16) for word in words], np.int64)
        for of, digits, *words in tables.rows("samplers", "optimized_joint.txt")
        if int(of) == dims
    }


@cache
def _moving() -> tuple[dict[int, NDArray[np.int64]], dict[int, NDArray[np.uint32]]]:
    """Read such indices for animations, and the first columns of the matrices of frames."""
    indices, frames = {}, {}
    for digits, *words in tables.rows("samplers", "optimized_moving.txt"):
        numbers = np.array([int(word, 16) for word in words], np.int64)
        indices[int(digits)] = numbers[:_PIXEL_BITS]
        frames[int(digits)] = numbers[_PIXEL_BITS:].astype(np.uint32).reshape(SMALL_DIMS, -1)
    return indices, frames


def index_bits(
    tables: Mapping[int, NDArray[np.int64]], digits: int, matrices: NDArray[np.uint32]
) -> NDArray[np.uint32]:
    """Return the index in the sequence that each bit of a Morton-ordered index stands for: uint32 (32,).

    Bit k itself, but searched indices for the bits of pixels, as far as they have bits below 32. ``tables``:
    indices of the bits of Morton codes, by binary logarithms of numbers of samples. ``digits``: this
    logarithm. ``matrices``: those of the sequence.
    """
    known = min(digits, max(tables))
    words = tables[known]
    if known < digits:
        words = _longer(words, known, digits, matrices)
    # The word of a bit has no higher bits than those of its level.
    used = min(len(words), (32 - digits) // 2 * 2)
    found = np.uint32(1) << np.arange(32, dtype=np.uint32)
    found[digits : digits + used] = words[:used]
    return found


def _longer(
    words: NDArray[np.int64], known: int, digits: int, matrices: NDArray[np.uint32]
) -> NDArray[np.int64]:
    """Return words for more samples, with first samples nearest to those of the searched words."""

    def points(index: NDArray[np.int64]) -> NDArray[np.uint32]:
        bits = index[:, None, None] >> np.arange(32) & 1
        return np.bitwise_xor.reduce(np.where(bits, matrices, 0), axis=-1)

    numbers = np.arange(2 ** min(digits, _NUMBERS))
    longer = words >> known << digits
    apart = points(words)[:, None] ^ points(longer)[:, None] ^ points(numbers)
    return longer | np.argmin(apart.max(axis=-1), axis=-1)


def _reordered(sequence: Digital, bits: NDArray[np.uint32]) -> Digital:
    """Return the points of a sequence at mapped indices; digits of indices from 32 on are as they were."""
    return replace(digital(sequence.bits(bits).T), upper=sequence.upper)


@frozen_pytree
class Joint(Contiguous):
    """Contiguous blocks along the Morton order: points are linear over F2 in the digits of x and y."""

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the states of many pixels from those of all columns and all rows: no products for each."""
        side, _ = self.order.raster
        if x.size < max(side, _LINES_FROM):
            return super().prepare(x, y, dims)
        columns, rows = self._lines(side, side, dims)
        return jax.tree.map(
            lambda column, row: (
                column.at[x].get(mode="promise_in_bounds") ^ row.at[y].get(mode="promise_in_bounds")
            ),
            columns,
            rows,
        )

    def prepare_image(self, width: int, height: int, dims: tuple[int, ...]) -> Any:
        columns, rows = self._lines(width, height, dims)
        return jax.tree.map(lambda column, row: column[None, :] ^ row[:, None], columns, rows)

    def _lines(self, width: int, height: int, dims: tuple[int, ...]) -> tuple[Any, Any]:
        """Return the states of the pixels of the first row, and of the first column."""
        x, y = jnp.arange(width, dtype=jnp.uint32), jnp.arange(height, dtype=jnp.uint32)
        first = super().prepare
        return first(x, jnp.zeros_like(x), dims), first(jnp.zeros_like(y), y, dims)


def joint(width: int, height: int, spp: int, key: Array | int, dims: int, moving: bool) -> Joint:
    """Sample all coordinates by one Owen-scrambled sequence, as :func:`optimized` describes."""
    order, digits = orders.morton(width, height), spp.bit_length() - 1
    # Coordinates of Niederreiter and Xing's are not nets of t = 0, as windows of pixels and frames need.
    if dims <= SMALL_DIMS and order.length * spp <= 2**32 and not moving:
        make, searched, tables = niederreiter_xing, SMALL_DIMS, _tables(SMALL_DIMS)
    elif moving and dims <= SMALL_DIMS:
        make, searched, tables = sobol, SMALL_DIMS, _moving()[0]
    else:
        make, searched, tables = sobol, 2 * SMALL_DIMS, _tables(2 * SMALL_DIMS)
    with jax.ensure_compile_time_eval():
        matrices = np.asarray(make(searched).matrices)
    bits = index_bits(tables, digits, matrices)
    scrambled: Any = owen(_reordered(make(dims), bits), key)
    return Joint(order, _in_time(scrambled, digits) if moving else scrambled, spp)


def _in_time(sequence: Any, digits: int) -> InTime:
    """Return a sequence that moves, in few dimensions by searched matrices of frames."""
    moved, (_, frames) = in_time(sequence), _moving()
    if sequence.dims > SMALL_DIMS:
        return moved
    searched = frames[min(digits, max(frames))]
    others = sobol(SMALL_DIMS).matrices[np.array(_TIMES), searched.shape[1] :]
    times = jnp.concatenate([jnp.asarray(searched), others], axis=1)[: sequence.dims]
    return replace(moved, times=digital(times))

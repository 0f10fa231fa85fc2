"""Products of generator matrices over F2 with the bits of indices: xors of columns."""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.traces import traced_once

_TABLE_FROM = 4096
"""Number of indices from which tables of the products with all bytes pay off."""


def product(columns: Array, index: Array) -> Array:
    """Xor the columns that the bits of the index select: (32[, dims]), (...) -> (...[, dims])."""
    if math.prod(index.shape) < _TABLE_FROM:
        return selected(columns, index)
    byte = jax.lax.iota(jnp.uint32, 256)
    words = jnp.zeros((*index.shape, *columns.shape[1:]), jnp.uint32)
    for shift in (0, 8, 16, 24):
        table = selected(columns[shift : shift + 8], byte)
        # A byte is within its table: this skips bounds checks.
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

"""Points of some samples of the pixels of a rectangle, as NumPy arrays."""

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.pytrees import jit
from qmcjax.samplers import Sampler

PIECE = 2**20
"""Approximate number of coordinates computed together: 8 MiB in float64."""


@jit("width", "height", "count", "dims", "dtype")
def _piece(
    sampler: Sampler,
    corner: Array,
    first: Array,
    width: int,
    height: int,
    count: int,
    dims: tuple[int, ...],
    dtype: DTypeLike,
) -> Array:
    """Return the points of a rectangle with its corner at (x, y), samples from the first on."""

    def run(start: Array, length: int, axis: int) -> Array:
        shape = [1, 1, 1]
        shape[axis] = length
        return start + jnp.arange(length, dtype=jnp.uint32).reshape(shape)

    x, y, sample = run(corner[0], width, 1), run(corner[1], height, 0), run(first, count, 2)
    return sampler(x, y, sample, dims, dtype)


def pixel_points(
    sampler: Sampler,
    corner: tuple[int, int],
    size: tuple[int, int],
    first: int,
    count: int,
    dims: tuple[int, ...],
    dtype: DTypeLike,
) -> NDArray:
    """Return points of valid pixels and samples.

    ``corner``, ``size``: first column and row of the rectangle; number of columns and rows. ``first``,
    ``count``: samples. ``dtype``: float32 or float64. Returns array of ``dtype``, shape (rows, columns,
    count, len(dims)).
    """
    (x, y), (width, height) = corner, size
    rows = max(1, min(height, PIECE // (width * count * len(dims))))
    found = np.empty((height, width, count, len(dims)), dtype)
    with checks.precision(dtype):
        for start in range(0, height, rows):
            # The last piece begins early enough to be as large as the others: they share one program.
            top = min(start, height - rows)
            at = np.array([x, y + top], np.uint32)
            piece = _piece(sampler, at, np.uint32(first), width, rows, count, dims, np.dtype(dtype))
            found[top : top + rows] = np.asarray(piece)
    return found

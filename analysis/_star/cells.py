"""Bounds of the star discrepancy of very many points, by counts in cells: one pass over the points.

Let e be edges of cells on every axis and C(i) the number of points that are below e_i in all coordinates. A
box that ends at q, with e_i < q <= e_(i+1) if it is open and e_i <= q < e_(i+1) if closed, has at least the
volume V(e_i) and at most V(e_(i+1)), and holds at least C(i) and at most C(i + 1) points: the simplest
bracketing cover [E. Thiemard, "An algorithm to compute bounds for the star discrepancy", 2001].
"""

import numpy as np
from numpy.typing import NDArray

_CELLS = 2**24
"""Upper limit of the number of cells."""

_BLOCK = 2**16
"""Points that are counted together."""


def cell_bounds(points: NDArray[np.float64]) -> tuple[float, float]:
    """Return a lower and an upper bound, to rounding errors of a few 2^-53."""
    n, dims = points.shape
    side = _prime(int(_CELLS ** (1 / dims)))
    edges = np.arange(side + 1) / side
    count = np.zeros((side + 1,) * dims, np.int32 if n < 2**31 else np.int64)
    cells = count.ravel()
    for start in range(0, n, _BLOCK):
        # Compared with the edges: a product with their number may be rounded across one.
        index = np.searchsorted(edges, points[start : start + _BLOCK].T, side="right")
        np.add.at(cells, np.ravel_multi_index(tuple(index), count.shape), 1)
    for axis in range(dims):
        np.cumsum(count, axis=axis, out=count)

    lower = upper = 0.0
    area, next_area = np.ones(1), np.ones(1)
    for _ in range(dims - 1):
        area, next_area = np.multiply.outer(area, edges), np.multiply.outer(next_area, edges[1:])
    area = area.reshape(count.shape[1:])
    next_area = next_area.reshape((side,) * (dims - 1))
    first, second = (slice(None, -1),) * (dims - 1), (slice(1, None),) * (dims - 1)
    for i in range(side):
        share, next_share = count[i] / n, count[i + 1] / n
        lower = max(lower, float(np.abs(edges[i + 1] * area - next_share).max()))
        upper = max(
            upper,
            float((edges[i + 1] * next_area - share[first]).max()),
            float((next_share[second] - edges[i] * area[first]).max()),
        )
    return lower, upper


def _prime(most: int) -> int:
    """Return the largest prime up to a number: in powers of their base nets fill cells evenly."""
    return next(k for k in range(most, 1, -1) if all(k % j for j in range(2, int(k**0.5) + 1)))

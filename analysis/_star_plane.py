"""The star discrepancy in the plane by tiles of the critical grid."""

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["plane_star_discrepancy"]

_MARGIN = 1e-14
"""More than the rounding errors of the bounds on tiles."""

Floats = NDArray[np.float64]


def plane_star_discrepancy(points: Floats) -> float:
    """Return the star discrepancy of points in the unit square.

    Row i and column j of the grid stand for the boxes that hold the points of ranks below i in x and
    below j in y: an open box that ends at the next coordinates, and a closed one that ends at the
    last. Equal coordinates need no care: a box of the wrong rank among them has a smaller value.

    The (n + 1)^2 boxes are cut into tiles of about sqrt(n) rows and columns. In row i of a tile that
    begins at row I and column J, an open box has the local discrepancy

        x_i y_j - C(i, j)/n  <=  max_j (x_i y_j - C(I, j)/n) - R_i/n,

    R_i the number of points of ranks I to i - 1 in x and below J in y. The maximum of lines is convex
    in x_i and so below the chord between the tile's first and last row. The like holds for closed
    boxes, with R_i up to the tile's last column. All tiles are bounded in O(n^1.5) steps and O(n)
    memory. Those with a bound above the largest value found are evaluated, and of these the rows with
    such a bound.
    """
    n = len(points)
    side = max(8, math.isqrt(n))
    tiles = -(-(n + 1) // side)
    # Rows and columns beyond the grid repeat its last ones; no point enters there.
    padding = tiles * side - n
    shape = (tiles, side)
    by_x, by_y = (np.argsort(points[:, j], kind="stable") for j in range(2))
    x_open, x_closed = _ends(points[by_x, 0], padding, shape)
    y_open, y_closed = _ends(points[by_y, 1], padding, shape)
    beyond = np.full(padding, tiles * side + 1)
    y_rank = np.append(np.argsort(by_y)[by_x], beyond).reshape(shape)
    x_rank = np.append(np.argsort(by_x)[by_y], beyond).reshape(shape)
    columns = np.arange(tiles * side).reshape(shape)
    edges = side * np.arange(tiles + 1)

    best = 0.0
    bounds = np.empty((tiles, tiles))
    counts = np.empty((tiles, tiles), np.int64)
    peaks = np.empty((tiles, 4, tiles))
    for i in range(tiles):
        count = _below(x_rank.ravel(), i * side)
        counts[i] = count[::side]
        share = (count / n).reshape(shape)
        for k, row in enumerate((0, -1)):
            peaks[i, k] = (x_open[i, row] * y_open - share).max(axis=1)
            peaks[i, 2 + k] = (share - x_closed[i, row] * y_closed).max(axis=1)
        best = max(best, float(peaks[i, ::2].max()))
        entered = _below(y_rank[i, :, None], edges) / n
        bounds[i] = _row_bounds(peaks[i], x_open[i], x_closed[i], entered).max(axis=0)

    for tile in np.argsort(-bounds, axis=None):
        i, j = divmod(int(tile), tiles)
        if bounds[i, j] + _MARGIN <= best:
            break
        entered = _below(y_rank[i, :, None], edges[j : j + 2]) / n
        row_bounds = _row_bounds(peaks[i, :, j : j + 1], x_open[i], x_closed[i], entered)[:, 0]
        rows = np.flatnonzero(row_bounds + _MARGIN > best)
        count = _below(y_rank[i, : rows[-1] + 1, None], columns[j])[rows]
        share = (counts[i, j] + _below(x_rank[j], i * side) + count) / n
        opened = x_open[i, rows, None] * y_open[j] - share
        closed = share - x_closed[i, rows, None] * y_closed[j]
        best = max(best, float(opened.max()), float(closed.max()))
    return best


def _ends(coordinates: Floats, padding: int, shape: tuple[int, int]) -> tuple[Floats, Floats]:
    """Return where open and closed boxes end in sorted coordinates, tile by tile."""
    opened = np.append(coordinates, np.ones(padding))
    closed = np.concatenate([[0.0], coordinates, np.full(padding - 1, coordinates[-1])])
    return opened.reshape(shape), closed.reshape(shape)


def _below(ranks: NDArray[np.integer], limit: int | NDArray[np.integer]) -> NDArray[np.int64]:
    """Count along the first axis the ranks before each that are below a limit."""
    is_below = ranks < limit
    count = np.zeros(is_below.shape, np.int64)
    np.cumsum(is_below[:-1], axis=0, out=count[1:])
    return count


def _row_bounds(peaks: Floats, x_open: Floats, x_closed: Floats, entered: Floats) -> Floats:
    """Bound the rows of tiles: chords between the peaks, less or plus the points that entered."""
    first_open, last_open, first_closed, last_closed = peaks
    opened = first_open + _along(x_open) * (last_open - first_open) - entered[:, :-1]
    closed = first_closed + _along(x_closed) * (last_closed - first_closed) + entered[:, 1:]
    return np.maximum(opened, closed)


def _along(x: Floats) -> Floats:
    """Return the positions of ascending numbers between the first, 0, and the last, 1, as a column."""
    return ((x - x[0]) / max(x[-1] - x[0], np.finfo(np.float64).tiny))[:, None]

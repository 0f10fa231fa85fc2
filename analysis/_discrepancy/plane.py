"""The star discrepancy in the plane by tiles of the critical grid."""

import math

import numpy as np
from numpy.typing import NDArray

from analysis._discrepancy.critical_grid import LocalDiscrepancy

_MARGIN = 1e-14
"""More than the rounding errors of the bounds on tiles."""

_BATCH = 32
"""Maximum number of tiles that are evaluated together: the best one first, then two, four and so on."""

Floats = NDArray[np.float64]


def plane_star_discrepancy(points: Floats) -> LocalDiscrepancy:
    """Return the star discrepancy of points in the unit square, and a box where it is attained.

    Row i and column j of the grid stand for the boxes with the points of ranks below i in x and
    below j in y: an open box that ends at the next coordinates, and a closed one that ends at the
    last. Equal coordinates need no care: a box of the wrong rank among them has a smaller value.

    The (n + 1)^2 boxes are cut into tiles of about sqrt(n) rows and columns. In row i of a tile that
    begins at row I and column J, an open box has the local discrepancy

        x_i y_j - C(i, j)/n  <=  max_j (x_i y_j - C(I, j)/n) - R_i/n,

    R_i the number of points of ranks I to i - 1 in x and below J in y. The maximum of lines is convex
    in x_i and so below the chord between the tile's first and last row. The same holds for closed
    boxes, with R_i up to the tile's last column. All tiles are bounded in O(n^1.5) steps and O(n)
    memory. Those with a bound above the largest value found are evaluated, and in them the rows with
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
    edges = side * np.arange(tiles + 1)

    floor = 0.0
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
        floor = max(floor, float(peaks[i, ::2].max()))
        entered = _below(y_rank[i, :, None], edges) / n
        ends = x_open[i, :, None], x_closed[i, :, None]
        bounds[i] = _row_bounds(peaks[i], *ends, entered[:, :-1], entered[:, 1:]).max(axis=0)

    # Only evaluated tiles know the box.
    best = LocalDiscrepancy(floor - _MARGIN, np.ones(2), True)
    order = np.flatnonzero(bounds + _MARGIN > best)
    order = order[np.argsort(-bounds.ravel()[order], kind="stable")]
    start, batch = 0, 1
    while start < len(order) and bounds.ravel()[order[start]] + _MARGIN > best:
        i, j = np.divmod(order[start : start + batch], tiles)
        start, batch = start + batch, min(2 * batch, _BATCH)
        before, after = (_below(y_rank[i].T, edge) for edge in (edges[j], edges[j + 1]))
        row_bounds = _row_bounds(peaks[i, :, j].T, x_open[i].T, x_closed[i].T, before / n, after / n)
        tile, row = np.nonzero(row_bounds.T + _MARGIN > best)
        # Points below the tile's first row, those that entered before its first column, and those inside.
        count = (counts[i, j] + _below(x_rank[j].T, side * i)).T[tile] + before[row, tile][:, None]
        count += _inside(y_rank[i] - edges[j][:, None], side * tile + row)
        if not len(row):
            continue
        share = count / n
        for x, y, sign in ((x_open, y_open, 1), (x_closed, y_closed, -1)):
            x, y = x[i[tile], row], y[j[tile]]
            values = sign * (x[:, None] * y - share)
            k, column = np.unravel_index(values.argmax(), values.shape)
            if values[k, column] > best:
                best = LocalDiscrepancy(values[k, column], np.array([x[k], y[k, column]]), sign > 0)
    return best


def _ends(coordinates: Floats, padding: int, shape: tuple[int, int]) -> tuple[Floats, Floats]:
    """Return the ends of open and closed boxes in sorted coordinates, tile by tile."""
    opened = np.append(coordinates, np.ones(padding))
    closed = np.concatenate([[0.0], coordinates, np.full(padding - 1, coordinates[-1])])
    return opened.reshape(shape), closed.reshape(shape)


def _below(ranks: NDArray[np.integer], limit: int | NDArray[np.integer]) -> NDArray[np.int64]:
    """Count along the first axis the ranks before each that are below a limit."""
    is_below = ranks < limit
    count = np.zeros(is_below.shape, np.int64)
    np.cumsum(is_below[:-1], axis=0, out=count[1:])
    return count


def _inside(columns: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count the points of tiles that are below certain rows and each column.

    ``columns``: int array, shape (tiles, side): of the points in the order of x; below 0 or at least ``side``
    if outside of the tile. ``rows``: int array, shape (m,), sorted: numbered through all tiles. Returns int
    array, shape (m, side).
    """
    side = columns.shape[1]
    tile, row = np.nonzero((columns >= 0) & (columns < side))
    column = columns[tile, row] + 1
    change = np.zeros((len(rows) + 1, side + 1), np.int64)
    np.add.at(change, (np.searchsorted(rows, side * tile + row, side="right"), column), 1)
    np.add.at(change, (np.searchsorted(rows, side * (tile + 1)), column), -1)
    return change.cumsum(axis=0).cumsum(axis=1)[:-1, :-1]


def _row_bounds(peaks: Floats, x_open: Floats, x_closed: Floats, before: Floats, after: Floats) -> Floats:
    """Bound the rows, along the first axis, of tiles: chords between the peaks, and the points that entered.

    For open boxes these are the points before a tile's first column, for closed ones those up to its last.
    """
    first_open, last_open, first_closed, last_closed = peaks
    opened = first_open + _along(x_open) * (last_open - first_open) - before
    closed = first_closed + _along(x_closed) * (last_closed - first_closed) + after
    return np.maximum(opened, closed)


def _along(x: Floats) -> Floats:
    """Return the positions of ascending numbers between the first, 0, and the last, 1."""
    return (x - x[0]) / np.maximum(x[-1] - x[0], np.finfo(np.float64).tiny)

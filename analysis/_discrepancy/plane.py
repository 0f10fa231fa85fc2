"""The star discrepancy in the plane by tiles of the critical grid, in NumPy and in compiled loops."""

import math

import numpy as np
from numpy.typing import NDArray

from analysis._discrepancy.critical_grid import LocalDiscrepancy
from analysis._host import compiled, threads

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


_STRIPE = 16
"""Tiles side by side that are bounded together."""

_TOGETHER = 64
"""Tiles that are evaluated before the largest value is compared with the bounds again."""

Ints = NDArray[np.int32]


def many_star_discrepancy(points: Floats) -> float:
    """Return the star discrepancy of very many points in the unit square, by loops that Numba compiles.

    Bounds and values are those of `plane_star_discrepancy`, where they are proved, and so is the result, to
    the last bit. Unlike there, only a bound and a count are stored per tile, and tiles are bounded in stripes
    of a few columns that fit the cache: from band to band of rows the counts change by the few points of a
    tile. Threads share the stripes. It takes three times the memory of float64 points.
    """
    n = len(points)
    side = max(8, math.isqrt(n) & ~1)
    tiles = -(-(n + 1) // side)
    ends = np.ones((2, tiles * side + 1))
    ends[:, 0] = 0.0
    by_x = _sort_ends(points[:, 0], ends[0])
    rank = np.empty(n, np.int32)
    rank[_sort_ends(points[:, 1], ends[1])] = np.arange(n, dtype=np.int32)
    y_rank, x_rank = rank[by_x], by_x  # in the same memory
    x_rank[y_rank] = np.arange(n, dtype=np.int32)
    del rank
    x, y = ends
    bounds, counts = np.empty((tiles, tiles)), np.empty((tiles, tiles), np.int32)

    with threads() as pool:

        def stripe(first: int) -> float:
            return _bound_stripe(x, y, y_rank, side, first, min(first + _STRIPE, tiles), bounds, counts)

        # Intermediate values are rounded differently: only those of evaluated tiles count.
        floor = max(pool.map(stripe, range(0, tiles, _STRIPE))) - _MARGIN
        chosen = np.flatnonzero(bounds > floor - _MARGIN).astype(np.int32)
        worst = bounds.ravel()[chosen]
        chosen = chosen[np.argsort(np.negative(worst, out=worst), kind="stable")]
        del worst

        def tile(number: int) -> float:
            i, j = divmod(int(number), tiles)
            return _evaluate(x, y, x_rank, y_rank, side, i, j, counts[i, j], max(best, floor))

        best = 0.0
        for start in range(0, len(chosen), _TOGETHER):
            if bounds.ravel()[chosen[start]] + _MARGIN <= max(best, floor):
                break
            best = max(best, *pool.map(tile, chosen[start : start + _TOGETHER]))
    return best


def _sort_ends(coordinates: Floats, ends: Floats) -> Ints:
    """Return the order of coordinates, and write them behind the first of the ends of boxes."""
    values = ends[1 : len(coordinates) + 1]
    values[:] = coordinates
    order = np.argsort(values)
    values[:] = values[order]
    return order.astype(np.int32)


@compiled
def _bound_stripe(
    x: Floats, y: Floats, y_rank: Ints, side: int, left: int, right: int, bounds: Floats, counts: Ints
) -> float:
    """Bound the tiles of a stripe, count the points below their first corners, and return the best corner.

    An open box of row i and column j ends at ``x[i + 1]`` and ``y[j + 1]``, a closed one at ``x[i]`` and
    ``y[j]``. Beyond the last row and column they end at 1, where no box is worse.
    """
    n = len(y_rank)
    share = 1.0 / n
    begin, end = left * side, right * side
    below = np.zeros(end - begin, np.int32)
    before, after, points = np.empty(side, np.int32), np.empty(side, np.int32), np.empty(side, np.int32)
    best = 0.0
    for i in range(len(bounds)):
        first = i * side
        count, inside = 0, 0
        for r in range(side):
            before[r] = after[r] = count
            rank = y_rank[first + r] if first + r < n else n + side * side
            if rank < begin:
                count += 1
            elif rank < end:
                points[inside] = r
                inside += 1
        xs = x[first : first + side + 1]
        open_scale = 1.0 / max(xs[side] - xs[1], 2.0**-1000)
        closed_scale = 1.0 / max(xs[side - 1] - xs[0], 2.0**-1000)
        added = count
        for j in range(left, right):
            start = (j - left) * side
            ys, under = y[j * side : (j + 1) * side + 1], below[start : start + side]
            counts[i, j] = under[0]
            # Each maximum depends on the previous one: eight of them are interleaved.
            a0, a1, b0, b1, c0, c1, d0, d1 = -2.0, -2.0, -2.0, -2.0, -2.0, -2.0, -2.0, -2.0
            for c in range(0, side, 2):
                part, next_part = under[c] * share, under[c + 1] * share
                a0 = max(a0, xs[1] * ys[c + 1] - part)
                a1 = max(a1, xs[1] * ys[c + 2] - next_part)
                b0 = max(b0, xs[side] * ys[c + 1] - part)
                b1 = max(b1, xs[side] * ys[c + 2] - next_part)
                c0 = max(c0, part - xs[0] * ys[c])
                c1 = max(c1, next_part - xs[0] * ys[c + 1])
                d0 = max(d0, part - xs[side - 1] * ys[c])
                d1 = max(d1, next_part - xs[side - 1] * ys[c + 1])
            first_open, last_open, first_closed, last_closed = (
                max(a0, a1),
                max(b0, b1),
                max(c0, c1),
                max(d0, d1),
            )
            best = max(best, first_open, first_closed)
            for c in range(side):
                under[c] += added
            for k in range(inside):
                r = points[k]
                rank = y_rank[first + r] - j * side
                if 0 <= rank < side:
                    for c in range(rank + 1, side):
                        under[c] += 1
                    for later in range(r + 1, side):
                        after[later] += 1
                    added += 1
            opened = (last_open - first_open) * open_scale
            closed = (last_closed - first_closed) * closed_scale
            a0, a1, b0, b1 = -2.0, -2.0, -2.0, -2.0
            for r in range(0, side, 2):
                a0 = max(a0, (xs[r + 1] - xs[1]) * opened - before[r] * share)
                a1 = max(a1, (xs[r + 2] - xs[1]) * opened - before[r + 1] * share)
                b0 = max(b0, (xs[r] - xs[0]) * closed + after[r] * share)
                b1 = max(b1, (xs[r + 1] - xs[0]) * closed + after[r + 1] * share)
            bounds[i, j] = max(first_open + max(a0, a1), first_closed + max(b0, b1))
            before[:] = after
    return best


@compiled
def _evaluate(
    x: Floats, y: Floats, x_rank: Ints, y_rank: Ints, side: int, i: int, j: int, count: int, best: float
) -> float:
    """Return the larger of the previous maximum and the largest value of a tile; lower rows are skipped."""
    n = len(x_rank)
    first, start = i * side, j * side
    xs, ys = x[first : first + side + 1], y[start : start + side + 1]
    below = np.empty(side, np.int32)
    first_open, last_open, first_closed, last_closed = -2.0, -2.0, -2.0, -2.0
    for c in range(side):
        below[c] = count
        part = count / n
        first_open = max(first_open, xs[1] * ys[c + 1] - part)
        last_open = max(last_open, xs[side] * ys[c + 1] - part)
        first_closed = max(first_closed, part - xs[0] * ys[c])
        last_closed = max(last_closed, part - xs[side - 1] * ys[c])
        if start + c < n and x_rank[start + c] < first:
            count += 1
    slope_open = (last_open - first_open) / max(xs[side] - xs[1], 2.0**-1000)
    slope_closed = (last_closed - first_closed) / max(xs[side - 1] - xs[0], 2.0**-1000)
    before, after = 0, 0
    for r in range(side):
        bound = first_open + (xs[r + 1] - xs[1]) * slope_open - before / n
        other = first_closed + (xs[r] - xs[0]) * slope_closed + after / n
        if max(bound, other) + _MARGIN > best:
            for c in range(side):
                part = below[c] / n
                best = max(best, xs[r + 1] * ys[c + 1] - part, part - xs[r] * ys[c])
        if first + r < n:
            rank = y_rank[first + r] - start
            for c in range(max(rank + 1, 0), side):
                below[c] += 1
            before += rank < 0
            after += rank < side
    return best

"""The star discrepancy of very many points in the plane: the tiles of `plane`, in compiled loops.

Bounds and values are those of `plane_star_discrepancy`, where they are proved, and so is the result, to the
last bit. Unlike there, only a bound and a count are stored per tile, and tiles are bounded in stripes
of a few columns that fit the cache: from band to band of rows the counts change by the few points of a tile.
Threads share the stripes.
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis._loops import compiled, threads

_MARGIN = 1e-14
"""More than the rounding errors of the bounds on tiles."""

_STRIPE = 16
"""Tiles side by side that are bounded together."""

_TOGETHER = 64
"""Tiles that are evaluated before the largest value is compared with the bounds again."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def many_star_discrepancy(points: Floats) -> float:
    """Return the star discrepancy of points in the unit square, by loops that Numba compiles.

    It takes three times the memory of float64 points.
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

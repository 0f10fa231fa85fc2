"""Branch and bound over regions of boxes: the star discrepancy between two bounds that close.

A region contains the boxes with corners q between two corners l <= h of the critical grid. Regions
that cover all corners are halved, those with the largest upper bounds first, until no bound exceeds
the largest local discrepancy found: that is the star discrepancy. If the search stops earlier, the largest
bound is still an upper one, as the regions are a bracketing cover, refined where it matters.

The bound adds one slab per dimension to the box l. Let V be the volume and N the number of points.
Raising the coordinates of l to those of q one after another, from the last to the first,

    V(q) - V(l) = sum_j  prod_(k<j) l_k  (q_j - l_j)  prod_(k>j) q_k.

Open boxes: q_k <= h_k bounds slab j from above by A_j (q_j - l_j), A_j = prod_(k<j) l_k prod_(k>j) h_k.
A point outside of l in dimension j alone is in the box q if it is below q_j; these points are
different for different j, so N(q) - N(l) >= sum_j c_j(q_j) and

    V(q) - N(q)/n  <=  V(l) - N(l)/n + sum_j max_(q_j) (A_j (q_j - l_j) - c_j(q_j)/n).

Closed boxes: q_k >= l_k bounds slab j from below by B_j (q_j - l_j), B_j = prod_(k!=j) l_k. Each
point of q outside of l is in the box h; let it count for one dimension j in which it is outside of
l, here the first. Then N(q) - N(l) <= sum_j e_j(q_j) and

    N(q)/n - V(q)  <=  N(l)/n - V(l) + sum_j max_(q_j) (e_j(q_j)/n - B_j (q_j - l_j)).

Each maximum is over one coordinate and exact. Only products of two or more slabs are lost:
the bound is off by a second-order term in the size of the region, where a bracket
V(h) - N(l)/n is off by a first-order one. It is exact if l and h differ in one dimension, and the
halves of a region have no larger ones. The coordinates that attain the maxima are a good guess at the
region's worst box.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._discrepancy.critical_grid import (
    CriticalGrid,
    LocalDiscrepancy,
    contains,
    local_discrepancy,
    of_corner,
)

_CELLS = 2**20
"""Regions times points in one batch: fits the cache."""

_BATCH = 4096
"""Maximum number of regions in one batch."""

Corners = NDArray[np.signedinteger]


def refine(grid: CriticalGrid, lower: float, regions: int) -> tuple[float, float]:
    """Return a lower and an upper bound of the star discrepancy, equal if ``regions`` suffice.

    ``lower``: a known lower bound: the better, the fewer regions. ``regions``: regions that may be examined,
    at least 1. The lower bound is a :class:`LocalDiscrepancy`, or ``lower``. Both to ``rounding(grid.dims)``.
    """
    low = np.zeros((1, grid.dims), grid.ranks.dtype)
    (low, high, upper), lower = _examine(grid, low, grid.sizes[None], lower)
    examined = 1
    while len(upper) and examined < regions:
        count = min((len(upper) + 1) // 2, (regions - examined + 1) // 2)
        order = np.argsort(-upper, kind="stable")
        rest = order[count:]
        parts = [(low[rest], high[rest], upper[rest])]
        batch = max(1, min(_BATCH, _CELLS // grid.n) // 2)
        for start in range(0, count, batch):
            chosen = order[start : min(start + batch, count)]
            halves = _halve(grid, low[chosen], high[chosen])
            part, lower = _examine(grid, *halves, lower)
            parts.append(part)
            examined += 2 * len(chosen)
        low, high, upper = (np.concatenate(p) for p in zip(*parts, strict=True))
        alive = upper > lower
        low, high, upper = low[alive], high[alive], upper[alive]
    return lower, max(lower, float(upper.max(initial=0.0)))


def climb(grid: CriticalGrid, corners: Corners) -> LocalDiscrepancy:
    """Return the largest local maximum reached from the corners: no change of one coordinate exceeds it."""
    values = local_discrepancy(grid, corners)
    best, corner = float(values.max()), corners[values.argmax()]
    while len(corners):
        low = np.repeat(corners, grid.dims, axis=0)
        high = low.copy()
        line, axis = np.arange(len(low)), np.tile(np.arange(grid.dims), len(corners))
        low[line, axis], high[line, axis] = 0, grid.sizes[axis]
        _, found = region_bounds(grid, low, high)
        reached = local_discrepancy(grid, found).reshape(-1, grid.dims)
        steepest = reached.argmax(axis=1) + np.arange(len(corners)) * grid.dims
        reached = reached.max(axis=1)
        better = reached > values
        corners, values = found[steepest][better], reached[better]
        if values.max(initial=0.0) > best:
            best, corner = float(values.max()), corners[values.argmax()]
    return of_corner(grid, corner, best)


def _examine(
    grid: CriticalGrid, low: Corners, high: Corners, lower: float
) -> tuple[tuple[Corners, Corners, NDArray[np.float64]], float]:
    """Return the regions that may exceed the lower bound, with their bounds, and the lower bound."""
    upper, corners = region_bounds(grid, low, high)
    values = local_discrepancy(grid, corners)
    best = int(values.argmax())
    if values[best] > lower:
        lower = climb(grid, corners[best : best + 1])
    # The bound of a line is attained, at the corner that was evaluated.
    alive = (upper > lower) & (np.count_nonzero(high > low, axis=1) > 1)
    return (low[alive], high[alive], upper[alive]), lower


def _halve(grid: CriticalGrid, low: Corners, high: Corners) -> tuple[Corners, Corners]:
    """Split regions in the dimension where the slab is largest, relative to the box h."""
    axis = np.arange(grid.dims)
    ratio = grid.opened[axis, low] / np.maximum(grid.opened[axis, high], np.finfo(np.float64).tiny)
    split = np.where(high > low, ratio, np.inf).argmin(axis=1)
    row = np.arange(len(low))
    middle = low[row, split] + (high[row, split] - low[row, split]) // 2
    below, above = high.copy(), low.copy()
    below[row, split], above[row, split] = middle, middle + 1
    return np.concatenate([low, above]), np.concatenate([below, high])


def region_bounds(grid: CriticalGrid, low: Corners, high: Corners) -> tuple[NDArray[np.float64], Corners]:
    """Bound the local discrepancies of regions from above, as the module's docstring proves.

    ``low``, ``high``: integer arrays, shape (m, d): the corners l <= h. Returns float64 array, shape (m,):
    the larger bound of open and closed boxes; integer array, shape (m, d): the corners that attain the maxima
    of the larger bound.
    """
    m, dims = low.shape
    n, axis = grid.n, np.arange(dims)
    opened, opened_high, closed = grid.opened[axis, low], grid.opened[axis, high], grid.closed[axis, low]
    below = contains(grid, low)
    share = np.count_nonzero(below, axis=1) / n
    between = contains(grid, high) ^ below

    # One entry per point inside of h and outside of l, sorted by region, slab and rank.
    counts = np.count_nonzero(between, axis=1)
    point = np.flatnonzero(between) - np.repeat(np.arange(m) * n, counts)
    first, outside = np.zeros(len(point), np.int64), np.zeros(len(point), np.int32)
    for j in reversed(range(dims)):
        beyond = grid.ranks[j].take(point) >= np.repeat(low[:, j], counts)
        np.copyto(first, j, where=beyond)
        outside += beyond
    rank = grid.ranks.ravel().take(first * n + point).astype(np.int64)
    entry = (np.repeat(np.arange(m) * dims, counts) + first) << 32 | rank << 1 | (outside == 1)
    entry.sort()
    slab, rank, alone = entry >> 32, entry >> 1 & 0x7FFFFFFF, entry & 1

    ones = np.ones((m, 1))
    before = np.hstack([ones, opened[:, :-1].cumprod(axis=1)])
    after = np.hstack([opened_high[:, :0:-1].cumprod(axis=1)[:, ::-1], ones])
    area_open = (before * after).ravel()
    before = np.hstack([ones, closed[:, :-1].cumprod(axis=1)])
    after = np.hstack([closed[:, :0:-1].cumprod(axis=1)[:, ::-1], ones])
    area_closed = (before * after).ravel()

    # The maxima over q_j are at h_j or where a point enters; those of closed boxes may be at l_j as well.
    gain_open = (opened_high - opened).ravel() * area_open
    gain_closed = np.zeros(m * dims)
    corner_open, corner_closed = high.ravel().copy(), low.ravel().copy()
    if len(entry):
        sizes = np.bincount(slab, minlength=m * dims)
        used = np.flatnonzero(sizes)
        sizes = sizes[used]
        start = sizes.cumsum() - sizes

        def spread(per_slab: NDArray) -> NDArray:
            return np.repeat(per_slab, sizes)

        passed = alone.cumsum() - alone
        passed -= spread(passed[start])
        entered = np.arange(1, len(entry) + 1) - spread(start)
        end = grid.opened.ravel().take(spread(used % dims * (n + 1)) + rank)
        open_here = (end - spread(opened.ravel()[used])) * spread(area_open[used]) - passed / n
        closed_here = entered / n - (end - spread(closed.ravel()[used])) * spread(area_closed[used])
        gain_open[used] -= np.add.reduceat(alone, start) / n
        gain_open[used] = np.maximum(gain_open[used], np.maximum.reduceat(open_here, start))
        gain_closed[used] = np.maximum(0, np.maximum.reduceat(closed_here, start))
        best = np.flatnonzero(open_here == spread(gain_open[used]))
        corner_open[slab[best]] = rank[best]
        best = np.flatnonzero(closed_here == spread(gain_closed[used]))
        corner_closed[slab[best]] = rank[best] + 1
    bound_open = opened.prod(axis=1) - share + gain_open.reshape(m, dims).sum(axis=1)
    bound_closed = share - closed.prod(axis=1) + gain_closed.reshape(m, dims).sum(axis=1)
    corners = np.where(
        (bound_open > bound_closed)[:, None], corner_open.reshape(m, dims), corner_closed.reshape(m, dims)
    )
    return np.maximum(bound_open, bound_closed), corners


_CHAINS = 64
_THRESHOLDS = 32
"""Each is used for as many moves as there are thresholds."""

_CLIMBERS = 16
"""Chains whose best boxes are improved in the end."""


def threshold_accepting(grid: CriticalGrid, generator: np.random.Generator) -> LocalDiscrepancy:
    """Return a large local discrepancy: a lower bound of the star discrepancy, to ``rounding(grid.dims)``.

    Chains move from box to box and accept a loss up to a threshold that decreases to zero [1]_. As there,
    the thresholds are differences between random neighbours, in descending order, the steps shrink from
    half of the grid to single coordinates, and large coordinates are preferred, since large local
    discrepancies are at large boxes. Unlike there, a step moves one coordinate, open and closed
    boxes share the chains, and the best boxes are improved in the end until no change of one coordinate
    helps, which includes the effect of snapping.

    References
    ----------
    .. [1] M. Gnewuch, M. Wahlstroem, C. Winzen, "A new randomized algorithm to approximate the star
       discrepancy based on threshold accepting", SIAM J. Numer. Anal. 50, 2012.
    """
    size = np.broadcast_to(grid.sizes, (_CHAINS, grid.dims))
    thresholds = np.empty((_THRESHOLDS, _CHAINS))
    for i in range(_THRESHOLDS):
        corners = _draw(grid, generator, np.zeros_like(size), size)
        moved = _neighbours(grid, generator, corners, i / _THRESHOLDS)
        thresholds[i] = np.abs(local_discrepancy(grid, moved) - local_discrepancy(grid, corners))
    thresholds = np.sort(thresholds, axis=0)[::-1]

    corners = _draw(grid, generator, np.zeros_like(size), size)
    values = local_discrepancy(grid, corners)
    best, best_values = corners.copy(), values.copy()
    for i in range(_THRESHOLDS**2):
        moved = _neighbours(grid, generator, corners, i / _THRESHOLDS**2)
        new = local_discrepancy(grid, moved)
        accepted = new >= values - thresholds[i // _THRESHOLDS]
        corners, values = np.where(accepted[:, None], moved, corners), np.where(accepted, new, values)
        better = values > best_values
        best[better], best_values[better] = corners[better], values[better]
    return climb(grid, best[np.argsort(-best_values, kind="stable")[:_CLIMBERS]])


def _neighbours(
    grid: CriticalGrid, generator: np.random.Generator, corners: NDArray[np.signedinteger], time: float
) -> NDArray[np.signedinteger]:
    """Move one coordinate of each corner, by less the closer ``time`` in [0, 1) is to 1."""
    reach = (1 + (grid.sizes // 2) * (1 - time)).astype(corners.dtype)
    low, high = np.maximum(corners, reach) - reach, np.minimum(corners, grid.sizes - reach) + reach
    moving = np.arange(grid.dims) == generator.integers(grid.dims, size=(len(corners), 1))
    return np.where(moving, _draw(grid, generator, low, high), corners)


def _draw(
    grid: CriticalGrid,
    generator: np.random.Generator,
    low: NDArray[np.signedinteger],
    high: NDArray[np.signedinteger],
) -> NDArray[np.signedinteger]:
    """Draw corners from l to h, with the density d y^(d-1) in each fraction y = t / size of the grid."""
    ratio = (low / np.maximum(high, 1)) ** grid.dims
    drawn = high * (ratio + (1 - ratio) * generator.random(low.shape)) ** (1 / grid.dims)
    return np.clip(np.ceil(drawn), low, high).astype(low.dtype)

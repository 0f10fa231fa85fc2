"""Trees by clustering: the quadratic split of R-trees, and 2-means clustering of each node."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees import _structure
from analysis.trees._structure import Tree, fit
from analysis.trees._sweep import grow
from qmcjax.core import checks
from qmcjax.core.parameters import numbers, require

_CHUNK = 2**19
"""Pairs of boxes that are examined at once."""


def quadratic_split_tree(low: ArrayLike, high: ArrayLike, *, fill: Any = 0.0) -> Tree:
    """Make a tree by the quadratic split of R-trees below each node [1]_, [2]_.

    The two boxes that would waste most area together start two groups. Then, one after another, the box with
    the largest difference joins the group whose area grows least; ties go to the smaller group, then to the
    one with fewer boxes. This examines all pairs of boxes below each node.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Corners of the boxes; see :func:`surface_area_tree`.
    fill : float, optional
        Smallest fraction of a node's boxes in a group, in [0, 0.5]: a group that needs all remaining boxes
        gets them.

    References
    ----------
    .. [1] A. Guttman, "R-trees: A Dynamic Index Structure for Spatial Searching", 1984.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.3.

    Examples
    --------
    >>> tree = quadratic_split_tree([[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[1, 1, 1], [10, 1, 1], [2, 1, 1]])
    >>> print(tree.children.tolist())
    [[0, 2], [3, 1]]
    """
    low, high = _structure.still_boxes(low, high)
    part = float(numbers("fill", fill))
    require("fill", part, lambda f: (f >= 0) & (f <= 0.5), "in [0, 0.5]")

    def split(rows: NDArray, start: NDArray, length: NDArray) -> tuple[NDArray, NDArray]:
        first, second = np.empty_like(start), np.zeros(len(low), bool)
        for node, (begin, count) in enumerate(zip(start, length, strict=True)):
            boxes = rows[0, begin : begin + count]
            side = _halves(low[boxes], high[boxes], max(1, int(part * count)))
            first[node] = count - side.sum()
            second[boxes] = side
        return first, second

    return fit(grow(np.arange(len(low))[None], split), low, high)


def _halves(low: NDArray, high: NDArray, least: int) -> NDArray[np.bool_]:
    """Return whether each box is in the second group."""
    count = len(low)
    seeds = _seeds(low, high)
    side, free = np.zeros(count, bool), np.ones(count, bool)
    side[seeds[1]], free[seeds] = True, False
    size = np.array([1, 1])
    group = [[low[seed], high[seed]] for seed in seeds]
    own = np.array([_structure.measure(*box) for box in group])
    more = np.stack([_growth(low, high, box) for box in group])
    for left in range(count - 2, 0, -1):
        short = np.flatnonzero(size + left <= least)
        if len(short):
            side[free] = short[0] == 1
            break
        apart = np.where(free, abs(more[0] - more[1]), -1)
        box = int(apart.argmax())
        to = min((0, 1), key=lambda k: (more[k, box], own[k], size[k]))
        side[box], free[box] = to == 1, False
        size[to] += 1
        group[to] = [np.minimum(group[to][0], low[box]), np.maximum(group[to][1], high[box])]
        own[to] = _structure.measure(*group[to])
        more[to] = _growth(low, high, group[to])
    return side


def _growth(low: NDArray, high: NDArray, box: list[NDArray]) -> NDArray[np.float64]:
    """Return the growth of a group's area with each of the given boxes."""
    return _structure.measure(np.minimum(low, box[0]), np.maximum(high, box[1])) - _structure.measure(*box)


def _seeds(low: NDArray, high: NDArray) -> list[int]:
    """Return the pair of boxes that wastes most area."""
    count, own = len(low), _structure.measure(low, high)
    best, seeds = -np.inf, [0, 1]
    step = max(1, _CHUNK // count)
    for begin in range(0, count - 1, step):
        rows = np.arange(begin, min(begin + step, count - 1))
        columns = np.arange(begin + 1, count)
        together = _structure.measure(
            np.minimum(low[rows, None], low[None, columns]), np.maximum(high[rows, None], high[None, columns])
        )
        waste = together - own[rows, None] - own[columns]
        waste[columns <= rows[:, None]] = -np.inf
        place = int(waste.argmax())
        if waste.flat[place] > best:
            best = waste.flat[place]
            seeds = [int(rows[place // len(columns)]), int(columns[place % len(columns)])]
    return seeds


_ROUNDS = 20
"""Maximum number of iterations of Lloyd's relaxation."""


def two_means_tree(
    low: ArrayLike,
    high: ArrayLike,
    *,
    tries: int = 4,
    norm: float = 2,
    key: int = 0,
    silhouette: bool = False,
) -> Tree:
    """Make a tree by splitting nodes into two clusters of boxes by Lloyd's relaxation [1]_, [2]_.

    A box joins the nearer mean; its distance is the length of the diagonal of their common bounding box.
    Means are centres of gravity, weighted by area. Several pairs of boxes are tried as initial means; the
    clusters that are best by Eq. 4.1 are used.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Corners of the boxes; see :func:`surface_area_tree`. Boxes without extent are clustered as points.
    tries : int, optional
        Number of pairs of random boxes as initial means, in [1, 64].
    norm : {2, inf}, optional
        Norm for the length of a diagonal.
    key : int, optional
        Key of random numbers, in [0, 2**32).
    silhouette : bool, optional
        Use the clusters with the largest average silhouette width instead. It examines all pairs of boxes.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.4.
    .. [2] S. Brakatsoulas, D. Pfoser, Y. Theodoridis, "Revisiting R-Tree Construction Principles", 2002.

    Examples
    --------
    >>> tree = two_means_tree([[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[1, 1, 1], [10, 1, 1], [2, 1, 1]])
    >>> print(tree.children.tolist())
    [[0, 2], [3, 1]]
    """
    low, high = _structure.still_boxes(low, high)
    tries = checks.integer("tries", tries, 1, 64)
    random = np.random.default_rng(checks.integer("key", key, 0, 2**32 - 1))
    if isinstance(norm, bool) or not isinstance(norm, int | float):
        raise TypeError(f"norm must be 2 or inf, got {checks.shown(norm)}")
    if norm not in (2, np.inf):
        raise ValueError(f"norm must be 2 or inf, got {norm}")
    checks.flag("silhouette", silhouette)
    quality = partial(_narrowness, norm=norm) if silhouette else _cost
    weight = _structure.measure(low, high)
    center = 0.5 * low + 0.5 * high

    def split(rows: NDArray, start: NDArray, length: NDArray) -> tuple[NDArray, NDArray]:
        boxes = rows[0]
        given = low[boxes], high[boxes], center[boxes], weight[boxes]
        least, best = np.full(len(start), np.inf), np.zeros(len(boxes), bool)
        for _ in range(tries):
            one = start + (random.uniform(size=len(start)) * length).astype(np.int64)
            more = 1 + (random.uniform(size=len(start)) * (length - 1)).astype(np.int64)
            other = start + (one - start + more) % length
            side = _relax(*given, start, length, (given[2][one], given[2][other]), norm)
            cost = quality(*given[:2], side, start, length)
            better = cost < least
            least[better] = cost[better]
            best = np.where(np.repeat(better, length), side, best)
        best ^= np.repeat(best[start], length)  # The first box is in the first cluster.
        count = np.add.reduceat(best, start, dtype=np.int64)
        # Boxes that means cannot separate are halved.
        same = (count == 0) | (count == length)
        half = np.arange(len(boxes)) - np.repeat(start, length) >= np.repeat(length - length // 2, length)
        best = np.where(np.repeat(same, length), half, best)
        second = np.zeros(len(low), bool)
        second[boxes] = best
        return length - np.where(same, length // 2, count), second

    return fit(grow(np.arange(len(low))[None], split), low, high)


def _relax(
    low: NDArray,
    high: NDArray,
    center: NDArray,
    weight: NDArray,
    start: NDArray,
    length: NDArray,
    means: Any,
    norm: float,
) -> NDArray[np.bool_]:
    """Return whether each box joins the second mean, for all nodes at once."""
    node = np.repeat(np.arange(len(start)), length)
    side = np.zeros(len(low), bool)
    for _ in range(_ROUNDS):
        one, other = (_diagonal(low, high, mean[node], norm) for mean in means)
        before, side = side, other < one
        if np.array_equal(before, side):
            break
        parts = zip((~side, side), means, strict=True)
        means = [_mean(center, weight, part, start, node, mean) for part, mean in parts]
    return side


def _diagonal(low: NDArray, high: NDArray, point: NDArray, norm: float) -> NDArray[np.float64]:
    """Return diagonals of the common bounding boxes of boxes and points; squared, if the norm is 2."""
    extent = np.maximum(high, point) - np.minimum(low, point)
    return np.square(extent).sum(axis=1) if norm == 2 else extent.max(axis=1)


def _mean(
    center: NDArray, weight: NDArray, part: NDArray, start: NDArray, node: NDArray, old: NDArray
) -> NDArray[np.float64]:
    """Return centres of gravity of clusters; unchanged for empty ones. Without any area all weights are 1."""
    weights = np.where(part, weight, 0)
    weights = np.where((np.add.reduceat(weights, start) == 0)[node], part, weights)
    total = np.add.reduceat(weights, start)[:, None]
    sums = np.add.reduceat(weights[:, None] * center, start, axis=0)
    return np.where(total > 0, sums / np.where(total > 0, total, 1), old)


def _cost(low: NDArray, high: NDArray, side: NDArray, start: NDArray, length: NDArray) -> NDArray[np.float64]:
    """Return Eq. 4.1 of clusters, infinite if one is empty."""
    cost = np.zeros(len(start))
    for part in (~side, side):
        count = np.add.reduceat(part, start, dtype=np.int64)
        lows = np.minimum.reduceat(np.where(part[:, None], low, np.inf), start, axis=0)
        highs = np.maximum.reduceat(np.where(part[:, None], high, -np.inf), start, axis=0)
        none = (count == 0)[:, None]
        area = _structure.measure(np.where(none, 0, lows), np.where(none, 0, highs))
        cost += np.where(count > 0, count * area, np.inf)
    return cost


def _narrowness(
    low: NDArray, high: NDArray, side: NDArray, start: NDArray, length: NDArray, norm: float
) -> NDArray[np.float64]:
    """Return average silhouette widths of clusters times -1, infinite if one is empty."""
    cost = np.full(len(start), np.inf)
    for node, run in enumerate(map(slice, start, start + length)):
        extent = np.maximum(high[run, None], high[run]) - np.minimum(low[run, None], low[run])
        distance = np.linalg.norm(extent, norm, axis=-1)
        np.fill_diagonal(distance, 0)
        member = np.stack([~side[run], side[run]], axis=1)
        size = member.sum(axis=0)
        if size.all():
            mean = distance @ member / np.maximum(size - member, 1)  # not counting the box itself
            own, other = mean[member], mean[~member]
            longer = np.maximum(own, other)
            alone = (longer == 0) | (member @ size == 1)
            cost[node] = -np.where(alone, 0, (other - own) / np.where(alone, 1, longer)).mean()
    return cost

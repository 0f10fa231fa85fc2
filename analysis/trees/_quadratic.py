"""Trees by the quadratic split of R-trees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees import _boxes
from analysis.trees._levels import grow
from analysis.trees._structure import Tree, fit
from qmcjax.core.parameters import numbers, require

_CHUNK = 2**19
"""Pairs of boxes that are examined at once."""


def quadratic_split_tree(low: ArrayLike, high: ArrayLike, *, fill: Any = 0.0) -> Tree:
    """Make a tree by the quadratic split of R-trees below each node [1]_, [2]_.

    The two boxes that would waste most area together begin two groups. Then, one after the other, the box
    with the largest difference goes to the group whose area grows least: of equal ones to the smaller, then
    to the one with fewer boxes. This examines all pairs of boxes below each node.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Corners of the boxes; see :func:`surface_area_tree`.
    fill : float, optional
        Smallest part of a node's boxes in a group, in [0, 0.5]: a group that needs all remaining boxes gets
        them.

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
    low, high = _boxes.still_boxes(low, high)
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
    """Return which boxes are in the second group."""
    count = len(low)
    seeds = _seeds(low, high)
    side, free = np.zeros(count, bool), np.ones(count, bool)
    side[seeds[1]], free[seeds] = True, False
    size = np.array([1, 1])
    group = [[low[seed], high[seed]] for seed in seeds]
    own = np.array([_boxes.measure(*box) for box in group])
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
        own[to] = _boxes.measure(*group[to])
        more[to] = _growth(low, high, group[to])
    return side


def _growth(low: NDArray, high: NDArray, box: list[NDArray]) -> NDArray[np.float64]:
    """Return the growth of a group's area with each of some boxes."""
    return _boxes.measure(np.minimum(low, box[0]), np.maximum(high, box[1])) - _boxes.measure(*box)


def _seeds(low: NDArray, high: NDArray) -> list[int]:
    """Return the pair of boxes that wastes most area."""
    count, own = len(low), _boxes.measure(low, high)
    best, seeds = -np.inf, [0, 1]
    step = max(1, _CHUNK // count)
    for begin in range(0, count - 1, step):
        rows = np.arange(begin, min(begin + step, count - 1))
        columns = np.arange(begin + 1, count)
        together = _boxes.measure(
            np.minimum(low[rows, None], low[None, columns]), np.maximum(high[rows, None], high[None, columns])
        )
        waste = together - own[rows, None] - own[columns]
        waste[columns <= rows[:, None]] = -np.inf
        place = int(waste.argmax())
        if waste.flat[place] > best:
            best = waste.flat[place]
            seeds = [int(rows[place // len(columns)]), int(columns[place % len(columns)])]
    return seeds

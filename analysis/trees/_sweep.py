"""Splits with the smallest surface area heuristic, in one or several orders of the boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees import _boxes
from analysis.trees._levels import grow
from analysis.trees._structure import Tree, fit

_TIE = 1e-12
"""Costs with a smaller relative difference are equal: then the more even split is taken."""

_CHUNK = 2**18
"""Number of boxes that are examined at once, or one node: fits the cache."""


def surface_area_tree(low: ArrayLike, high: ArrayLike) -> Tree:
    r"""Make a tree by the surface area heuristic, top-down, with one box in each leaf.

    A node is split along the axis and at the place that make

    .. math:: c(j) = N_{L,j} A_{L,j} + N_{R,j} A_{R,j}

    smallest (Eq. 4.1), of all places between boxes that are sorted by their centres: an exact sweep, no bins.
    Of equal costs the more even split is taken.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Finite corners of the boxes, ``low <= high``. A fourth coordinate is time: a box exists from ``low``
        to ``high``. It is sorted like the others, and areas count times the duration, for rays uniform in
        time.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.
    .. [2] I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007.

    Examples
    --------
    >>> tree = surface_area_tree([[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[1, 1, 1], [10, 1, 1], [2, 1, 1]])
    >>> print(tree.children.tolist())
    [[0, 2], [3, 1]]
    """
    low, high = _boxes.still_boxes(low, high)
    return sweep(low, high, np.argsort(low + high, axis=0, kind="stable").T)


def sweep(low: NDArray, high: NDArray, rows: NDArray) -> Tree:
    """Return the tree of boxes that are split along orders of them, (a, n)."""
    columns = np.ascontiguousarray(low.T), np.ascontiguousarray(high.T)

    def split(rows: NDArray, start: NDArray, length: NDArray) -> tuple[NDArray, NDArray]:
        first, second = np.empty_like(start), np.zeros(len(low), bool)
        # Nodes of similar size make a table with little padding.
        power = np.frexp(length - 1)[1]
        for size in np.unique(power):
            nodes = np.flatnonzero(power == size)
            step = max(1, _CHUNK >> int(size))
            for some in (nodes[k : k + step] for k in range(0, len(nodes), step)):
                place = np.arange(length[some].max())
                # Rows are padded with their last box, which changes neither minima nor maxima.
                at = start[some, None] + np.minimum(place, length[some, None] - 1)
                axis, first[some] = _best(*columns, rows[:, at], length[some])
                boxes, side = rows[axis[:, None], at], place >= first[some, None]
                second[boxes[side]] = True
        return first, second

    return fit(grow(rows, split), low, high)


def _best(low: NDArray, high: NDArray, boxes: NDArray, length: NDArray) -> tuple[NDArray, NDArray]:
    """Return the order, and how many boxes come before the split, for each node: ``boxes`` is (a, s, w)."""
    before = np.arange(1, boxes.shape[2])
    uneven = abs(2 * before - length[:, None])
    costs = np.empty((len(length), len(boxes), len(before)))
    for axis, row in enumerate(boxes):
        ahead = _areas(low, high, row)[:, :-1]
        behind = _areas(low, high, row[:, ::-1])[:, ::-1][:, 1:]
        costs[:, axis] = before * ahead + (length[:, None] - before) * behind
    costs[np.broadcast_to((before >= length[:, None])[:, None], costs.shape)] = np.inf
    least = costs.min(axis=(1, 2), keepdims=True)
    rank = np.where(costs <= least * (1 + _TIE), uneven[:, None], 2 * boxes.shape[2])
    best = rank.reshape(len(length), -1).argmin(axis=1)
    return best // len(before), before[best % len(before)]


def _areas(low: NDArray, high: NDArray, boxes: NDArray) -> NDArray:
    """Return the measures of the bounding boxes of all prefixes of a row, (s, w)."""
    lows = [np.minimum.accumulate(a[boxes], axis=1) for a in low]
    highs = [np.maximum.accumulate(b[boxes], axis=1) for b in high]
    return _boxes.measure(*(np.moveaxis(np.stack(side), 0, -1) for side in (lows, highs)))

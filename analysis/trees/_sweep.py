"""Trees by the surface area heuristic: in all axes, or along space-filling curves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees import _structure
from analysis.trees._structure import Tree, fit
from qmcjax.core import checks
from qmcjax.core.parameters import numbers

Split = Callable[[NDArray, NDArray, NDArray], tuple[NDArray, NDArray]]
"""From orders of boxes (a, m), and starts and lengths of the runs of nodes, (s,), to the number of boxes
of the first child, (s,), and which boxes, by their numbers, go to the second, bool (n,)."""


Cost = Callable[[NDArray, NDArray], Any]
"""From numbers of boxes and extents of their bounding boxes, (..., d), to costs."""


def grow(rows: NDArray, split: Split) -> NDArray[np.int64]:
    """Return the children of the inner nodes of a tree, the root's last.

    ``rows`` are orders of all boxes, (a, n): they are kept below every node.
    """
    count = rows.shape[1]
    children = np.empty((count - 1, 2), np.int64)
    node, length = np.array([2 * count - 2]), np.array([count])
    if count == 1:
        return children
    free = 2 * count - 3
    while len(node):
        start = np.cumsum(length) - length
        first, second = split(rows, start, length)
        rows = _partition(rows, second, start, length, first)
        size = np.stack([first, length - first], 1).reshape(-1)
        begin = np.cumsum(size) - size
        number = rows[0, begin]
        inner = size > 1
        here = int(inner.sum())
        number[inner] = free - np.arange(here)
        free -= here
        children[node - count] = number.reshape(-1, 2)
        rows = rows[:, np.repeat(inner, size)]
        node, length = number[inner], size[inner]
    return children


def _partition(rows: NDArray, second: NDArray, start: NDArray, length: NDArray, first: NDArray) -> NDArray:
    """Return orders in which each node has the boxes of its first child first."""
    parted = np.empty_like(rows)
    place = np.arange(rows.shape[1]) - np.repeat(start, length)
    base, later = np.repeat(start, length), np.repeat(start + first, length)
    for row, to in zip(rows, parted, strict=True):
        side = second[row]
        before = np.cumsum(side) - side
        before -= np.repeat(before[start], length)
        to[np.where(side, later + before, base + place - before)] = row
    return parted


_TIE = 1e-12
"""Costs with a smaller relative difference are considered equal: the more balanced split is taken."""

_CHUNK = 2**18
"""Number of boxes examined at once, or one node, to fit the cache."""


def surface_area_tree(low: ArrayLike, high: ArrayLike, *, cost: Cost | None = None) -> Tree:
    r"""Make a tree by the surface area heuristic, top-down, with one box in each leaf.

    A node is split along the axis and at the place with the smallest cost (Eq. 4.1)

    .. math:: c(j) = N_{L,j} A_{L,j} + N_{R,j} A_{R,j},

    among all places between boxes sorted by their centres: an exact sweep without bins. Among equal costs,
    the most balanced split is taken.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Finite corners of the boxes, ``low <= high``. A fourth coordinate is time: a box exists from ``low``
        to ``high``. It is sorted like the others, and areas are multiplied by the duration, for rays uniform
        in time.
    cost : callable, optional
        Another cost than N A of a child, from numbers of boxes (integers), and extents of the bounding box,
        (..., 3) or (..., 4): where its sum over both children is least, a node is split.

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
    low, high = _structure.still_boxes(low, high)
    if cost is not None:
        checks.function("cost", cost, "of numbers of boxes and of extents", 2)
        numbers("what cost returns", cost(np.ones(1, np.int64), (high - low)[:1]), (1,))
    return sweep(low, high, np.argsort(low + high, axis=0, kind="stable").T, cost or _heuristic)


def _heuristic(count: NDArray, extent: NDArray) -> NDArray:
    return count * _structure.still_measure(extent)


def sweep(low: NDArray, high: NDArray, rows: NDArray, cost: Cost = _heuristic) -> Tree:
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
                axis, first[some] = _best(*columns, rows[:, at], length[some], cost)
                boxes, side = rows[axis[:, None], at], place >= first[some, None]
                second[boxes[side]] = True
        return first, second

    return fit(grow(rows, split), low, high)


def _best(
    low: NDArray, high: NDArray, boxes: NDArray, length: NDArray, cost: Cost
) -> tuple[NDArray, NDArray]:
    """Return the order, and how many boxes come before the split, for each node: ``boxes`` is (a, s, w)."""
    before = np.arange(1, boxes.shape[2])
    uneven = abs(2 * before - length[:, None])
    costs = np.empty((len(length), len(boxes), len(before)))
    for axis, row in enumerate(boxes):
        ahead = _extents(low, high, row)[:, :-1]
        behind = _extents(low, high, row[:, ::-1])[:, ::-1][:, 1:]
        costs[:, axis] = cost(before, ahead) + cost(length[:, None] - before, behind)
    costs[np.broadcast_to((before >= length[:, None])[:, None], costs.shape)] = np.inf
    least = costs.min(axis=(1, 2), keepdims=True)
    rank = np.where(costs <= least * (1 + _TIE), uneven[:, None], 2 * boxes.shape[2])
    best = rank.reshape(len(length), -1).argmin(axis=1)
    return best // len(before), before[best % len(before)]


def _extents(low: NDArray, high: NDArray, boxes: NDArray) -> NDArray:
    """Return the extents of the bounding boxes of all prefixes of a row, (s, w, d)."""
    lows = [np.minimum.accumulate(a[boxes], axis=1) for a in low]
    highs = [np.maximum.accumulate(b[boxes], axis=1) for b in high]
    return np.moveaxis(np.stack(highs) - np.stack(lows), 0, -1)


def hilbert_tree(low: ArrayLike, high: ArrayLike) -> Tree:
    """Make a tree by the surface area heuristic along the Hilbert curve through the centres of boxes.

    The boxes are sorted once, and each node is split where Eq. 4.1 is smallest along that order.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Corners of the boxes; see :func:`surface_area_tree`.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.3.
    .. [2] J. Skilling, "Programming the Hilbert curve", 2004.

    Examples
    --------
    >>> tree = hilbert_tree([[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[1, 1, 1], [10, 1, 1], [2, 1, 1]])
    >>> print(tree.children.tolist())
    [[0, 2], [3, 1]]
    """
    return _along(low, high, hilbert_digits)


def morton_tree(low: ArrayLike, high: ArrayLike) -> Tree:
    """Make a tree by the surface area heuristic along the Morton order of the centres of boxes.

    Like :func:`hilbert_tree`, but the curve has jumps.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Corners of the boxes; see :func:`surface_area_tree`.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.3.

    Examples
    --------
    >>> tree = morton_tree([[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[1, 1, 1], [10, 1, 1], [2, 1, 1]])
    >>> print(tree.children.tolist())
    [[0, 2], [3, 1]]
    """
    return _along(low, high, lambda cells, bits: cells)


def _along(low: ArrayLike, high: ArrayLike, digits: Any) -> Tree:
    low, high = _structure.still_boxes(low, high)
    cells, bits = _cells(low, high)
    return sweep(low, high, np.argsort(_interleave(digits(cells, bits), bits), kind="stable")[None])


def _cells(low: NDArray, high: NDArray) -> tuple[NDArray[np.int64], int]:
    """Return the grid cells of centres, (d, n), and the number of bits per coordinate.

    Cells are cubes in space; time has a separate scale.
    """
    bits = 63 // low.shape[1]
    center = 0.5 * low + 0.5 * high
    least = center.min(axis=0)
    extent = center.max(axis=0) - least
    extent[:3] = extent[:3].max()
    scale = (2**bits * (1 - 1e-12)) / np.where(extent > 0, extent, 1)
    return ((center - least) * scale).astype(np.int64).T, bits


def hilbert_digits(cells: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    """Return the digits of the positions of cells (d, n) on the Hilbert curve, to be interleaved."""
    x = cells.copy()
    for bit in (1 << k for k in range(bits - 1, 0, -1)):
        for axis in range(len(x)):
            # Where the bit is set the lower bits of the first axis are inverted, else swapped with its own.
            is_set = (x[axis] & bit) != 0
            swapped = np.where(is_set, 0, (x[0] ^ x[axis]) & (bit - 1))
            x[axis] ^= swapped
            x[0] ^= np.where(is_set, bit - 1, swapped)
    for axis in range(1, len(x)):
        x[axis] ^= x[axis - 1]
    turned = np.zeros_like(x[0])
    for bit in (1 << k for k in range(bits - 1, 0, -1)):
        turned ^= np.where((x[-1] & bit) != 0, bit - 1, 0)
    return x ^ turned


def _interleave(numbers: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    """Interleave the bits of d numbers, those of the first in front."""
    key = np.zeros_like(numbers[0])
    for k in range(bits - 1, -1, -1):
        for number in numbers:
            key = (key << 1) | ((number >> k) & 1)
    return key

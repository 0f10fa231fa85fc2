"""Trees built from the root, all nodes of a level at once."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Split = Callable[[NDArray, NDArray, NDArray], tuple[NDArray, NDArray]]
"""From orders of boxes (a, m), and starts and lengths of the runs of nodes, (s,), to the number of boxes
of the first child, (s,), and which boxes, by their numbers, go to the second, bool (n,)."""


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

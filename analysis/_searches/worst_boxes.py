"""The boxes of largest local discrepancy, in any dimension: all of them, by one pass over nested boxes.

A box is fixed one dimension after another. Once it is fixed in the first k, only the points inside so far
matter: an open box of largest local discrepancy ends, in each dimension, at one of them or at 1, a closed one
at one of them. That leaves about n^d / d! of the (n + 1)^d boxes of the critical grid. Where the box moves on
by one point in dimension k, the local discrepancy of an open box grows at most as the volume does, and that
of a closed one by 1/n: prefixes that cannot reach the level after that are skipped.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._host import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Boxes = tuple[Ints, Floats, Floats]
"""Ends, shape (m, d): the point where a box ends; n: it ends at 1; -1: the closed box is empty. Signs, 1 for
open boxes, -1 for closed ones. And local discrepancies."""


class WorstBoxes:
    """Boxes with local discrepancies of more than a part of the largest, the star discrepancy."""

    def __init__(self, points: Floats, part: float, most: int) -> None:
        n, dims = points.shape
        order = np.argsort(points, axis=0, kind="stable").T
        lists = np.zeros((dims, n + 1), np.int64)
        lists[0, :n] = order[0]
        levels = np.array([0.0, 0.0, part])
        room = np.zeros((most, dims), np.int64), np.zeros(most), np.zeros(most)
        ranks = np.argsort(order, axis=1)
        count = _enumerate(np.ascontiguousarray(points), ranks, lists, levels, room)
        chosen = np.flatnonzero(room[2][:count] > levels[0])
        self.boxes: Boxes = room[0][chosen], room[1][chosen], room[2][chosen]
        self.level = float(levels[0])
        """All boxes above this are included: ``part`` of the largest, or more if they are too many."""
        self.largest = float(levels[1])


@compiled
def _enumerate(points: Floats, ranks: Ints, lists: Ints, levels: Floats, boxes: Boxes) -> int:
    """Go through all prefixes, and return the number of boxes that are kept.

    ``lists[k]``: the points inside in dimensions below k, in the order of k. ``levels``: the level, the
    largest local discrepancy so far, and the part of it that counts.
    """
    n, dims = points.shape
    step, counts = np.zeros(dims, np.int64), np.zeros(dims, np.int64)
    opened, closed, last = np.ones(dims), np.ones(dims), np.zeros(dims)
    # Upper bounds: of the boxes with the prefix of this step, and the largest of a dimension so far.
    open_bound, closed_bound = np.full(dims, 2.0), np.full(dims, 2.0)
    open_most, closed_most = np.zeros(dims), np.zeros(dims)
    prefix = np.zeros((2, dims), np.int64)
    counts[0] = n
    k = count = 0
    while True:
        if k == dims - 1 or step[k] > counts[k]:
            if k == dims - 1:
                count, open_most[k], closed_most[k] = _last(
                    points, opened[k], closed[k], lists[k, : counts[k]], prefix, levels, boxes, count
                )
            k -= 1
            if k < 0:
                return count
            open_bound[k], closed_bound[k] = open_most[k + 1], closed_most[k + 1]
        else:
            t = step[k]
            if t > 0:
                p = lists[k, t - 1]
                place = t - 1
                while place > 0 and ranks[k + 1, lists[k + 1, place - 1]] > ranks[k + 1, p]:
                    lists[k + 1, place] = lists[k + 1, place - 1]
                    place -= 1
                lists[k + 1, place] = p
            volume = opened[k] * (points[lists[k, t], k] if t < counts[k] else 1.0)
            open_bound[k] += volume - last[k]
            closed_bound[k] += 1.0 / n
            last[k] = volume
            if min(open_bound[k], volume) > levels[0] or min(closed_bound[k], t / n) > levels[0]:
                prefix[0, k] = lists[k, t] if t < counts[k] else n
                prefix[1, k] = lists[k, t - 1] if t > 0 else -1
                opened[k + 1] = volume
                closed[k + 1] = closed[k] * points[lists[k, t - 1], k] if t > 0 else 0.0
                counts[k + 1] = t
                k += 1
                step[k] = 0
                open_bound[k] = closed_bound[k] = 2.0
                last[k] = open_most[k] = closed_most[k] = 0.0
                continue
        open_most[k] = max(open_most[k], min(open_bound[k], last[k]))
        closed_most[k] = max(closed_most[k], min(closed_bound[k], step[k] / n))
        step[k] += 1


@compiled
def _last(
    points: Floats,
    opened: float,
    closed: float,
    order: Ints,
    prefix: Ints,
    levels: Floats,
    boxes: Boxes,
    found: int,
) -> tuple[int, float, float]:
    """Go through the last dimension; return how many are kept, and the largest values, open and closed."""
    ends, signs, values = boxes
    count = len(order)
    n, dims = points.shape
    k = dims - 1
    highest_open = highest_closed = 0.0
    for t in range(count + 1):
        above = opened * (points[order[t], k] if t < count else 1.0) - t / n
        below = t / n - (closed * points[order[t - 1], k] if t > 0 else 0.0)
        highest_open, highest_closed = max(highest_open, above), max(highest_closed, below)
        for side in range(2):
            value = above if side == 0 else below
            if value <= levels[0]:
                continue
            levels[1] = max(levels[1], value)
            levels[0] = max(levels[0], levels[1] * levels[2])
            if found == len(values):
                found = _forget(levels, boxes)
                if value <= levels[0]:
                    continue
            values[found], signs[found] = value, 1.0 - 2.0 * side
            ends[found, :k] = prefix[side, :k]
            if side == 0:
                ends[found, k] = order[t] if t < count else n
            else:
                ends[found, k] = order[t - 1] if t > 0 else -1
            found += 1
    return found, highest_open, highest_closed


@compiled
def _forget(levels: Floats, boxes: Boxes) -> int:
    """Keep the boxes above the level, or, if these are most of them, raise it to their median; count them."""
    ends, signs, values = boxes
    if np.sum(values > levels[0]) > 3 * len(values) // 4:
        levels[0] = max(levels[0], np.median(values))
    kept = 0
    for row in range(len(values)):
        if values[row] > levels[0]:
            values[kept], signs[kept] = values[row], signs[row]
            ends[kept] = ends[row]
            kept += 1
    return kept

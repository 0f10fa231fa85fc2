"""The sum of a product kernel over pairs of points in space, by nested merging.

As in `merges_plane`, points that are sorted by x are merged by y. Those of one merge are then sorted by
z, by merging again: now a pair counts if its points come from different halves of both merges, which
determine the lower one in x and in y. Points merged before are below in z.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._l2.scalars import Scalars, add, factor, multiply
from analysis._loops import compiled

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Room = tuple[Floats, Flags, Floats, Flags]
"""For points in the order of y or z, whether they are the upper ones in x; and for copies of half of both."""


def room_in_space(n: int) -> Room:
    """Return the work space to merge n points: half of them, rounded down, are copied for any part."""
    return np.empty((3, n)), np.empty(n, np.bool_), np.empty((3, n // 2)), np.empty(n // 2, np.bool_)


@compiled
def _merge_inside(
    points: Floats,
    right: Flags,
    lower: Floats,
    lower_right: Flags,
    start: int,
    middle: int,
    stop: int,
    numbers: Floats,
    sums: tuple[Floats, Floats, Floats],
) -> Scalars:
    """Merge two parts by z, the first one below in y, and return the sum over pairs of both, and both sides.

    ``right`` marks the upper points in x. The first part is copied to ``lower``, so that merged points do not
    overwrite the second one.
    """
    rank = int(numbers[5])
    for k in range(start, middle):
        for axis in range(3):
            lower[axis, k - start] = points[axis, k]
        lower_right[k - start] = right[k]
    # Sums by half and side, factor in z, and those in x and y; the latter of the point, and what they meet.
    high, low, factors = sums
    for part in range(4):
        for t in range(rank):
            for q in range(rank * rank):
                high[part, t, q] = low[part, t, q] = 0.0
    found, rest = 0.0, 0.0
    i, j = 0, middle
    for k in range(start, stop):
        first = j == stop or (i < middle - start and lower[2, i] <= points[2, j])
        if first:
            half, side = 0, 1 if lower_right[i] else 0
            x, y, z = lower[0, i], lower[1, i], lower[2, i]
            i += 1
        else:
            half, side = 1, 1 if right[j] else 0
            x, y, z = points[0, j], points[1, j], points[2, j]
            j += 1
        points[0, k], points[1, k], points[2, k] = x, y, z
        right[k] = side == 1
        own = 2 * half + side
        other = 3 - own
        for r in range(rank):
            of_x, x_rest = factor(x, numbers, side == 1, r)
            for s in range(rank):
                a, b = factor(y, numbers, half == 1, s)
                factors[0, r * rank + s], factors[1, r * rank + s] = multiply(a, b, of_x, x_rest)
                factors[2, r * rank + s] = factors[3, r * rank + s] = 0.0
        for t in range(rank):
            a, b = factor(z, numbers, True, t)
            for q in range(rank * rank):
                c, d = multiply(a, b, high[other, t, q], low[other, t, q])
                factors[2, q], factors[3, q] = add(factors[2, q], factors[3, q], c, d)
            a, b = factor(z, numbers, False, t)
            for q in range(rank * rank):
                c, d = multiply(a, b, factors[0, q], factors[1, q])
                high[own, t, q], low[own, t, q] = add(high[own, t, q], low[own, t, q], c, d)
        for q in range(rank * rank):
            a, b = multiply(factors[0, q], factors[1, q], factors[2, q], factors[3, q])
            found, rest = add(found, rest, a, b)
    return found, rest


@compiled
def merge_space(columns: Floats, room: Room, start: int, middle: int, stop: int, numbers: Floats) -> Scalars:
    """Merge two parts that are sorted by y, and return the sum of the kernel over pairs of both."""
    points, right = room[0][:, start:stop], room[1][start:stop]
    i, j = start, middle
    size = stop - start
    for k in range(size):
        left = j == stop or (i < middle and columns[1, i] <= columns[1, j])
        here = i if left else j
        for axis in range(3):
            points[axis, k] = columns[axis, here]
        right[k] = not left
        if left:
            i += 1
        else:
            j += 1
    for k in range(size):
        for axis in range(3):
            columns[axis, start + k] = points[axis, k]
    lower, lower_right = room[2][:, start // 2 :], room[3][start // 2 :]
    sums = np.empty((4, 3, 9)), np.empty((4, 3, 9)), np.empty((4, 9))
    levels = 0
    while 1 << levels < size:
        levels += 1
    found, rest = 0.0, 0.0
    for level in range(levels - 1, -1, -1):
        # Halves of equal sizes, so that half of the points suffices for the lower ones.
        for k in range(1 << level):
            first, end = size * k >> level, size * (k + 1) >> level
            between = size * (2 * k + 1) >> level + 1
            a, b = _merge_inside(points, right, lower, lower_right, first, between, end, numbers, sums)
            found, rest = add(found, rest, a, b)
    return found, rest


@compiled
def sort_space(columns: Floats, room: Room, start: int, stop: int, numbers: Floats) -> Scalars:
    """Sort a part by y, and return the sum of the kernel over its pairs."""
    found, rest = 0.0, 0.0
    width = 1
    while width < stop - start:
        for first in range(start, stop - width, 2 * width):
            a, b = merge_space(columns, room, first, first + width, min(first + 2 * width, stop), numbers)
            found, rest = add(found, rest, a, b)
        width *= 2
    return found, rest

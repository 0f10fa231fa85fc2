"""The sum of a product kernel over pairs of points in space, by merging inside of merging.

As in `_l2_merges_plane`, points that are sorted by x are merged by y. Those of one merge are then sorted by
z, by merging again: now a pair counts if its points come from different halves of both merges, which say
which one is below in x and in y. What was merged before is below in z.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._l2_scalars import Scalars, add, factor, multiply
from analysis._loops import compiled

__all__ = ["merge_space", "sort_space"]

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@compiled
def _merge_inside(
    points: Floats,
    right: Flags,
    lower: Floats,
    lower_right: Flags,
    start: int,
    middle: int,
    stop: int,
    offset: int,
    numbers: Floats,
) -> Scalars:
    """Merge two parts by z, the first one below in y, and return the sum over pairs of both, and both sides.

    ``right`` tells which points are the upper ones in x, for those from ``offset`` on. The first part is
    copied to ``lower``, and what is merged does not catch up with the second one.
    """
    rank = int(numbers[5])
    for k in range(start, middle):
        for axis in range(3):
            lower[axis, k - start] = points[axis, k]
        lower_right[k - start] = right[k - offset]
    merged = np.zeros((2, 2, 2, 3, 3, 3))  # by half, side, and number or rest
    found, rest = 0.0, 0.0
    i, j = 0, middle
    for k in range(start, stop):
        first = j == stop or (i < middle - start and lower[2, i] <= points[2, j])
        if first:
            half, side = 0, 1 if lower_right[i] else 0
            x, y, z = lower[0, i], lower[1, i], lower[2, i]
            i += 1
        else:
            half, side = 1, 1 if right[j - offset] else 0
            x, y, z = points[0, j], points[1, j], points[2, j]
            j += 1
        own, other = merged[half, side], merged[1 - half, 1 - side]
        for r in range(rank):
            of_x, x_rest = factor(x, numbers, side == 1, r)
            for s in range(rank):
                a, b = factor(y, numbers, half == 1, s)
                a, b = multiply(a, b, of_x, x_rest)
                inner, inner_rest = 0.0, 0.0
                for t in range(rank):
                    c, d = factor(z, numbers, True, t)
                    c, d = multiply(c, d, other[0, r, s, t], other[1, r, s, t])
                    inner, inner_rest = add(inner, inner_rest, c, d)
                    c, d = factor(z, numbers, False, t)
                    c, d = multiply(a, b, c, d)
                    own[0, r, s, t], own[1, r, s, t] = add(own[0, r, s, t], own[1, r, s, t], c, d)
                a, b = multiply(a, b, inner, inner_rest)
                found, rest = add(found, rest, a, b)
        points[0, k], points[1, k], points[2, k] = x, y, z
        right[k - offset] = side == 1
    return found, rest


@compiled
def _merge_sides(
    columns: Floats,
    spare: Floats,
    right: Flags,
    lower: Floats,
    lower_right: Flags,
    start: int,
    middle: int,
    stop: int,
    numbers: Floats,
) -> Scalars:
    """Merge two parts that are sorted by y, and return the sum of the kernel over pairs of both."""
    size = stop - start
    i, j = start, middle
    for k in range(start, stop):
        left = j == stop or (i < middle and columns[1, i] <= columns[1, j])
        here = i if left else j
        for axis in range(3):
            spare[axis, k] = columns[axis, here]
        right[k - start] = not left
        if left:
            i += 1
        else:
            j += 1
    for k in range(start, stop):
        for axis in range(3):
            columns[axis, k] = spare[axis, k]
    levels = 0
    while 1 << levels < size:
        levels += 1
    found, rest = 0.0, 0.0
    for level in range(levels - 1, -1, -1):
        # Halves of equal sizes, that half of the points is room enough for the lower ones.
        for k in range(1 << level):
            first, end = start + (size * k >> level), start + (size * (k + 1) >> level)
            between = start + (size * (2 * k + 1) >> level + 1)
            a, b = _merge_inside(spare, right, lower, lower_right, first, between, end, start, numbers)
            found, rest = add(found, rest, a, b)
    return found, rest


@compiled
def merge_space(
    columns: Floats, spare: Floats, start: int, middle: int, stop: int, numbers: Floats
) -> Scalars:
    """Merge two parts that are sorted by y, and return the sum of the kernel over pairs of both."""
    half = (stop - start + 1) // 2
    right, lower, lower_right = (
        np.empty(stop - start, np.bool_),
        np.empty((3, half)),
        np.empty(half, np.bool_),
    )
    return _merge_sides(columns, spare, right, lower, lower_right, start, middle, stop, numbers)


@compiled
def sort_space(columns: Floats, spare: Floats, start: int, stop: int, numbers: Floats) -> Scalars:
    """Sort a part by y, and return the sum of the kernel over its pairs."""
    half = (stop - start + 1) // 2
    right, lower, lower_right = (
        np.empty(stop - start, np.bool_),
        np.empty((3, half)),
        np.empty(half, np.bool_),
    )
    found, rest = 0.0, 0.0
    width = 1
    while width < stop - start:
        for first in range(start, stop - width, 2 * width):
            end = min(first + 2 * width, stop)
            a, b = _merge_sides(columns, spare, right, lower, lower_right, first, first + width, end, numbers)
            found, rest = add(found, rest, a, b)
        width *= 2
    return found, rest

"""The sum of a product kernel over pairs of points in the plane, by merging.

Sorted by x, the points are merged by y, as in merge sort. Let i be in the left half of a merge and j in the
right one, so x_i <= x_j. The kernel of a pair is a product of K(a, b) = sum_r L_r(a) U_r(b) for a <= b
(`Kernel.factors`). If y_i <= y_j, it is the sum of L_r(x_i) L_s(y_i) times U_r(x_j) U_s(y_j), and otherwise
of L_r(x_i) U_s(y_i) times U_r(x_j) L_s(y_j). So sums over what was merged suffice, one for each half: each
pair is in different halves of one merge only. This is the divide and conquer of S. Heinrich, "Efficient
algorithms for computing the L2-discrepancy", Math. Comp. 65, 1996.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._l2.scalars import Scalars, add, factor, multiply
from analysis._loops import compiled

Floats = NDArray[np.float64]


def room_in_plane(n: int) -> Floats:
    """Return the work space to merge n points."""
    return np.empty((2, n))


@compiled
def merge_plane(
    columns: Floats, room: Floats, start: int, middle: int, stop: int, numbers: Floats
) -> Scalars:
    """Merge two parts that are sorted by y, and return the sum of the kernel over pairs of both."""
    x, y = columns[0], columns[1]
    rank = int(numbers[5])
    merged = np.zeros((2, 2, 3, 3))  # of the left and the right part; the second number is the rest
    found, rest = 0.0, 0.0
    i, j = start, middle
    for k in range(start, stop):
        left = j == stop or (i < middle and y[i] <= y[j])
        here = i if left else j
        own, other = (0, 1) if left else (1, 0)
        for r in range(rank):
            a, b = factor(x[here], numbers, not left, r)
            inner, inner_rest = 0.0, 0.0
            for s in range(rank):
                # Points merged before are below in y.
                c, d = factor(y[here], numbers, True, s)
                c, d = multiply(c, d, merged[other, 0, r, s], merged[other, 1, r, s])
                inner, inner_rest = add(inner, inner_rest, c, d)
                c, d = factor(y[here], numbers, False, s)
                c, d = multiply(a, b, c, d)
                merged[own, 0, r, s], merged[own, 1, r, s] = add(
                    merged[own, 0, r, s], merged[own, 1, r, s], c, d
                )
            a, b = multiply(a, b, inner, inner_rest)
            found, rest = add(found, rest, a, b)
        room[0, k], room[1, k] = x[here], y[here]
        if left:
            i += 1
        else:
            j += 1
    for k in range(start, stop):
        x[k], y[k] = room[0, k], room[1, k]
    return found, rest


@compiled
def sort_plane(columns: Floats, room: Floats, start: int, stop: int, numbers: Floats) -> Scalars:
    """Sort a part by y, and return the sum of the kernel over its pairs."""
    found, rest = 0.0, 0.0
    width = 1
    while width < stop - start:
        for first in range(start, stop - width, 2 * width):
            end = min(first + 2 * width, stop)
            a, b = merge_plane(columns, room, first, first + width, end, numbers)
            found, rest = add(found, rest, a, b)
        width *= 2
    return found, rest

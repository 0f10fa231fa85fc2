"""The L2 discrepancies of very many points in two and three dimensions, by merging in compiled loops.

Sorted by x, the points are merged by y, as in merge sort. Let i be in the left half of a merge and j in the
right one, so x_i <= x_j. The kernel of a pair is a product of K(a, b) = sum_r L_r(a) U_r(b) for a <= b
(`Kernel.factors`). If y_i <= y_j, it is the sum of L_r(x_i) L_s(y_i) times U_r(x_j) U_s(y_j), and otherwise
of L_r(x_i) U_s(y_i) times U_r(x_j) L_s(y_j). So sums over what was merged suffice, one for each half: each
pair is in different halves of one merge only. This is the divide and conquer of S. Heinrich, "Efficient
algorithms for computing the L2-discrepancy", Math. Comp. 65, 1996.

In space, the points of one merge are then sorted by z, by merging again: now a pair counts if its points come
from different halves of both merges, which determine the lower one in x and in y. Points merged before are
below in z.

That is O(n log n) steps in two dimensions and O(n log^2 n) in three, where `pair_sum` takes n^1.5 and
n^(5/3). Numbers are sums of two float64, as in `kernels`: the result has a relative error of about n^2
2^-100. Unlike there, the second number of a product may be a few times as large as the rounding errors of the
first: sums reduce it again.
"""

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from analysis._host import compiled, multiply_add, threads
from analysis._l2.kernels import Kernel

Floats = NDArray[np.float64]

Scalars = tuple[float, float]
"""A number and its rounding error."""


@compiled
def two_sum(a: float, b: float) -> Scalars:
    high = a + b
    part = high - a
    return high, (a - (high - part)) + (b - part)


@compiled
def two_product(a: float, b: float) -> Scalars:
    high = a * b
    return high, multiply_add(a, b, -high)


@compiled
def add(a: float, b: float, c: float, d: float) -> Scalars:
    high, low = two_sum(a, c)
    low += b + d
    total = high + low
    return total, low - (total - high)


@compiled
def multiply(a: float, b: float, c: float, d: float) -> Scalars:
    high, low = two_product(a, c)
    return high, low + (a * d + b * c)


@compiled
def quadratic(x: float, offset: float, first: float, bend: float, second: float) -> Scalars:
    """Return offset + first x + bend |x - 1/2| + second x^2."""
    high, low = two_product(first, x)
    high, low = add(high, low, offset, 0.0)
    if bend != 0:
        a, b = two_product(bend, abs(x - 0.5))
        high, low = add(high, low, a, b)
    if second != 0:
        a, b = two_product(x, x)
        a, b = multiply(a, b, second, 0.0)
        high, low = add(high, low, a, b)
    return high, low


@compiled
def factor(x: float, numbers: Floats, upper: bool, r: int) -> Scalars:
    """Return L_r(x) or U_r(x)."""
    constant, linear, bend, distance, square = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    if upper and r == 0:
        return quadratic(x, constant, linear + distance, bend, square)
    if not upper and r == 1:
        return quadratic(x, 0.0, linear - distance, bend, square)
    if r == 2:
        return two_product(-2 * square, x) if upper else (x, 0.0)
    return 1.0, 0.0


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
        # Halves of equal sizes: half of the points suffices for the lower ones.
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


_PARTS = 16
"""Parts that threads share before they are merged: the last merges keep fewer threads busy."""


def many_points_discrepancy(points: Floats, kernel: Kernel) -> float:
    """Return a discrepancy of points in two or three dimensions, by loops that Numba compiles.

    It takes less than three times the memory of float64 points.
    """
    n, dims = points.shape
    exact = [
        Fraction(float(number))
        for number in (kernel.constant, kernel.linear, kernel.bend, kernel.distance, kernel.square)
    ]
    constant, linear, bend, distance, square = exact
    numbers = np.array([*map(float, exact), kernel.rank])
    offset = constant + linear / 2 + bend / 4 + distance / 2 + square / 3
    offsets = float(offset), float(offset - Fraction(float(offset)))
    order = np.argsort(points[:, 0], kind="stable")
    columns = np.empty((dims, n))
    for j in range(dims):
        np.take(points[:, j], order, out=columns[j], mode="clip")
    del order
    if dims == 2:
        room, sort_part, merge_parts = room_in_plane(n), sort_plane, merge_plane
    else:
        room, sort_part, merge_parts = room_in_space(n), sort_space, merge_space

    def alone(part: tuple[int, int]) -> tuple[Scalars, Scalars]:
        return _alone(columns, *part, numbers, *offsets)

    def sort(part: tuple[int, int]) -> Scalars:
        return sort_part(columns, room, *part, numbers)

    def merge(part: tuple[int, int, int]) -> Scalars:
        return merge_parts(columns, room, *part, numbers)

    edges = [n * k // _PARTS for k in range(_PARTS + 1)]
    with threads() as pool:
        parts = list(itertools.pairwise(edges))
        own, averages = zip(*pool.map(alone, parts), strict=True)
        pairs = list(pool.map(sort, parts))
        while len(edges) > 2:
            pairs += pool.map(merge, zip(edges[:-2:2], edges[1:-1:2], edges[2::2], strict=True))
            edges = edges[::2]
    mean = constant + linear + bend / 2 + (distance + square / 2) / 3
    found = _exact(own) + 2 * _exact(pairs) - 2 * n * _exact(averages) + n * n * mean**dims
    return math.sqrt(max(found, Fraction(0))) / n


def _exact(sums: Sequence[Scalars]) -> Fraction:
    return sum((Fraction(part) for each in sums for part in each), Fraction(0))


@compiled
def _alone(
    columns: Floats, start: int, stop: int, numbers: Floats, offset: float, rest: float
) -> tuple[Scalars, Scalars]:
    """Return the sum of the kernel of points and themselves, and that of its averages."""
    constant, linear, bend = numbers[0], numbers[1], numbers[2]
    curve = numbers[3] + numbers[4]
    own, own_rest, average, average_rest = 0.0, 0.0, 0.0, 0.0
    for i in range(start, stop):
        k, k_rest, m, m_rest = 1.0, 0.0, 1.0, 0.0
        for j in range(len(columns)):
            a, b = quadratic(columns[j, i], constant, 2 * linear, 2 * bend, 0.0)
            k, k_rest = multiply(k, k_rest, a, b)
            a, b = quadratic(columns[j, i], offset, linear - curve, bend, curve)
            a, b = add(a, b, rest, 0.0)
            m, m_rest = multiply(m, m_rest, a, b)
        own, own_rest = add(own, own_rest, k, k_rest)
        average, average_rest = add(average, average_rest, m, m_rest)
    return (own, own_rest), (average, average_rest)

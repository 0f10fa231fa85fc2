"""The L2 discrepancies of very many points in two and three dimensions, in compiled loops.

O(n log n) steps in two dimensions and O(n log^2 n) in three, where `pair_sum` takes n^1.5 and n^(5/3). All
sums and products are of two float64, as there: the result has a relative error of about n^2 2^-100.
"""

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from analysis._l2.kernels import Kernel
from analysis._l2.merges_plane import merge_plane, room_in_plane, sort_plane
from analysis._l2.merges_space import merge_space, room_in_space, sort_space
from analysis._l2.scalars import Scalars, add, multiply, quadratic
from analysis._loops import compiled, threads

_PARTS = 16
"""Parts that threads share before they are merged: the last merges keep fewer threads busy."""

Floats = NDArray[np.float64]


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
    order = np.argsort(points[:, 0])
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

"""Points in space with given ranks: coordinates that reach a star discrepancy, and swaps of ranks.

As in the plane (:mod:`analysis._searches.ranks_plane`), but a box has three sides, u_i + v_j + w_k in
logarithms, and constraints are not differences. Given two sides, the constraints of the third are still an
interval. So a coordinate outside its interval is moved to the nearest end, which satisfies all boxes with
this side. If the interval is empty, it is moved to the middle between the ends; next are the other sides of
the two most violated boxes, and later this coordinate again. This may give up although a solution exists:
coordinates found are right, those not found need not be impossible.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._loops import compiled
from analysis._searches.ranks_plane import enqueued

_ROUNDING = 1e-13
"""Relative violations of constraints up to this do not matter."""

_LIMIT = 48
"""Maximum number of coordinates that a swap may change before it counts as impossible."""

_BELOW_ONE = float(np.nextafter(1.0, 0.0))

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@compiled
def _tightest(
    ends: Floats, ranks: Ints, points: Ints, level: float, a: int, b: int, c: int, i: int, j: int, high: bool
) -> int:
    """Return the rank on axis c of the tightest box for rank i on axis a, given j on axis b."""
    n = ends.shape[1]
    adds = np.zeros(n + 1, np.int64)
    shift = 0 if high else 1
    for p in range(n):
        if ranks[a, p] < i + shift and ranks[b, p] < j + shift:
            adds[ranks[c, p] + 1 - shift] += 1
    count, at, most = 0, 0, -2.0 * n
    for k in range(n):
        count += adds[k]
        value = -(count / n + level) / ends[c, k] if high else (count / n - level) / ends[c, k]
        if value > most:
            most, at = value, k
    return at


@compiled
def _settle(
    ends: Floats, ranks: Ints, points: Ints, level: float, queue: Ints, length: int, limit: int
) -> bool:
    """Satisfy the constraints of the queue, if all others hold; a coordinate is axis * n + rank.

    ``ends[a]`` are the sorted coordinates along an axis, ``ranks[a, p]`` is the rank of point p there and
    ``points[a]`` the inverse. Gives up, with the coordinates in disorder, after ``limit`` of them.
    """
    n = ends.shape[1]
    size = 3 * n
    waits = np.zeros(size, np.bool_)
    for k in range(length):
        waits[queue[k]] = True
    first = 0
    opened, closed = np.empty(n), np.empty(n)
    following = np.empty(5, np.int64)
    for _ in range(limit):
        if length == 0:
            return True
        node = queue[first]
        waits[node] = False
        first = (first + 1) % size
        length -= 1
        a, i = node // n, node % n
        b, c = (a + 1) % 3, (a + 2) % 3
        # Open boxes that end at 1 on both other axes, or on one of them: j is on that other one.
        high, high_b, high_c = min(i / n + level, _BELOW_ONE), -1, -1
        for side in (b, c):
            count = 0
            for j in range(n):
                value = (count / n + level) / ends[side, j]
                if value < high:
                    high, high_b, high_c = value, (j if side == b else -1), (j if side == c else -1)
                if ranks[a, points[side, j]] < i:
                    count += 1
        low, low_b = 1e-300, -1
        inverse = 1.0 / ends[c]
        opened[:] = level
        closed[:] = -level
        inner = False
        for j in range(n):
            p = points[b, j]
            rank = ranks[c, p]
            if ranks[a, p] <= i:
                for k in range(rank, n):
                    closed[k] += 1.0 / n
            smallest, largest = 2.0 * n, 0.0
            for k in range(n):
                value = opened[k] * inverse[k]
                smallest = value if value < smallest else smallest
                value = closed[k] * inverse[k]
                largest = value if value > largest else largest
            if ranks[a, p] < i:
                for k in range(rank + 1, n):
                    opened[k] += 1.0 / n
            if smallest < high * ends[b, j]:
                high, high_b, inner = smallest / ends[b, j], j, True
            if largest > low * ends[b, j]:
                low, low_b = largest / ends[b, j], j
        before, after = i > 0 and ends[a, i - 1] > low, i < n - 1 and ends[a, i + 1] < high
        if before:
            low = ends[a, i - 1]
        if after:
            high = ends[a, i + 1]
        if low <= high * (1 + _ROUNDING):
            ends[a, i] = min(max(ends[a, i], low), high)
        else:
            ends[a, i] = min(np.sqrt(low * high), _BELOW_ONE)
            following[:] = -1
            following[0] = node
            if before:
                following[1] = node - 1
            elif low_b >= 0:
                following[1] = b * n + low_b
                following[2] = c * n + _tightest(ends, ranks, points, level, a, b, c, i, low_b, False)
            if after:
                following[3] = node + 1
            else:
                if inner:
                    high_c = _tightest(ends, ranks, points, level, a, b, c, i, high_b, True)
                if high_b >= 0:
                    following[3] = b * n + high_b
                if high_c >= 0:
                    following[4] = c * n + high_c
            for other in following:
                if other >= 0:
                    length = enqueued(queue, waits, first, length, other)
    return False


@compiled
def tighten(ends: Floats, ranks: Ints, points: Ints, level: float, rounds: int) -> bool:
    """Change the coordinates so that they reach a level, if possible; else leave them."""
    size = ends.size
    kept = ends.copy()
    if _settle(ends, ranks, points, level, np.arange(size), size, rounds * size):
        return True
    ends[:] = kept
    return False


@compiled
def _swap(ends: Floats, ranks: Ints, points: Ints, level: float, a: int, i: int, queue: Ints) -> bool:
    """Swap the ranks i and i + 1 along an axis, if the level can be kept; else leave everything as it is."""
    n = ends.shape[1]
    p, q = points[a, i], points[a, i + 1]
    points[a, i], points[a, i + 1] = q, p
    ranks[a, p], ranks[a, q] = i + 1, i
    kept = ends.copy()
    queue[0], queue[1] = a * n + i, a * n + i + 1
    if _settle(ends, ranks, points, level, queue, 2, _LIMIT):
        return True
    ends[:] = kept
    points[a, i], points[a, i + 1] = p, q
    ranks[a, p], ranks[a, q] = i, i + 1
    return False


@compiled
def walk(ends: Floats, ranks: Ints, points: Ints, level: float, draws: Floats) -> int:
    """Try a swap for each number drawn from [0, 1), in place; return how many were possible."""
    n = ends.shape[1]
    queue = np.empty(3 * n, np.int64)
    done = 0
    for draw in draws:
        chosen = int(draw * 3 * (n - 1))
        done += _swap(ends, ranks, points, level, chosen // (n - 1), chosen % (n - 1), queue)
    return done

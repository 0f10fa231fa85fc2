"""Points in the plane with given ranks: coordinates that reach a star discrepancy, and swaps of ranks.

Sort the points by x, and the y coordinates independently: x_0 <= x_1 <= ... and y_0 <= y_1 <= ... Let
C(i, j) count the points of ranks below i in x and below j in y. The star discrepancy is at most D if

    x_i y_j <= C(i, j)/n + D  (open boxes; x_n = y_n = 1),    x_i y_j >= C(i + 1, j + 1)/n - D  (closed).

With u = log x and w = -log y these are u_i - w_j <= ... and w_j - u_i <= ...: difference constraints, solved
by the Bellman-Ford algorithm: lower an x where an open box is too large, raise a y where a closed one is too
small, and repeat, until all constraints hold or this has gone on for too long. Only differences matter, so
the sides of length 1 are a variable too, x_n = t and y_n = 1/t: in the end all x are divided and all y
multiplied by t.

If two points with neighbouring ranks in x swap these, C changes in one row. All constraints that get tighter
belong to one x, and so does every cycle of constraints that cannot be satisfied: the swap is impossible
if and only if its consequences would lower that x again. The same holds for y, with the roles exchanged.
No table is stored: a row or a column of counts is recomputed on the way.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._host import compiled

_ROUNDING = 1e-14
"""Constraints that are violated by less count as satisfied."""

_LIMIT = 64
"""Maximum number of coordinates that a swap may change before it counts as impossible. Most change fewer."""

_BELOW_ONE = float(np.nextafter(1.0, 0.0))

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@compiled
def enqueue(queue: Ints, waits: NDArray[np.bool_], first: int, length: int, node: int) -> int:
    """Append a node to a ring of such unless it waits there; return the number of those that wait."""
    if waits[node]:
        return length
    waits[node] = True
    queue[(first + length) % len(queue)] = node
    return length + 1


@compiled
def _propagate(
    x: Floats,
    y: Floats,
    of_x: Ints,
    of_y: Ints,
    level: float,
    pivot: int,
    queue: Ints,
    length: int,
    limit: int,
) -> bool:
    """Satisfy the constraints of the queue, if all others hold: an x, y as n + j, t as 2 n.

    ``of_x[i]`` is the rank in y of the point whose x has rank i, ``of_y`` the inverse. Gives up, with the
    coordinates in disorder, when ``x[pivot]`` would be lowered, or after ``limit`` changes.
    """
    n = len(x)
    size = 2 * n + 1
    waits = np.zeros(size, np.bool_)
    for k in range(length):
        waits[queue[k]] = True
    first = 0
    side = 1.0
    for _ in range(limit):
        if length == 0:
            for i in range(n):
                x[i] = min(x[i] / side, _BELOW_ONE)
                y[i] = min(y[i] * side, _BELOW_ONE)
            return True
        node = queue[first]
        waits[node] = False
        first = (first + 1) % size
        length -= 1
        if node < n:
            value = x[node]
            if node > 0 and x[node - 1] > value:
                if node - 1 == pivot:
                    return False
                x[node - 1] = value
                length = enqueue(queue, waits, first, length, node - 1)
            count = 0
            for j in range(n):
                if of_y[j] <= node:
                    count += 1
                least = count / n - level
                if least > value * y[j] + _ROUNDING:
                    y[j] = least / value
                    length = enqueue(queue, waits, first, length, n + j)
        elif node < 2 * n:
            node -= n
            value = y[node]
            if node < n - 1 and y[node + 1] < value:
                y[node + 1] = value
                length = enqueue(queue, waits, first, length, n + node + 1)
            count = 0
            for i in range(n):
                largest = count / n + level
                if x[i] * value > largest + _ROUNDING:
                    if i == pivot:
                        return False
                    x[i] = largest / value
                    length = enqueue(queue, waits, first, length, i)
                if of_x[i] < node:
                    count += 1
            largest = min(node / n + level, _BELOW_ONE)
            if side * value > largest + _ROUNDING:
                side = largest / value
                length = enqueue(queue, waits, first, length, 2 * n)
        else:
            for i in range(n):
                largest = min(i / n + level, _BELOW_ONE) * side
                if x[i] > largest + _ROUNDING:
                    if i == pivot:
                        return False
                    x[i] = largest
                    length = enqueue(queue, waits, first, length, i)
    return False


@compiled
def tighten(x: Floats, y: Floats, of_x: Ints, of_y: Ints, level: float, rounds: int) -> bool:
    """Change the coordinates to reach a level, if possible; otherwise do not change them."""
    size = 2 * len(x) + 1
    kept_x, kept_y = x.copy(), y.copy()
    if _propagate(x, y, of_x, of_y, level, -1, np.arange(size), size, rounds * size):
        return True
    x[:], y[:] = kept_x, kept_y
    return False


@compiled
def _swap(x: Floats, y: Floats, of_x: Ints, of_y: Ints, level: float, i: int, queue: Ints) -> bool:
    """Swap the ranks i and i + 1 in x if the level can be kept; otherwise change nothing."""
    n = len(x)
    a, b = of_x[i], of_x[i + 1]
    of_x[i], of_x[i + 1] = b, a
    of_y[a], of_y[b] = i + 1, i
    pivot = i
    lowered = x[i]
    if a < b:
        pivot = i + 1
        lowered = x[i + 1]
        count = 0
        for j in range(b + 1):
            if j > a:
                largest = count / n + level
                if lowered * y[j] > largest + _ROUNDING:
                    lowered = largest / y[j]
            if of_y[j] <= i:
                count += 1
        if lowered == x[i + 1]:
            return True
    kept_x, kept_y = x.copy(), y.copy()
    x[pivot] = lowered
    queue[0] = pivot
    if _propagate(x, y, of_x, of_y, level, pivot, queue, 1, _LIMIT):
        return True
    x[:], y[:] = kept_x, kept_y
    of_x[i], of_x[i + 1] = a, b
    of_y[a], of_y[b] = i, i + 1
    return False


@compiled
def walk(x: Floats, y: Floats, of_x: Ints, of_y: Ints, level: float, draws: Floats) -> int:
    """Try a swap for each number drawn from [0, 1), in place; return how many were possible."""
    n = len(x)
    queue = np.empty(2 * n + 1, np.int64)
    done = 0
    for draw in draws:
        i = int(draw * (2 * n - 2))
        if i < n - 1:
            done += _swap(x, y, of_x, of_y, level, i, queue)
        else:
            done += _swap(y, x, of_y, of_x, level, i - (n - 1), queue)
    return done

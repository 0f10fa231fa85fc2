"""A search for generator matrices over F_2 in four dimensions, column by column.

A sequence is asked to have at most a given t in some projections, for all its first 2**m points. So certain
rows of the upper left m x m parts must be independent, m - t at a time. Of these, all but one were so in
m - 1 columns. They are independent in these columns already, or one sum of them vanishes there; then the same
sum of the new digits must be 1. These equations are linear, and the new columns of all matrices are their
solutions, an affine space. Going through all of them, depth first, decides whether any sequence exists.

Without loss of generality, as products with lower triangular matrices from the left and with one upper
triangular matrix from the right change no t: the first coordinate has t = 0 and the unit matrix; others with
t = 0 have unit upper triangular matrices. One with t = 1 has m - 1 independent rows in m columns, so that one
column, the gap, is no leading one. Its next row is 0 in the columns before, except for the gap, where it may
be 1. Coordinates that the question does not distinguish are sorted by their columns.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis._loops import compiled

DIMS = 4
SIZE = 20
"""Largest order of the matrices: the digits of three columns are the bits of a word."""
WIDTH = 21
"""Bits per column in a word."""
EQUATIONS = 4096
"""At least the number of sets of rows."""

Bounds = dict[tuple[int, ...], int]
"""The largest t that is allowed, by projection."""


class Found(NamedTuple):
    """The result of :func:`search`."""

    order: int
    """The largest m for which matrices were found."""
    complete: bool
    """Whether all were visited: there are none for larger m."""
    nodes: int
    rows: NDArray[np.int64]
    """The first matrices of this order, shape (DIMS, SIZE): rows, column k in bit k."""


def search(bounds: Bounds, limit: int, seed: int | None = None, most: int = SIZE) -> Found:
    """Search for matrices of up to an order, and stop there, or after so many systems of equations.

    ``bounds``: with all those that they imply, t of each coordinate 0 or 1 and of the first one 0.
    """
    perfect = np.array([bounds[i,] == 0 for i in range(DIMS)])
    exchanged = np.zeros(DIMS, np.bool_)
    for i in range(1, DIMS - 1):
        turned = {i: i + 1, i + 1: i}
        image = {tuple(sorted(turned.get(k, k) for k in axes)): t for axes, t in bounds.items()}
        exchanged[i] = image == bounds
    axes = np.array([[i in part for i in range(DIMS)] for part in bounds])
    rows = np.zeros((DIMS, SIZE + 1), np.int64)
    rng = np.random.default_rng(seed)
    offsets = np.zeros(1, np.int64) if seed is None else rng.integers(0, 2**40, 4096)
    order, nodes, complete = _searched(
        most, perfect, exchanged, axes, np.array(list(bounds.values())), limit, offsets, rows
    )
    return Found(int(order), bool(complete), int(nodes), rows[:, :SIZE])


@compiled
def _searched(
    most: int,
    perfect: NDArray[np.bool_],
    exchanged: NDArray[np.bool_],
    axes: NDArray[np.bool_],
    bounds: NDArray[np.int64],
    limit: int,
    offsets: NDArray[np.int64],
    best: NDArray[np.int64],
) -> tuple[int, int, bool]:
    """Return the largest order, the number of systems, and whether there are no others.

    ``axes``: shape (projections, DIMS). ``offsets``: solution 0 is the one of this number, at each system.
    ``best``: receives the first matrices of the largest order.
    """
    rows = np.zeros((DIMS, SIZE + 1), np.int64)
    equations = np.zeros((EQUATIONS, 2), np.int64)
    free = np.zeros((SIZE + 2, 3 * WIDTH), np.int64)
    known, count, counter, offset = np.zeros((4, SIZE + 2), np.int64)
    gaps, columns = np.zeros((SIZE + 2, DIMS), np.int64), np.zeros((SIZE + 2, DIMS), np.int64)
    ways = 1 << (DIMS - perfect.sum())
    way = np.full(SIZE + 2, -1)
    count[:] = -1
    order, nodes, m = 0, 0, 1
    while m:
        before = (1 << (m - 1)) - 1
        for i in range(DIMS):
            for j in range(SIZE + 1):
                rows[i, j] &= before
        if count[m] < 0 or counter[m] == 1 << count[m]:
            way[m] += 1
            # The first column has no row before.
            if way[m] == (ways if m > 1 else 1):
                m -= 1
                continue
            if nodes == limit:
                return order, nodes, False
            bit = 0
            for i in range(DIMS):
                if perfect[i]:
                    rows[i, m - 1] = 0
                    continue
                filled = way[m] >> bit & 1
                bit += 1
                gaps[m, i] = m - 1 if filled or m == 1 else gaps[m - 1, i]
                if m > 1:
                    rows[i, m - 2] = filled << gaps[m - 1, i]
            found = _equations(rows, m, perfect, axes, bounds, equations)
            known[m], count[m] = _solved(equations, found, m, free[m])
            offset[m] = offsets[nodes % len(offsets)]
            counter[m] = 0
            nodes += 1
            continue
        chosen = (counter[m] ^ offset[m]) & ((1 << count[m]) - 1)
        counter[m] += 1
        digits = known[m]
        for k in range(count[m]):
            if chosen >> k & 1:
                digits ^= free[m, k]
        bit = 0
        for i in range(1, DIMS):
            columns[m, i] = digits >> WIDTH * (i - 1) & ((1 << WIDTH) - 1)
            if not perfect[i]:
                columns[m, i] |= (way[m] >> bit & 1) << WIDTH
                bit += 1
        if not _sorted(columns, exchanged, m):
            continue
        for i in range(DIMS):
            for j in range(m - 1):
                rows[i, j] |= (columns[m, i] >> j & 1) << (m - 1)
            if perfect[i]:
                rows[i, m - 1] = 1 << (m - 1)
        if m > order:
            order = m
            best[:] = rows
        if m == most:
            return order, nodes, False
        m += 1
        way[m], count[m] = -1, -1
    return order, nodes, True


@compiled
def _sorted(columns: NDArray[np.int64], exchanged: NDArray[np.bool_], m: int) -> bool:
    """Return whether no coordinate precedes one that it may be exchanged with, by the first columns."""
    for i in range(DIMS - 1):
        if not exchanged[i]:
            continue
        for k in range(1, m + 1):
            if columns[k, i] != columns[k, i + 1]:
                if columns[k, i] > columns[k, i + 1]:
                    return False
                break
    return True


@compiled
def _equations(
    rows: NDArray[np.int64],
    m: int,
    perfect: NDArray[np.bool_],
    axes: NDArray[np.bool_],
    bounds: NDArray[np.int64],
    equations: NDArray[np.int64],
) -> int:
    """Find sums of new digits that must be 1, and return how many, or -1 if none suffice.

    ``rows``: with m - 1 columns. ``equations``: receives the digits of a sum, and what they sum up to: known
    digits, those of the unit matrix and of diagonals, are on the other side.
    """
    vectors, sums, ones = np.zeros((3, SIZE + 2), np.int64)
    vanishing = np.full(SIZE + 2, -1)
    chosen, number = np.zeros(DIMS, np.int64), np.zeros(DIMS, np.int64)
    found = 0
    for part in range(len(bounds)):
        total, size = m - bounds[part], 0
        for i in range(DIMS):
            if axes[part, i]:
                chosen[size] = i
                size += 1
        if total < size:
            continue
        number[:] = 0
        place, used = 0, 0
        while place >= 0:
            # One more row of this coordinate, reduced by those before.
            i, j = chosen[place], number[place]
            vector, digits, one = rows[i, j], 0, 0
            if perfect[i] and j == m - 1:
                one = 1
            elif i:
                digits = 1 << (WIDTH * (i - 1) + j)
            for k in range(used):
                if vector ^ vectors[k] < vector:
                    vector ^= vectors[k]
                    digits ^= sums[k]
                    one ^= ones[k]
            vectors[used], sums[used], ones[used] = vector, digits, one
            vanishing[used + 1] = vanishing[used]
            if vector == 0:
                if vanishing[used] >= 0:
                    return -1
                vanishing[used + 1] = used
            used += 1
            number[place] += 1
            if place < size - 1:
                place += 1
                continue
            if used < total:
                continue
            last = vanishing[used]
            if last >= 0:
                equations[found, 0], equations[found, 1] = sums[last], 1 ^ ones[last]
                found += 1
            # Back to a coordinate that can have one more row, with at least one for each that follows.
            while place >= 0 and used + size - place > total:
                used -= number[place]
                number[place] = 0
                place -= 1
    return found


@compiled
def _solved(equations: NDArray[np.int64], found: int, m: int, free: NDArray[np.int64]) -> tuple[int, int]:
    """Return one solution and the dimension of the space of all, or -1 if there are none.

    ``free``: receives a basis of the solutions of the homogeneous system.
    """
    if found < 0:
        return 0, -1
    pivots = np.zeros(3 * WIDTH, np.int64)
    rank = 0
    for k in range(found):
        digits, value = equations[k, 0], equations[k, 1]
        for n in range(rank):
            if digits & pivots[n]:
                digits ^= equations[n, 0]
                value ^= equations[n, 1]
        if digits == 0:
            if value:
                return 0, -1
            continue
        pivots[rank] = digits & -digits
        for n in range(rank):
            if equations[n, 0] & pivots[rank]:
                equations[n, 0] ^= digits
                equations[n, 1] ^= value
        equations[rank, 0], equations[rank, 1] = digits, value
        rank += 1
    solution, taken = 0, 0
    for n in range(rank):
        taken |= pivots[n]
        if equations[n, 1]:
            solution |= pivots[n]
    count = 0
    for i in range(DIMS - 1):
        for j in range(m - 1):
            digit = 1 << (WIDTH * i + j)
            if digit & taken:
                continue
            free[count] = digit
            for n in range(rank):
                if equations[n, 0] & digit:
                    free[count] |= pivots[n]
            count += 1
    return solution, count


def matrices(rows: NDArray[np.int64]) -> NDArray[np.uint32]:
    """Return rows as a digital sequence has its matrices, uint32 of shape (DIMS, 32)."""
    words = np.zeros((DIMS, 32), np.uint32)
    for k in range(SIZE):
        words[:, k] = (rows >> k & 1) @ (np.int64(1) << np.arange(31, 31 - SIZE, -1))
    return words

"""Generators of the rank-1 lattices with the largest toroidal minimum distance.

The points i (1, a, ...) / n modulo 1, times n, are the integer lattice that (1, a, ...) spans together
with n times the unit vectors: its shortest vector is their minimum distance. Signs and, in three
dimensions, the order of a and b do not change it.
"""

import numpy as np
from numpy.typing import NDArray


def shortest_squares(n: int, a: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the squared length of the shortest vector of each lattice with the rows (1, a), (0, n).

    By Lagrange-Gauss reduction: the shorter vector reduces the longer until nothing changes.

    ``n``: at most 2**24, so that the quotients are right in float64. ``a``: int64 array, shape (k,): in [0,
    n). Returns int64 array, shape (k,).
    """
    ux, uy, vx, vy = np.ones_like(a), a, np.zeros_like(a), np.full_like(a, n)
    while True:
        u, v = ux * ux + uy * uy, vx * vx + vy * vy
        swap = v < u
        ux, vx = np.where(swap, vx, ux), np.where(swap, ux, vx)
        uy, vy = np.where(swap, vy, uy), np.where(swap, uy, vy)
        shorter = np.minimum(u, v)
        quotient = np.rint((ux * vx + uy * vy) / shorter).astype(np.int64)
        if not quotient.any():
            return shorter
        vx, vy = vx - quotient * ux, vy - quotient * uy


def best_planar(n: int) -> tuple[int, int]:
    """Return the smallest ``a`` of a best lattice in two dimensions, and its squared distance."""
    a = np.arange(1, max(n // 2, 1) + 1)
    squares = shortest_squares(n, a)
    best = int(np.argmax(squares))
    return int(a[best]), int(squares[best])


def best_spatial(n: int) -> tuple[int, int, int]:
    """Return the first ``a <= b`` of a best lattice in three dimensions, and its squared distance.

    The search covers all pairs. A shortest vector is no longer than Hermite's bound for the volume n**2, so
    for each ``a`` only the few i with a short i (1, a) matter.

    ``n``: at most 2**16, so that the squares fit their words. Takes n**2 bytes of memory.
    """
    half = n // 2
    number = np.arange(half + 1, dtype=np.int64)
    squares = np.empty((half + 1, half + 1), np.uint32)
    """The square of the distance of i b from the closest multiple of n, in row i and column b."""
    for i in number:
        product = i * number % n
        squares[i] = np.minimum(product, n - product) ** 2
    bound = int(2 ** (1 / 3) * n ** (4 / 3)) + 1
    best = (1, 1, 0)
    for a in range(1, half + 1):
        planar = squares[1] + squares[a]
        shortest = np.full(half + 1 - a, bound, np.uint32)
        for i in np.flatnonzero(planar <= bound)[1:]:
            np.minimum(shortest, planar[i] + squares[i, a:], out=shortest)
        b = int(np.argmax(shortest))
        if shortest[b] > best[2]:
            best = (a, a + b, int(shortest[b]))
    return best

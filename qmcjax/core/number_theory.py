"""Exact integers before tracing: matrices and polynomials over F_q, shortest vectors, Thue-Morse words.

``q`` is a prime below 2**16.

The points i (1, a, ...) / n modulo 1, times n, are the integer lattice that (1, a, ...) spans together
with n times the unit vectors: its shortest vector is their minimum distance. Signs and, in three
dimensions, the order of a and b do not change it.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks

FIELD_LIMIT = 2**16
"""Bound on the moduli: a product of two elements fits a 32-bit word."""


def is_prime(number: int) -> bool:
    """Return whether a number is prime, by trial division.

    Examples
    --------
    >>> [n for n in range(20) if is_prime(n)]
    [2, 3, 5, 7, 11, 13, 17, 19]
    """
    return number >= 2 and all(number % d for d in range(2, math.isqrt(number) + 1))


def next_prime(number: int) -> int:
    """Return the smallest prime that is not below ``number``.

    Examples
    --------
    >>> next_prime(8), next_prime(11)
    (11, 11)
    """
    while not is_prime(number):
        number += 1
    return number


def prime(name: str, value: Any, low: int = 2, high: int = FIELD_LIMIT - 1) -> int:
    """Return ``value`` as an int, or raise a ValueError unless it is a prime in ``[low, high]``."""
    number = checks.integer(name, value, low, high)
    if not is_prime(number):
        raise ValueError(f"{name} must be prime, got {value!r}")
    return number


def inverse(matrix: NDArray[Any], q: int) -> NDArray[np.int64]:
    """Invert a square matrix over F_q, whose entries are in [0, q); a singular one raises a ValueError.

    Examples
    --------
    >>> inverse(np.array([[1, 1], [0, 2]]), q=3)
    array([[1, 1],
           [0, 2]])
    """
    m = len(matrix)
    rows = np.hstack([matrix.astype(np.int64), np.eye(m, dtype=np.int64)])
    for k in range(m):
        pivot = k + np.argmax(rows[k:, k] != 0)
        rows[[k, pivot]] = rows[[pivot, k]]
        rows[k] = rows[k] * pow(int(rows[k, k]), -1, q) % q
        factors = rows[:, k].copy()
        factors[k] = 0
        rows = (rows - factors[:, None] * rows[k]) % q
    return rows[:, m:]


def shortest_squares(n: int, a: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the squared length of the shortest vector of each lattice with the rows (1, a), (0, n).

    It uses Lagrange-Gauss reduction: the shorter vector reduces the longer until nothing changes. ``n`` is at
    most 2**24, which keeps the quotients exact in float64.
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
    for each ``a`` only the few i with a short i (1, a) matter. ``n`` is at most 2**16, so the squares fit
    their words. It takes n**2 bytes of memory.
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


CONTEXT = 20
"""Letters of the Thue-Morse word in a symbol before its own."""


def word_factors() -> list[tuple[int, ...]]:
    """Return the 64 factors of 21 letters of the Thue-Morse word, in the order of their first occurrence."""
    word = [0]
    while len(word) < 2**10:
        word += [1 - letter for letter in word]
    length = CONTEXT + 1
    return list(dict.fromkeys(tuple(word[i : i + length]) for i in range(len(word) - length + 1)))


def word_children() -> NDArray[np.uint32]:
    """Return the numbers of the two children of each symbol, shape (64, 2).

    A symbol is a factor u of the Thue-Morse word: the letter at its place and those before it. The
    substitution m of that word, 0 -> 01, 1 -> 10, writes the next level: the children of u are the factors
    m(u)[20:41] and m(u)[21:42] [1]_. The symbols of a level are therefore successive factors of the word, and
    equal ones are at least 24 places apart.

    References
    ----------
    .. [1] A. Ahmed, T. Niese, H. Huang, O. Deussen, "An Adaptive Point Sampler on a Regular Lattice", 2017:
       the idea of tiles named by factors. The rule is our own.
    """
    known = word_factors()
    number = {factor: i for i, factor in enumerate(known)}
    symbols = np.empty((len(known), 2), np.uint32)
    for i, factor in enumerate(known):
        image = [half for letter in factor for half in (letter, 1 - letter)]
        for half in range(2):
            start = CONTEXT + half
            symbols[i, half] = number[tuple(image[start : start + CONTEXT + 1])]
    return symbols


@lru_cache(maxsize=2**16)
def is_irreducible(polynomial: int) -> bool:
    """Return whether a polynomial is irreducible with constant coefficient 1 (M. O. Rabin, 1980).

    Modulo an irreducible polynomial of degree n, x**(2**n) is x, and x**(2**(n / p)) + x has no common factor
    with it for any prime p that divides n.
    """
    degree = polynomial.bit_length() - 1
    if polynomial % 2 == 0:
        return False
    maximal = {degree // prime for prime in _prime_factors(degree)}
    power = _remainder(0b10, polynomial)
    for k in range(1, degree + 1):
        power = _squared(power, polynomial)
        if k in maximal and _common(polynomial, power ^ 0b10) != 1:
            return False
    return power == _remainder(0b10, polynomial)


def _squared(value: int, polynomial: int) -> int:
    """Square a polynomial: zeros separate its coefficients."""
    return _remainder(int(f"{value:b}", 4), polynomial)


def _remainder(value: int, polynomial: int) -> int:
    while (beyond := value.bit_length() - polynomial.bit_length()) >= 0:
        value ^= polynomial << beyond
    return value


def _common(a: int, b: int) -> int:
    """Return the greatest common divisor of two polynomials."""
    while b:
        a, b = b, _remainder(a, b)
    return a


def _prime_factors(number: int) -> set[int]:
    return {p for p in range(2, number + 1) if number % p == 0 and is_prime(p)}

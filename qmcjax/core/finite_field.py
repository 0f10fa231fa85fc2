"""Linear algebra over the prime field F_q, exact, on NumPy integers, before tracing.

``q`` is a prime below 2**16. Entries of matrices are integers, taken modulo ``q``; results are int64 arrays.
"""

import math
from typing import Any

import numpy as np

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


def product(a: np.ndarray, b: np.ndarray, q: int) -> np.ndarray:
    """Multiply matrices over F_q.

    ``a``, ``b``: shape (..., m, m).

    Examples
    --------
    >>> product([[1, 2], [0, 1]], [[1, 2], [0, 1]], q=3)
    array([[1, 1],
           [0, 1]])
    """
    q = prime("q", q)
    a, b = _square("a", a, q), _square("b", b, q)
    if a.shape[-1] != b.shape[-1]:
        raise ValueError(f"a and b must be of the same size, got shapes {a.shape} and {b.shape}")
    return a @ b % q


def rank(matrix: np.ndarray, q: int) -> int:
    """Return the rank of a matrix over F_q.

    ``matrix``: shape (m, n).

    Examples
    --------
    >>> rank([[1, 2], [2, 1]], q=3), rank([[1, 2], [2, 1]], q=5)
    (1, 2)
    """
    q = prime("q", q)
    elements = _elements("matrix", matrix, q)
    if elements.ndim != 2:
        raise ValueError(f"matrix must have two axes, got shape {elements.shape}")
    return _reduced(elements, elements.shape[1], q)[1]


def inverse(matrix: np.ndarray, q: int) -> np.ndarray:
    """Invert a square matrix over F_q; a singular one raises a ValueError.

    ``matrix``: shape (m, m).

    Examples
    --------
    >>> inverse([[1, 1], [0, 2]], q=3)
    array([[1, 1],
           [0, 2]])
    """
    q = prime("q", q)
    elements = _square("matrix", matrix, q)
    if elements.ndim != 2:
        raise ValueError(f"matrix must have two axes, got shape {elements.shape}")
    m = len(elements)
    reduced, pivots = _reduced(np.hstack([elements, np.eye(m, dtype=np.int64)]), m, q)
    if pivots < m:
        raise ValueError(f"matrix must be invertible over F_{q}, got rank {pivots} of {m}")
    return reduced[:, m:]


def _elements(name: str, matrix: np.ndarray, q: int) -> np.ndarray:
    array = np.asarray(matrix)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} must hold integers, got {array.dtype}")
    # In at least 32 bits: q may exceed the range of narrower integers.
    return (array.astype(np.result_type(array, np.uint32)) % q).astype(np.int64)


def _square(name: str, matrix: np.ndarray, q: int) -> np.ndarray:
    array = _elements(name, matrix, q)
    if array.ndim < 2 or array.shape[-1] != array.shape[-2]:
        raise ValueError(f"{name} must be square, got shape {array.shape}")
    return array


def _reduced(matrix: np.ndarray, columns: int, q: int) -> tuple[np.ndarray, int]:
    """Return the row echelon form with respect to the first columns, and the number of its pivots."""
    matrix = matrix.copy()
    pivots = 0
    for column in range(columns):
        candidates = np.flatnonzero(matrix[pivots:, column])
        if not len(candidates):
            continue
        row = pivots + candidates[0]
        matrix[[pivots, row]] = matrix[[row, pivots]]
        matrix[pivots] = matrix[pivots] * pow(int(matrix[pivots, column]), -1, q) % q
        factors = matrix[:, column].copy()
        factors[pivots] = 0
        matrix = (matrix - factors[:, None] * matrix[pivots]) % q
        pivots += 1
    return matrix, pivots

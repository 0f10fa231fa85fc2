"""Matrices over F_q against counting and Python integers."""

import itertools

import numpy as np
import pytest
from tables import refuses

from qmcjax.core import number_theory

PRIMES = [2, 3, 5, 7, 65521]


def multiplied(a, b, q):
    """Return a product by the definition, in Python integers."""
    m = range(len(a))
    return [[sum(int(a[i][k]) * int(b[k][j]) for k in m) % q for j in m] for i in m]


def spanned(rows, q):
    """Return the number of linear combinations of rows."""
    combinations = itertools.product(range(q), repeat=len(rows))
    return len({tuple(np.array(c) @ rows % q) for c in combinations})


@pytest.mark.parametrize("q", PRIMES)
@pytest.mark.parametrize("m", [1, 2, 5, 32])
def test_product_equals_python_integers(q, m):
    """The largest entries too: (q - 1)**2 times 32 exceeds a word."""
    rng = np.random.default_rng(m)
    for low in (0, q - 1):
        a, b = rng.integers(low, q, (2, m, m))
        assert number_theory.product(a, b, q).tolist() == multiplied(a, b, q)
    assert number_theory.product(a - q, b.astype(np.uint32), q).tolist() == multiplied(a, b, q)


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
def test_entries_of_any_integer_dtype(dtype):
    """Those of narrow ones too, though q is beyond their range, and those of 64 bits, without a sign."""
    bounds = np.iinfo(dtype)
    matrix = np.array([[bounds.max, 1], [0, bounds.min + 1]], dtype)
    for q in PRIMES:
        determinant = bounds.max * (bounds.min + 1) % q
        assert (number_theory.rank(matrix, q) == 2) == (determinant != 0)
        assert number_theory.product(matrix, matrix, q).tolist() == multiplied(matrix, matrix, q)


def test_product_broadcasts_over_leading_axes():
    a = np.random.default_rng(0).integers(0, 5, (3, 4, 4))
    together = number_theory.product(a, a[0], 5)
    assert np.array_equal(together, [number_theory.product(matrix, a[0], 5) for matrix in a])


@pytest.mark.parametrize("q", [2, 3, 5])
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (3, 2), (3, 3), (4, 4)])
def test_rank_counts_the_row_space(q, shape):
    rng = np.random.default_rng(q)
    for _ in range(10):
        matrix = rng.integers(0, q, shape) * rng.integers(0, 2, shape)
        assert spanned(matrix, q) == q ** number_theory.rank(matrix, q)


@pytest.mark.parametrize(("q", "m", "order"), [(2, 2, 6), (2, 3, 168), (3, 2, 48), (5, 2, 480), (7, 2, 2016)])
def test_the_general_linear_group(q, m, order):
    """Of all matrices, as many are regular as GL(m, q) has elements; these have inverses on both sides."""
    regular = 0
    for entries in itertools.product(range(q), repeat=m * m):
        matrix = np.reshape(entries, (m, m))
        if number_theory.rank(matrix, q) < m:
            with pytest.raises(ValueError, match="matrix must be invertible"):
                number_theory.inverse(matrix, q)
            continue
        regular += 1
        inverse = number_theory.inverse(matrix, q)
        assert multiplied(matrix, inverse, q) == multiplied(inverse, matrix, q) == np.eye(m).tolist()
    assert regular == order


@pytest.mark.parametrize("q", PRIMES)
def test_inverse_of_large_matrices(q):
    rng = np.random.default_rng(q)
    lower, upper = np.tril(rng.integers(0, q, (32, 32)), -1), np.triu(rng.integers(0, q, (32, 32)), 1)
    units = np.diag(rng.integers(1, q, 32))
    matrix = multiplied(lower + units, rng.permutation(upper + np.eye(32, dtype=int)), q)
    inverse = number_theory.inverse(matrix, q)
    assert inverse.min() >= 0
    assert inverse.max() < q
    assert multiplied(matrix, inverse, q) == np.eye(32).tolist()
    assert number_theory.rank(matrix, q) == 32
    assert number_theory.rank(np.array(matrix)[:, :20], q) == 20


def test_primes_by_the_sieve():
    sieve = np.ones(10000, bool)
    sieve[:2] = False
    for n in range(2, 100):
        sieve[n * n :: n] = False
    assert [number_theory.is_prime(n) for n in range(10000)] == sieve.tolist()
    assert [number_theory.next_prime(n) for n in (0, 2, 14, 65522)] == [2, 2, 17, 65537]


test_bad_input_is_named = refuses(
    ValueError,
    {
        "q must be prime, got 4": lambda: number_theory.rank(np.eye(2, dtype=int), 4),
        r"q must be an integer in \[2, 65535\], got 1": lambda: number_theory.rank(np.eye(2, dtype=int), 1),
        "matrix must contain integers, got float64": lambda: number_theory.rank(np.eye(2), 3),
        r"matrix must have two axes, got shape \(3,\)": lambda: number_theory.rank(np.arange(3), 3),
        r"matrix must be square, got shape \(2, 3\)": lambda: number_theory.inverse(np.ones((2, 3), int), 3),
        "matrix must be invertible over F_3, got rank 1 of 3": lambda: number_theory.inverse(
            np.ones((3, 3), int), 3
        ),
        "a and b .* same size": lambda: number_theory.product(np.ones((2, 2), int), np.ones((3, 3), int), 3),
        r"a must be square, got shape \(2,\)": lambda: number_theory.product(
            np.ones(2, int), np.ones((2, 2), int), 3
        ),
    },
)


def test_a_modulus_is_an_integer():
    with pytest.raises(TypeError, match=r"q must be an integer .* got 3.0"):
        number_theory.inverse(np.eye(2, dtype=int), 3.0)

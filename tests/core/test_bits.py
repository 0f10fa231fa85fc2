"""Words of 32 bits against digits and matrices, and what is traced once."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

from qmcjax.core import bits, number_theory
from qmcjax.core.bits import traced_once

WORDS = np.random.default_rng(0).integers(0, 2**32, 500, dtype=np.uint32)
CORNERS = np.array([0, 1, 2, 255, 256, 0x7FFFFFFF, 0x80000000, 0xFFFFFF00, 0xFFFFFF80, 0xFFFFFFFF], np.uint32)


def digits(words):
    """Bit k of each word in column k."""
    return (words[:, None] >> np.arange(32, dtype=np.uint32)) & 1


def words_of(digit_rows):
    return (digit_rows.astype(np.uint64) << np.arange(32, dtype=np.uint64)).sum(axis=1).astype(np.uint32)


def test_reverse_reads_the_digits_backwards():
    assert bits.reverse(jnp.asarray(WORDS)).tolist() == [int(f"{w:032b}"[::-1], 2) for w in WORDS]


PASCAL = np.array([[math.comb(j, i) % 2 for j in range(32)] for i in range(32)])


MATRICES = {bits.pascal: PASCAL, bits.gray_decode: np.triu(np.ones((32, 32), int))}


@pytest.mark.parametrize("product, matrix", MATRICES.items(), ids=["pascal", "gray_decode"])
def test_log_steps_equal_the_matrix_over_f2(product, matrix):
    expected = words_of(digits(WORDS) @ matrix.T % 2)
    assert np.array_equal(product(jnp.asarray(WORDS)), expected)


def test_gray_encode_inverts_gray_decode():
    assert np.array_equal(bits.gray_encode(bits.gray_decode(jnp.asarray(WORDS))), WORDS)


def test_hash_word_is_a_bijection_with_avalanche():
    for words in (np.arange(2**20), np.unique(np.random.default_rng(1).integers(0, 2**32, 2**20))):
        assert len(np.unique(bits.hash_word(jnp.asarray(words, jnp.uint32)))) == len(words)
    base = np.asarray(bits.hash_word(jnp.asarray(WORDS)))
    for k in range(32):
        flipped = np.asarray(bits.hash_word(jnp.asarray(WORDS ^ np.uint32(1 << k))))
        rate = digits(base ^ flipped).mean(axis=0)
        assert np.all(np.abs(rate - 0.5) < 5 * 0.5 / np.sqrt(len(WORDS)))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_to_unit_rounds_down_and_stays_below_one(dtype):
    words = np.concatenate([WORDS, CORNERS])
    values = np.asarray(bits.to_unit(jnp.asarray(words), dtype))
    exact = words / 2.0**32
    ulp = 2.0**-24 if dtype == jnp.float32 else 2.0**-53
    assert values.dtype == dtype
    assert values.max() < 1
    assert np.all((values <= exact) & (exact - values < ulp))


def test_to_unit_refuses_other_dtypes():
    with pytest.raises(ValueError, match=r"dtype must be float32 or float64, got .*float16"):
        bits.to_unit(jnp.uint32(1), jnp.float16)


def test_a_function_is_traced_once_and_taken_over():
    """Its operations are those of the program that calls it; NumPy's arrays need no program."""
    traces = []

    @traced_once
    def twice(word):
        traces.append(type(word))
        return word + word

    words = np.arange(4, dtype=np.uint32)
    assert isinstance(twice(words), np.ndarray) and traces == [np.ndarray]
    made = jax.jit(lambda word: twice(twice(word))).lower(words).as_text()
    assert made.count("stablehlo.add") == 2 and "call" not in made and len(traces) == 2
    np.testing.assert_array_equal(jax.vmap(twice)(jnp.stack([words, words])), [2 * words] * 2)
    np.testing.assert_array_equal(twice(jnp.asarray(words)), 2 * words)
    assert len(traces) == 2
    twice(jnp.asarray(words[:3]))
    assert len(traces) == 3


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


INTEGERS, SQUARE = np.ones((2, 3), int), np.eye(2, dtype=int)
test_bad_input_is_named = refused(
    (number_theory.rank, SQUARE, 4, "q must be prime, got 4"),
    (number_theory.rank, SQUARE, 1, r"q must be an integer in \[2, 65535\], got 1"),
    (number_theory.rank, np.eye(2), 3, "matrix must contain integers, got float64"),
    (number_theory.rank, np.arange(3), 3, r"matrix must have two axes, got shape \(3,\)"),
    (number_theory.inverse, INTEGERS, 3, r"matrix must be square, got shape \(2, 3\)"),
    (number_theory.inverse, np.ones((3, 3), int), 3, "matrix must be invertible over F_3, got rank 1 of 3"),
    (TypeError, number_theory.inverse, SQUARE, 3.0, "q must be an integer .* got 3.0"),
    (number_theory.product, SQUARE, np.ones((3, 3), int), 3, "a and b .* same size"),
    (number_theory.product, np.ones(2, int), SQUARE, 3, r"a must be square, got shape \(2,\)"),
    call=lambda function, *given: function(*given),
    error=ValueError,
)

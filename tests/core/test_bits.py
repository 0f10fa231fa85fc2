"""Words of 32 bits against digits and matrices, and what is traced once."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

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


@pytest.mark.parametrize(("q", "m", "order"), [(2, 2, 6), (2, 3, 168), (3, 2, 48), (5, 2, 480), (7, 2, 2016)])
def test_the_general_linear_group(q, m, order):
    """Of all matrices, as many are regular as GL(m, q) has elements; these have inverses on both sides."""
    regular = 0
    for entries in itertools.product(range(q), repeat=m * m):
        matrix = np.reshape(entries, (m, m))
        try:
            inverse = number_theory.inverse(matrix, q)
        except ValueError:
            continue
        regular += 1
        assert multiplied(matrix, inverse, q) == multiplied(inverse, matrix, q) == np.eye(m).tolist()
    assert regular == order


@pytest.mark.parametrize("q", PRIMES)
def test_inverse_of_large_matrices(q):
    rng = np.random.default_rng(q)
    lower, upper = np.tril(rng.integers(0, q, (32, 32)), -1), np.triu(rng.integers(0, q, (32, 32)), 1)
    units = np.diag(rng.integers(1, q, 32))
    matrix = multiplied(lower + units, rng.permutation(upper + np.eye(32, dtype=int)), q)
    inverse = number_theory.inverse(np.array(matrix), q)
    assert inverse.min() >= 0
    assert inverse.max() < q
    assert multiplied(matrix, inverse, q) == np.eye(32).tolist()


def test_primes_by_the_sieve():
    sieve = np.ones(10000, bool)
    sieve[:2] = False
    for n in range(2, 100):
        sieve[n * n :: n] = False
    assert [number_theory.is_prime(n) for n in range(10000)] == sieve.tolist()
    assert [number_theory.next_prime(n) for n in (0, 2, 14, 65522)] == [2, 2, 17, 65537]

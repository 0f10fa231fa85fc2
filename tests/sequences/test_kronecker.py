"""Kronecker sequences: against integers of any size, and the theorems on how far multiples stay apart."""

import math
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first

from qmcjax import orders, samplers, sequences

INDEX = np.concatenate([first(50), np.random.default_rng(1).integers(0, 2**32, 100, dtype=np.uint32)])
INDEX = np.append(INDEX, np.uint32(2**32 - 1) - first(5)).astype(np.uint32)


def root(number: int, digits: int) -> Fraction:
    """Return a square root to so many binary digits."""
    return Fraction(math.isqrt(number << 2 * digits), 1 << digits)


@pytest.mark.parametrize("high", [0, 1, 12345, 2**32 - 1])
def test_multiples_are_exact(high):
    """Point i is floor(i step modulo 2**96 / 2**64), for 64-bit indices, too."""
    steps = [root(2, 200), Fraction(1, 3), Fraction(2**96 - 1, 2**96), Fraction(-1, 7), 0.1]
    sequence = sequences.kronecker(steps)
    if high:
        sequence = sequence.with_high_word(jnp.full(INDEX.shape, high, jnp.uint32))
    integers = [round(Fraction(step) * 2**96) for step in steps]
    expected = [[(high * 2**32 + int(i)) * n % 2**96 >> 64 for n in integers] for i in INDEX]
    assert np.asarray(sequence.bits(INDEX)).tolist() == expected


def test_no_index_loses_precision():
    """All 32 digits of the multiples of an irrational number, to the last index: one unit at most."""
    step = root(7, 400)
    bits = np.asarray(sequences.kronecker([step]).bits(INDEX))[:, 0]
    for index, word in zip(INDEX, bits, strict=True):
        away = (int(index) * step * 2**32 - int(word)) % 2**32
        assert 0 <= away < 1 or away > 2**32 - Fraction(1, 2**30)


@pytest.mark.parametrize("dims", [1, 2, 5, 64])
def test_steps_of_roberts_are_powers_of_the_root(dims):
    """p**(d + 1) = p + 1, to the last of 96 digits."""
    words = np.asarray(sequences.roberts(dims).steps).astype(object)
    steps = [Fraction(int(a << 64 | b << 32 | c), 2**96) for a, b, c in words]
    inverse = steps[0]
    # 1 = p**-d + p**-(d + 1).
    assert abs(inverse**dims + inverse ** (dims + 1) - 1) < Fraction(2 * dims + 1, 2**96)
    assert all(abs(inverse**j - step) < Fraction(j, 2**96) for j, step in enumerate(steps, start=1))


def distances(sequence, n: int) -> np.ndarray:
    """Return how far multiples 1, ..., n - 1 are from an integer vector, in the maximum norm."""
    bits = np.asarray(sequence.bits(first(n)[1:])).astype(np.int64)
    return np.minimum(bits, 2**32 - bits).max(axis=1) / 2.0**32


@pytest.mark.parametrize("dims", [1, 2, 3])
def test_multiples_of_roberts_steps_stay_apart(dims):
    """Badly approximable vectors: k**(1 / d) times the distance has a lower bound; Dirichlet has an upper."""
    n = 2**16
    scaled = np.arange(1, n) ** (1 / dims) * distances(sequences.roberts(dims), n)
    assert scaled.min() > {1: 0.38, 2: 0.4, 3: 0.3}[dims]
    assert scaled.min() < 1


def test_other_steps_come_close():
    """The limit of the theorem: e - 2 is well approximable, a rational number returns."""
    for step, closest in ((Fraction(math.e) - 2, 0.1), (Fraction(1, 1000), 1e-4)):
        scaled = np.arange(1, 2**16) * distances(sequences.kronecker([step]), 2**16)
        assert scaled.min() < closest


@pytest.mark.slow
def test_gaps_of_the_golden_ratio_have_two_or_three_lengths():
    """The three distance theorem, in units of 2**-32 rounded down: neighbouring integers are one length."""
    for n in (5, 21, 100, 1000):
        points = np.sort(np.asarray(sequences.roberts(1).bits(first(n)))[:, 0].astype(np.int64))
        gaps = np.unique(np.diff(np.append(points, 2**32)))
        assert 2 <= 1 + np.count_nonzero(np.diff(gaps) > 1) <= 3


def test_samplers_take_large_images_and_scramblers_take_the_sequence():
    sampler = samplers.contiguous(orders.raster(65536, 65536), sequences.roberts(), 16)
    point = sampler(np.array([65535]), np.array([65535]), np.array([15]), dtype=jnp.float64)
    words = [int.from_bytes(np.asarray(step)[::-1].tobytes(), "little") for step in sequences.roberts().steps]
    expected = [((2**36 - 1) * word % 2**96 >> 64) / 2**32 for word in words]
    assert np.asarray(point)[0].tolist() == expected
    assert sequences.owen(sequences.roberts(), 1).dims == 2


def test_steps_of_arrays_of_jax():
    steps = jnp.asarray([0.5, 0.75])
    assert np.array_equal(sequences.kronecker(steps).points(4), sequences.kronecker([0.5, 0.75]).points(4))


def test_traced_steps_are_refused():
    with pytest.raises(TypeError, match="steps must be numbers"):
        jax.jit(lambda x: sequences.kronecker([x]).steps)(0.5)

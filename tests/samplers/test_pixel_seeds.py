"""Seeds of pixels: as many are equal as of random words, and their places have no pattern."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import samplers, sequences
from qmcjax.bridges._padding import padding_pixel
from qmcjax.core.bits import hash_pair

SIDE = 1024
Y, X = (axis.ravel() for axis in np.indices((SIDE, SIDE), np.uint32))
KEYS = [range(5, 6), pytest.param(range(24), marks=pytest.mark.slow)]


def independent(key):
    return samplers.independent(sequences.sobol(2), key)


@partial(jax.jit, static_argnums=1)
def prepared(sampler, dims):
    return sampler.prepare(X, Y, dims)


def two(sampler, dims):
    return np.concatenate(prepared(sampler, dims))


def of_passes(key):
    passes = samplers.randomized(independent, key, 1)
    return np.concatenate([two(passes.of_pass(k), (1,)) for k in (0, 1)])


SETS = {
    "pixels": lambda key: two(independent(key), (0,)),
    "pixels and coordinates": lambda key: two(independent(key), (0, 1)),
    "pixels and passes": of_passes,
    "pixels of Mitsuba's other pairs": lambda key: np.asarray(
        jax.jit(padding_pixel)(jax.random.bits(jax.random.key(key), (2,)), X, Y)
    ),
}


def equal(words):
    """Return the places of equal words that come next to each other when sorted."""
    packed = np.sort(words.astype(np.uint64) << 32 | np.arange(len(words), dtype=np.uint64))
    same = np.flatnonzero(packed[1:] >> 32 == packed[:-1] >> 32)
    return (packed & 0xFFFFFFFF).astype(np.int64)[same], (packed & 0xFFFFFFFF).astype(np.int64)[same + 1]


def off(counts, n):
    """Return how many deviations the mean is off that of random words, and variance over mean."""
    mean = n * (n - 1) / 2 / 2**32
    return (np.mean(counts) - mean) / np.sqrt(mean / len(counts)), np.mean(np.square(counts - mean)) / mean


@pytest.mark.parametrize("keys", KEYS, ids=["one", "many"])
@pytest.mark.parametrize("name", SETS)
def test_counts_of_equal_seeds_are_those_of_random_words(name, keys):
    """Poisson's distribution over the keys; equal seeds do not line up in rows or columns."""
    counts = []
    for key in keys:
        words = SETS[name](key)
        one, other = equal(words)
        counts.append(len(one))
        # Not those of pixels with copies of themselves, e.g. 786 of two columns.
        for place in (X, Y):
            lines = place[one % X.size].astype(np.int64) * SIDE + place[other % X.size]
            assert np.unique(lines, return_counts=True)[1].max() < 8
    deviations, ratio = off(np.array(counts), len(words))
    assert abs(deviations) < 5
    # Of independent Poisson counts, the ratio is 1 with deviations sqrt(2 / keys).
    assert ratio < 1 + 5 * np.sqrt(2 / len(keys))


def test_a_pair_is_mixed_by_bijections_and_its_order_counts():
    numbers = np.arange(2**16, dtype=np.uint32)
    for one, other in ((numbers, np.uint32(7)), (np.uint32(7), numbers)):
        assert len(np.unique(hash_pair(jnp.asarray(one), jnp.asarray(other)))) == 2**16
    assert not np.any(np.asarray(hash_pair(X, Y)) == np.asarray(hash_pair(Y, X)), where=X != Y)

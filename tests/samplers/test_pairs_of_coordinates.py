"""First coordinates of different pairs, over a whole image: independent, or off by what docstrings say."""

import jax
import numpy as np
import pytest

from figures.shared.rendered import padded_samplers
from qmcjax import samplers
from qmcjax.bridges.mitsuba._padded_pairs import PaddedPairs

SIDE, SPP, BINS = 256, 4, 32
Y, X = (axis.ravel() for axis in np.indices((SIDE, SIDE), np.uint32))
SIZES = (2, 2, 2)


def z(variant):
    # An int would be the same dimension d for all first pairs of "multiplicative".
    return lambda key: samplers.z(SIDE, SIDE, SPP, jax.random.key(key), variant, dims=6)


INDEPENDENT = {
    "z, hash": z("hash"),
    "z, tree": z("tree"),
    "(0,2)-sequences": lambda key: padded_samplers.zero_two(SIZES, key, key + 100, 2),
}
TABULATED = {
    "z, multiplicative": z("multiplicative"),
    "z, art": z("art"),
    "ranked, padded": lambda key: padded_samplers.ranked(SIZES, key),
}


def slow_but(quick, names):
    return [pytest.param(name, marks=() if name == quick else pytest.mark.slow) for name in names]


@jax.jit
def first_coordinates(sampler, sample):
    return sampler(X, Y, sample, (0, 2, 4))


def chi_squared(points):
    """Return chi-squared over its mean, for any two of some coordinates."""
    cells = (points * BINS).astype(int)
    expected, results = len(points) / BINS**2, []
    for one, other in ((0, 1), (0, 2), (1, 2)):
        found = np.bincount(cells[:, one] * BINS + cells[:, other], minlength=BINS**2)
        results.append(((found - expected) ** 2 / expected).sum() / (BINS**2 - 1))
    return np.array(results)


def of_sampler(sampler):
    samples = np.arange(SPP, dtype=np.uint32)
    return chi_squared(np.concatenate([np.asarray(first_coordinates(sampler, s)) for s in samples]))


# Nested digits let the statistic scatter by up to three times what that of random points does, 0.044.
BOUND = 15 * np.sqrt(2 / (BINS**2 - 1))
KEYS = [range(2), pytest.param(range(2, 16), marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize("keys", KEYS, ids=["few", "many"])
@pytest.mark.parametrize("name", INDEPENDENT)
def test_pairs_are_as_uniform_together_as_random_points(name, keys):
    for key in keys:
        assert np.abs(of_sampler(INDEPENDENT[name](key)) - 1).max() < BOUND


@pytest.mark.parametrize("name", slow_but("z, art", TABULATED))
def test_pairs_that_share_a_table_are_as_uniform_as_fewer_pixels(name):
    """Of 4096 letters or a tile of 4096 pixels: chi-squared is at most 1 + pixels / 4096 times its mean."""
    results = np.concatenate([of_sampler(TABULATED[name](key)) for key in (0, 1)]) - 1
    assert results.max() > BOUND
    assert results.max() < SIDE**2 / 4096


@pytest.mark.slow
def test_pairs_beyond_those_of_a_sampler_are_independent():
    """Those that Mitsuba's plug-in adds."""
    for key in range(2):
        padded = PaddedPairs(samplers.z(SIDE, SIDE, SPP, key), jax.random.key(key))
        x, y, sample = (np.tile(X, SPP), np.tile(Y, SPP), np.repeat(np.arange(SPP, dtype=np.uint32), X.size))
        first = [padded.coordinates(padded.group(pair), x, y, sample)[0] for pair in (0, 1, 2)]
        assert np.abs(chi_squared(np.stack(first, -1)) - 1).max() < BOUND

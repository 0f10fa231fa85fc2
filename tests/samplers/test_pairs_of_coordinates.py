"""Pairs of coordinates: nets, and independent of each other, or off by what docstrings say."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import few

import analysis
from figures.shared.rendered import padded_samplers
from qmcjax import samplers
from qmcjax.bridges._padding import Padding

SIDE, SPP, BINS = 256, 4, 32
Y, X = (axis.ravel() for axis in np.indices((SIDE, SIDE), np.uint32))
SIZES = (2, 2, 2)
# Nested digits let the statistic scatter by up to three times what that of random points does, 0.044.
BOUND = 15 * np.sqrt(2 / (BINS**2 - 1))

TABULATED = {
    # An int would be the same dimension d for all first pairs of "multiplicative".
    "multiplicative": lambda key: samplers.z(SIDE, SIDE, SPP, jax.random.key(key), "multiplicative", dims=6),
    "art": lambda key: samplers.z(SIDE, SIDE, SPP, jax.random.key(key), "art", dims=6),
    "ranked, padded": lambda key: padded_samplers.ranked(SIZES, key),
}


@jax.jit
def first_coordinates(sampler, sample):
    return sampler(X, Y, sample, (0, 2, 4))


def chi_squared(points):
    """Return chi-squared over its mean, less 1, for any two of three coordinates."""
    cells = (points * BINS).astype(int)
    expected, results = len(points) / BINS**2, []
    for one, other in ((0, 1), (0, 2), (1, 2)):
        found = np.bincount(cells[:, one] * BINS + cells[:, other], minlength=BINS**2)
        results.append(((found - expected) ** 2 / expected).sum() / (BINS**2 - 1))
    return np.array(results) - 1


def of_sampler(sampler):
    samples = np.arange(SPP, dtype=np.uint32)
    return chi_squared(np.concatenate([np.asarray(first_coordinates(sampler, s)) for s in samples]))


@pytest.mark.parametrize("name", few(TABULATED, "art"))
def test_pairs_that_share_a_table_are_as_uniform_as_fewer_pixels(name):
    """Of 4096 letters or a tile of 4096 pixels: chi-squared is at most 1 + pixels / 4096 times its mean."""
    results = np.concatenate([of_sampler(TABULATED[name](key)) for key in (0, 1)])
    assert BOUND < results.max() < SIDE**2 / 4096


@pytest.mark.slow
def test_pairs_beyond_those_of_a_sampler_are_independent():
    """Those that Mitsuba's plug-in adds."""
    for key in range(2):
        words = jax.random.bits(jax.random.key(key), (2,))
        y, x, sample = (jnp.asarray(axis, jnp.uint32) for axis in np.ogrid[:SIDE, :SIDE, :SPP])
        own = samplers.z(SIDE, SIDE, SPP, key)(x, y, sample, (0,))
        beyond = Padding(words, jnp.uint32(1))(x, y, sample, (0, 1, 2, 3), jnp.float32)[..., ::2]
        first = np.moveaxis(np.concatenate([own, beyond], axis=-1), 2, 0).reshape(-1, 3)
        assert np.abs(chi_squared(first)).max() < BOUND


PIXELS, SAMPLES, DIMS = 64, 16, 5


@pytest.mark.parametrize(
    "make",
    [lambda sizes: padded_samplers.zero_two(sizes, 3, 4), lambda sizes: padded_samplers.ranked(sizes, 3)],
    ids=["(0,2)", "ranked"],
)
def test_pairs_are_nets(make):
    """Every pair of dimensions of a pixel's 2**m first samples is a (0,m,2)-net."""
    rows = np.arange(4, dtype=np.uint32)[:, None]
    points = np.asarray(make(padded_samplers.pairs(DIMS))(7, rows, np.arange(SAMPLES), (0, 1, 2, 3)))
    for of_pixel in points:
        for pair in (of_pixel[:, :2], of_pixel[:, 2:]):
            assert analysis.t_value(pair) == 0


def test_pairs_of_the_shuffled_sampler_are_in_orders_of_their_own():
    """Products of coordinates of two pairs have the mean 1/4, within five standard errors over the pixels."""
    x = np.arange(PIXELS**2, dtype=np.uint32)
    sampler = padded_samplers.zero_two(padded_samplers.pairs(DIMS), 3, 4)
    points = np.asarray(sampler(x[:, None], 5, np.arange(SAMPLES), tuple(range(DIMS))), float)
    for one, other in ((0, 2), (1, 3), (2, 4)):
        means = np.mean(points[..., one] * points[..., other], axis=1)
        assert abs(means.mean() - 0.25) < 5 * means.std() / np.sqrt(len(means))
        # Where the orders are the same, or the pairs the same points, a pixel's mean varies much more.
        assert means.std() < 0.05

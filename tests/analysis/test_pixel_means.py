"""Errors of one integrand in every pixel, and what an eye sees of them."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import SAMPLERS, SIDE, SPP, first

import analysis
from qmcjax import orders, samplers, sequences


def product(point):
    return point[..., 0] * point[..., 1]


def zeros(side):
    return np.zeros((side, side))


@pytest.mark.parametrize(
    "name",
    [
        "z, hash",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("randomized, contiguous, owen", "shifted, hilbert, lattice")
        ),
    ],
)
def test_the_mean_is_that_of_the_samples(name):
    sampler = SAMPLERS[name]
    dims = (1, 2) if sampler.dims > 2 else (1, 0)
    y, x, sample = np.meshgrid(first(SIDE), first(SIDE), first(SPP), indexing="ij")
    drawn = jax.jit(lambda sampler, *where: sampler(*where, dims))
    points = np.asarray(drawn(sampler, x, y, sample), np.float64)
    means = analysis.pixel_means(product, sampler, SIDE, SIDE, SPP, dims)
    np.testing.assert_allclose(means, product(points).mean(axis=2), rtol=0, atol=2e-7)


def test_values_of_several_functions_and_of_float64():
    sampler = samplers.z(8, 4, 16, key=3)
    values = analysis.pixel_means(lambda p: p, sampler, 8, 4, 16, dtype=jnp.float64)
    assert values.shape == (4, 8, 2)
    assert values.dtype == jnp.float64
    # 16 points of a net in each pixel: k/16 + less than 1/16, each once.
    assert np.all(np.abs(np.asarray(values) - 0.5) <= 1 / 32)


def test_low_frequencies_of_waves_and_of_noise():
    x = np.arange(64)
    low, high = (np.broadcast_to(np.cos(2 * np.pi * c * x / 64), (64, 64)) for c in (3, 4))
    assert analysis.low_frequency_power(high, zeros(64)) < 1e-20
    # All power, 64**2, is in two of the frequencies of annulus 3, one of three annuli.
    radius = np.hypot(*np.meshgrid(*[np.fft.fftfreq(64, 1 / 64)] * 2))
    count = np.sum((radius >= 2.5) & (radius < 3.5))
    assert analysis.low_frequency_power(low, zeros(64)) == pytest.approx(64**2 / count / 3)
    noise = np.random.default_rng(1).normal(size=(40, 128, 128))
    powers = [analysis.low_frequency_power(image, zeros(128)) for image in noise]
    assert abs(np.mean(powers) - 1) < 5 * np.std(powers) / np.sqrt(len(powers))


def along(order, components):
    curve = sequences.components(sequences.halton(3), components)
    return lambda spp: samplers.contiguous(order(256, 256), curve, spp)


def measures(sampler, spp):
    image = np.asarray(analysis.pixel_means(product, sampler, 256, 256, spp), np.float64)
    exact = np.full((256, 256), 0.25)
    error = np.sqrt(np.mean((image - 0.25) ** 2))
    return error, analysis.low_frequency_power(image, exact), analysis.filtered_error(image, exact)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "spp", "expected", "low_margin", "margin"),
    [
        (lambda spp: samplers.z(256, 256, spp, None, "plain"), 1, (0.2205, 0.037, 0.0159), 0.005, 0.01),
        (lambda spp: samplers.z(256, 256, spp, key=1), 1, (0.2205, 0.046, 0.0201), 0.01, 0.03),
        (lambda spp: samplers.z(256, 256, spp, key=1), 4, (0.0536, 0.052, 0.0049), 0.015, 0.03),
        (along(orders.hilbert, (0, 1)), 1, (0.2205, 0.012, 0.0127), 0.002, 0.01),
        (along(orders.hilbert, (0, 1)), 4, (0.0623, 0.011, 0.0034), 0.002, 0.01),
        (along(orders.hilbert, (1, 2)), 1, (0.2205, 0.037, 0.0184), 0.005, 0.01),
    ],
)
def test_methods_that_diffuse_the_error(make, spp, expected, low_margin, margin):
    """RMS error, power at low frequencies and filtered error, against measurements with plain numpy."""
    error, low, filtered = measures(make(spp), spp)
    assert error == pytest.approx(expected[0], rel=2e-3)
    assert abs(low - expected[1]) < low_margin
    assert filtered == pytest.approx(expected[2], rel=margin)


@pytest.mark.slow
@pytest.mark.parametrize("spp", [1, 4])
@pytest.mark.parametrize(
    "make",
    [
        lambda spp, key: samplers.contiguous(orders.raster(256, 256), sequences.uniform(2, key), spp),
        lambda spp, key: samplers.independent(sequences.sobol(2), key, "xor"),
    ],
    ids=["random", "(0,2), xor"],
)
def test_methods_that_do_not(make, spp):
    """The power of one image has a standard deviation of 0.068: 0.1 is 5.9 times that of 16 images."""
    measured = np.array([measures(make(spp, key), spp) for key in range(16)])
    assert abs(np.mean(measured[:, 1]) - 1) < 0.1
    assert 0.068 * 0.1 < np.std(measured[:, 1]) < 0.068 * 1.9
    # White noise keeps 1 / (4 pi sigma**2) of its variance.
    np.testing.assert_allclose(measured[:, 2] / measured[:, 0], 0.5 / np.sqrt(np.pi) / 1.5, rtol=0.05)


@pytest.mark.parametrize("sigma", [0.1, 0.39, 0.41, 1.5, 4.0, 1000.0])
@pytest.mark.parametrize(("across", "down"), [(0, 0), (1, 0), (8, 0), (16, 16), (3, 5)])
def test_a_wave_is_weighted_by_the_filters_transfer(across, down, sigma):
    """Against the sum over the weights of all pixels, in as many digits as their rounding leaves."""
    y, x = np.mgrid[:32, :32]
    wave = np.cos(2 * np.pi * (across * x + down * y) / 32)
    pixels = np.arange(-(2**14), 2**14 + 1)
    weights = np.exp(-((pixels / sigma) ** 2) / 2)
    weights /= weights.sum()
    transfer = [weights @ np.cos(2 * np.pi * f / 32 * pixels) for f in (across, down)]
    expected = math.prod(transfer) * np.sqrt(np.mean(wave**2))
    assert analysis.filtered_error(wave, zeros(32), sigma) == pytest.approx(expected, rel=1e-12, abs=1e-15)


test_bad_input_is_named = refused(
    (
        lambda: analysis.pixel_means(product, samplers.z(4, 4, 2, 1), 4, 4, 4),
        "spp must be at most 2 .* got 4",
    ),
    (lambda: analysis.filtered_error(zeros(4) + np.nan, zeros(4)), "must be finite"),
    (lambda: analysis.low_frequency_power(np.eye(8), zeros(8), 0.05), "cutoff must be .* got 0.05"),
)

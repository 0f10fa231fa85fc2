import itertools
import math

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

from analysis import error_spectrum, mean_spectrum, radial_anisotropy, radial_average

SIZES = [(8, 8), (7, 7), (6, 9), (10, 4), (1, 12), (5, 1), (2, 2)]


def noise(*shape, seed=1):
    return np.random.default_rng(seed).normal(size=shape)


def direct_spectrum(error):
    """Follow the definition, frequency by frequency."""
    height, width = error.shape
    y, x = np.mgrid[:height, :width]
    centred = error - error.mean()
    power = np.empty((height, width))
    for v, u in itertools.product(range(height), range(width)):
        power[v, u] = abs(np.sum(centred * np.exp(-2j * np.pi * (u * x / width + v * y / height)))) ** 2
    return power / (error.size * error.var())


@pytest.mark.parametrize("size", SIZES)
def test_definition(size):
    image, reference = noise(*size), noise(*size, seed=2)
    spectrum = error_spectrum(image, reference)
    assert spectrum.dtype == np.float64
    np.testing.assert_allclose(spectrum, direct_spectrum(image - reference), rtol=1e-10, atol=1e-12)
    assert spectrum.mean() == pytest.approx(1, rel=1e-12)
    assert spectrum[0, 0] == 0


def test_waves():
    """A cosine of 3 periods in x and 2 in y is at (2, 3) and (-2, -3), half of N at each."""
    y, x = np.mgrid[:16, :24]
    image = 0.5 + 0.1 * np.cos(2 * np.pi * (3 * x / 24 + 2 * y / 16) + 1)
    spectrum = error_spectrum(jnp.asarray(image, jnp.float32), np.zeros((16, 24)))
    expected = np.zeros((16, 24))
    expected[2, 3] = expected[-2, -3] = 16 * 24 / 2
    np.testing.assert_allclose(spectrum, expected, atol=1e-4)


def test_white_noise_is_one():
    """Power is exponential with mean 1, independent in one half plane: 5 sigma in each annulus."""
    frequency, power = radial_average(error_spectrum(noise(128, 128), np.zeros((128, 128))))
    count = radial_counts(128, 128)
    sigma = np.sqrt(2 / count)
    assert len(frequency) == 64
    assert np.all(np.abs(power - 1) < 5 * sigma)


def test_channels_are_weighted_by_their_power():
    red, green, zero = noise(6, 8), 3 * noise(6, 8, seed=2), np.zeros((6, 8))
    image = np.stack([red, green, zero + 0.25], axis=-1)
    spectrum = error_spectrum(image, np.zeros_like(image))
    weighted = red.var() * error_spectrum(red, zero) + green.var() * error_spectrum(green, zero)
    np.testing.assert_allclose(spectrum, weighted / (red.var() + green.var()), rtol=1e-10, atol=1e-12)
    assert spectrum.shape == (6, 8)


def annuli(height, width):
    """Sort frequencies into annuli by comparing squares, times (2 h w)^2, in integers."""
    longer = max(height, width)
    table = {}
    for v, u in itertools.product(range(height), range(width)):
        fy, fx = min(v, height - v), min(u, width - u)
        square = (2 * longer) ** 2 * ((fy * width) ** 2 + (fx * height) ** 2)
        scale = height * width
        k = next(k for k in itertools.count() if square < ((2 * k + 1) * scale) ** 2)
        table.setdefault(k, []).append((v, u))
    return table


def radial_counts(height, width):
    table = annuli(height, width)
    return np.array([len(table[k]) for k in range(1, max(height, width) // 2 + 1)])


@pytest.mark.parametrize("size", [*SIZES, (64, 64), (49, 49), (49, 30), (12, 18)])
def test_radial_average_and_anisotropy_by_exact_annuli(size):
    spectrum = noise(*size) ** 2
    frequency, power = radial_average(spectrum)
    table = annuli(*size)
    np.testing.assert_array_equal(frequency, np.arange(1, max(size) // 2 + 1))
    expected = [math.fsum(spectrum[place] for place in table[k]) / len(table[k]) for k in frequency]
    np.testing.assert_allclose(power, expected, rtol=1e-12)
    assert frequency.dtype == power.dtype == np.float64
    same, anisotropy = radial_anisotropy(spectrum)
    np.testing.assert_array_equal(same, frequency)
    for k, found in zip(frequency, anisotropy, strict=True):
        values = np.array([spectrum[place] for place in table[k]])
        if len(values) == 1:
            assert np.isnan(found)
        else:
            assert found == pytest.approx(10 * np.log10(values.var(ddof=1) / values.mean() ** 2), abs=1e-9)


test_bad_errors = refused(
    (np.full((4, 4), 0.1), np.zeros((4, 4)), "more than a constant.*0.1"),
    (np.full((4, 4, 3), [0.1, 0.2, 0.3]), np.zeros((4, 4, 3)), "more than a constant.*0.3"),
    call=error_spectrum,
    error=ValueError,
)


def test_anisotropy_of_known_spectra():
    """1 + cos(2 phi) varies by 1/2, -3 dB; a constant by nothing; exponential noise by 1, 0 dB."""
    k = np.fft.fftfreq(129)
    angle = np.arctan2(k[:, None], k)
    waves = radial_anisotropy(1 + np.cos(2 * angle))[1][20:]
    assert waves == pytest.approx(10 * np.log10(0.5), abs=0.4)
    assert waves.mean() == pytest.approx(10 * np.log10(0.5), abs=0.02)
    assert (radial_anisotropy(np.full((8, 8), 3.0))[1] == -np.inf).all()
    assert np.isnan(radial_anisotropy(np.zeros((8, 8)))[1]).all()
    white = radial_anisotropy(error_spectrum(noise(256, 256), np.zeros((256, 256))))[1]
    assert abs(white[20:].mean()) < 5 * white[20:].std() / np.sqrt(len(white) - 20)
    scaled = radial_anisotropy(1e-8 * (1 + np.cos(2 * angle)))[1]
    np.testing.assert_allclose(scaled, radial_anisotropy(1 + np.cos(2 * angle))[1], rtol=1e-9)


def test_mean_over_keys():
    """The sample's mean and deviation, of large numbers too; 5 sigma for white noise."""
    made = 1e6 + noise(9, 3, 4)
    mean, error = mean_spectrum(lambda key: made[key], iter(range(9)))
    np.testing.assert_allclose(mean, made.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(error, made.std(axis=0, ddof=1) / 3, rtol=1e-8)
    assert mean.dtype == error.dtype == np.float64
    mean, error = mean_spectrum(
        lambda key: radial_average(error_spectrum(noise(32, 32, seed=key), np.zeros((32, 32))))[1], range(40)
    )
    assert (np.abs(mean - 1) < 5 * error).all()
    assert (error < 0.1).all()


test_bad_keys = refused(
    ([], "keys.*0"),
    ([1], "keys.*1"),
    ([2, 3], r"make.*\(2,\).*\(3,\)"),
    call=lambda keys: mean_spectrum(np.ones, keys),
    error=ValueError,
)

"""Spectra of points and of errors."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

from analysis import error_spectrum, mean_spectrum, point_spectrum, radial_anisotropy, radial_average
from analysis._spectra import point_spectrum as _point_spectrum
from analysis._spectra.point_spectrum import direct_sums, fast_sums

METHODS = ["direct", "fft"]


def random_points(n, dims=2, seed=1):
    return np.random.default_rng(seed).random((n, dims))


def frequencies(resolution, dims):
    """Return k in the layout of fft2: arrays of k_x, k_y(, k_z), where x is the last axis."""
    k = np.rint(np.fft.fftfreq(resolution) * resolution)
    return np.meshgrid(*[k] * dims, indexing="ij")[::-1]


def brute_force(points, resolution):
    """Add up wave by wave, the angles in twice the precision."""
    k = [f.astype(np.longdouble) for f in frequencies(resolution, points.shape[1])]
    sums = np.zeros(k[0].shape, np.clongdouble)
    for point in points.astype(np.longdouble):
        turns = sum(f * x for f, x in zip(k, point, strict=True))
        angle = 2 * np.longdouble(np.pi) * (turns - np.rint(turns))
        sums += np.cos(angle) - 1j * np.sin(angle)
    return (np.abs(sums) ** 2 / len(points)).astype(np.float64)


CLUSTER = np.concatenate([random_points(7), np.full((20, 2), 1 - 2.0**-53), np.zeros((10, 2))])
SETS = [(random_points(37), 10), (random_points(37), 9), (CLUSTER, 9), (random_points(37, 3), 6)]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("points", "resolution"), SETS)
def test_definition(points, resolution, method):
    """Equal to rounding errors, or to twice the stated error of the sums, 1e-11 n, times their size."""
    n = len(points)
    spectrum = point_spectrum(points, resolution, method)
    assert spectrum.dtype == np.float64
    tolerance = 1e-13 if method == "direct" else 2e-11 * n
    np.testing.assert_allclose(spectrum, brute_force(points, resolution), rtol=0, atol=tolerance)
    assert spectrum.ravel()[0] == pytest.approx(n, rel=1e-11)


def test_large_frequencies_lose_nothing():
    """At k = 4095 the angles are as precise as at 1: rounding k x would give errors near 1e-12."""
    x = random_points(50, 1)
    with jax.enable_x64(True):
        sums = np.asarray(jax.jit(direct_sums, static_argnums=1)(jnp.asarray(x), 4095))
    k = np.arange(4096).astype(np.longdouble)
    turns = k[:, None] * x[:, 0].astype(np.longdouble)
    angle = 2 * np.longdouble(np.pi) * (turns - np.rint(turns))
    exact = (np.cos(angle) - 1j * np.sin(angle)).sum(axis=1)
    assert np.abs(sums - exact).max() < 4e-14


def test_fft_keeps_its_stated_accuracy():
    """For one point all sums have modulus 1: the largest error over points is the error per n."""
    with jax.enable_x64(True):
        points = jnp.asarray(random_points(300, 1))[:, None]
        fast, direct = jax.jit(jax.vmap(lambda x: (fast_sums(x, 16), direct_sums(x, 16))))(points)
        assert 1e-14 < np.abs(np.asarray(fast) - np.asarray(direct)).max() < 5e-12


def test_size_decides_on_the_method(monkeypatch):
    """Few frequencies or few points: the direct sum."""
    monkeypatch.setattr(_point_spectrum, "_measure", lambda p, resolution, fast, dtype: fast)
    sizes = (10, 256), (4096, 16), (4096, 128)
    assert [point_spectrum(np.zeros((n, 2)), resolution) for n, resolution in sizes] == [False, False, True]


@pytest.mark.parametrize(("method", "width"), [("direct", 14), ("fft", 14**2)])
def test_batches(monkeypatch, method, width):
    """Three batches, two places of the last one empty, give what one batch gives."""
    monkeypatch.setattr("analysis._spectra.point_spectrum._BATCH", width * 13)
    sums = fast_sums if method == "fft" else direct_sums
    with jax.enable_x64(True):
        parts = jax.jit(lambda p: sums(p, 4))(jnp.asarray(random_points(37)))
        power = np.asarray(_point_spectrum._power(parts, 37, 9))
    np.testing.assert_allclose(power, point_spectrum(random_points(37), 9, method), rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_gradient(method):
    """Against central differences of a weighted sum, to 1e-6, in float32 too; on the FFT's grid as well."""
    points = random_points(37).astype(np.float32).astype(np.float64)
    points[:3] = [[0, 0.5], [0.25, 0.125], [0.25, 0.125]]
    weights = np.random.default_rng(3).normal(size=(9, 9))

    def weighted(points):
        return jnp.sum(weights.astype(points.dtype) * point_spectrum(points, 9, method))

    with jax.enable_x64(True):
        gradient = np.asarray(jax.jit(jax.grad(weighted))(points))
    expected = np.zeros_like(points)
    for place in [*np.ndindex(12, 2)]:
        step = np.zeros_like(points)
        step[place] = 1e-5
        change = brute_force(points + step, 9) - brute_force(points - step, 9)
        expected[place] = np.sum(weights * change) / 2e-5
    largest = np.abs(expected).max()
    assert gradient.dtype == np.float64
    np.testing.assert_allclose(gradient[:12], expected[:12], rtol=0, atol=1e-6 * largest)
    narrow = jax.jit(jax.grad(weighted))(points.astype(np.float32))
    assert narrow.dtype == jnp.float32
    np.testing.assert_allclose(narrow, gradient, rtol=0, atol=3e-7 * largest)


@pytest.mark.slow
def test_gradients_in_space():
    """Both methods: one is written by hand, the other differentiated by JAX."""
    weights = np.random.default_rng(3).normal(size=(6, 6, 6))

    def weighted(points, method):
        return jnp.sum(weights * point_spectrum(points, 6, method))

    with jax.enable_x64(True):
        points = jnp.asarray(random_points(37, 3))
        gradient = jax.jit(jax.grad(weighted), static_argnums=1)
        direct, fast = (np.asarray(gradient(points, method)) for method in METHODS)
    np.testing.assert_allclose(direct, fast, rtol=0, atol=1e-8 * np.abs(fast).max())


def test_transformations():
    """One program per shape; jit of vmap equals the loop, rounded to float32."""
    sets = jnp.asarray(np.stack([random_points(37, seed=s) for s in range(3)]), jnp.float32)
    point_spectrum(sets[0], 9, "direct")
    before = _point_spectrum._sums._cache_size()
    eager = np.stack([point_spectrum(points, 9, "direct") for points in sets])
    assert _point_spectrum._sums._cache_size() == before
    mapped = jax.jit(jax.vmap(lambda points: point_spectrum(points, 9, "direct")))(sets)
    assert eager.dtype == np.float64
    assert mapped.dtype == jnp.float32
    np.testing.assert_array_equal(mapped, eager.astype(np.float32))


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_memory_is_that_of_points_and_spectrum(method):
    """Of value and gradient: far less than the 8 n resolution bytes of the waves, or kernel values."""
    n, resolution = 2**18, 65
    with jax.enable_x64(True):
        points = jax.ShapeDtypeStruct((n, 2), jnp.float64)
        total = jax.grad(lambda p: jnp.sum(point_spectrum(p, resolution, method)))
        memory = jax.jit(total).lower(points).compile().memory_analysis()
    assert memory.temp_size_in_bytes < 2**27 < 16 * n * resolution


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dims", [2, 3])
def test_many_points_are_not_copied(method, dims):
    """For a number of points that batches need not fill."""
    with jax.enable_x64(True):
        points = jax.ShapeDtypeStruct((2**23 - 5, dims), jnp.float64)
        program = _point_spectrum._sums.lower(points, 17, method == "fft").compile()
    assert program.memory_analysis().temp_size_in_bytes < 2 * 8 * dims * 2**23


FAR = np.zeros((4, 3)), 257, None, r"resolution.*\[2, 256\].*257"
test_bad_arguments = refused((np.zeros((4, 4)), 8, None, "points.*d=4"), FAR, call=point_spectrum)


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
def test_definition_of_error_spectra(size):
    image, reference = noise(*size), noise(*size, seed=2)
    spectrum = error_spectrum(image, reference)
    assert spectrum.dtype == np.float64
    np.testing.assert_allclose(spectrum, direct_spectrum(image - reference), rtol=1e-10, atol=1e-12)
    assert spectrum.mean() == pytest.approx(1, rel=1e-12)
    assert spectrum[0, 0] == 0


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
    """1 + cos(2 phi) varies by 1/2, -3 dB, at any scale; a constant by nothing."""
    k = np.fft.fftfreq(129)
    wave = 1 + np.cos(2 * np.arctan2(k[:, None], k))
    found = radial_anisotropy(wave)[1]
    assert found[20:] == pytest.approx(10 * np.log10(0.5), abs=0.4)
    np.testing.assert_allclose(radial_anisotropy(1e-8 * wave)[1], found, rtol=1e-9)
    assert (radial_anisotropy(np.full((8, 8), 3.0))[1] == -np.inf).all()
    assert np.isnan(radial_anisotropy(np.zeros((8, 8)))[1]).all()


def test_mean_over_keys():
    """The sample's mean and deviation, of large numbers too."""
    made = 1e6 + noise(9, 3, 4)
    mean, error = mean_spectrum(lambda key: made[key], iter(range(9)))
    np.testing.assert_allclose(mean, made.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(error, made.std(axis=0, ddof=1) / 3, rtol=1e-8)
    assert mean.dtype == error.dtype == np.float64


BAD_KEYS = ([], "keys.*0"), ([1], "keys.*1"), ([2, 3], r"make.*\(2,\).*\(3,\)")
test_bad_keys = refused(*BAD_KEYS, call=lambda keys: mean_spectrum(np.ones, keys), error=ValueError)

"""Errors after filters in space and time, to an eye at a distance, and of one integrand in every pixel."""

import math
import sys
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.signal import lfilter
from tables import SAMPLERS, SIDE, SPP, first, slow

import analysis
from analysis import error_spectrum, filtered_error, flip, moving_average, quantile_error, relative_error
from qmcjax import samplers

NOTHING = np.zeros((64, 64))


def mannos_sakrison(f):
    """Return the sensitivity of IEEE Trans. Inf. Theory 20(4), relative to the best of a fine grid."""
    grid = np.linspace(0, 60, 600_001)

    def band(f):
        return 2.6 * (0.0192 + 0.114 * f) * np.exp(-((0.114 * f) ** 1.1))

    best = grid[np.argmax(band(grid))]
    return band(max(f, best)) / band(best)


@pytest.mark.parametrize("across", [0, 1, 5, 32])
@pytest.mark.parametrize("down", [0, 3])
@pytest.mark.parametrize("distance", [500.0, 2000.0, 8000.0])
def test_a_wave_is_weighted_by_the_sensitivity_to_its_frequency(across, down, distance):
    y, x = np.mgrid[:64, :64]
    wave = np.cos(2 * np.pi * (across * x + down * y) / 64)
    f = np.hypot(across, down) / 64 * distance * np.pi / 180
    expected = mannos_sakrison(f) * np.sqrt(np.mean(wave**2))
    assert analysis.perceived_error(0.5 + wave, NOTHING + 0.5, distance) == pytest.approx(expected, rel=1e-3)


def test_from_nearby_the_whole_error_is_seen_and_from_afar_its_mean():
    noise = np.random.default_rng(0).random((64, 32, 3))
    reference = np.zeros_like(noise)
    assert analysis.perceived_error(noise, reference, 1e-3) == pytest.approx(np.sqrt(np.mean(noise**2)))
    means = noise.mean(axis=(0, 1))
    assert analysis.perceived_error(noise, reference, 1e6) == pytest.approx(np.sqrt(np.mean(means**2)))
    distances = [100, 1000, 2000, 4000]
    errors = [analysis.perceived_error(noise - means, reference, d) for d in distances]
    assert errors == sorted(errors, reverse=True)


FRAMES = np.random.default_rng(1).normal(size=(24, 6, 8)) + 0.3
ZERO = np.zeros_like(FRAMES)


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def remembered(alpha):
    """Run the recursion of a moving average over many rounds, and take the last."""
    rounds = np.concatenate([FRAMES] * 60)
    return lfilter([alpha], [1, alpha - 1], rounds, axis=0)[-len(FRAMES) :]


TIMES = {
    "none": (0.0, FRAMES),
    "Gaussian": (1.5, gaussian_filter1d(FRAMES, 1.5, axis=0, mode="wrap", truncate=12)),
    "2 frames": (np.ones(2), uniform_filter1d(FRAMES, 2, axis=0, mode="wrap")),
    "8 frames": (np.ones(8), uniform_filter1d(FRAMES, 8, axis=0, mode="wrap")),
    "more frames than there are": (np.ones(48), np.broadcast_to(FRAMES.mean(axis=0), FRAMES.shape)),
    "moving average": (moving_average(0.1), remembered(0.1)),
    "long moving average": (moving_average(0.03), remembered(0.03)),
    "no memory": (moving_average(1), FRAMES),
}


@pytest.mark.parametrize("name", TIMES)
def test_filters_in_time_are_scipys(name):
    time, expected = TIMES[name]
    found = filtered_error(FRAMES, ZERO, sigma=0, time=time)
    assert found == pytest.approx(rms(expected), rel=1e-12)
    both = filtered_error(FRAMES, ZERO, 0.8, time)
    spread = [filtered_error(frame, np.zeros((6, 8)), 0.8) for frame in expected]
    assert both == pytest.approx(rms(spread), rel=1e-12)


@pytest.mark.parametrize("alpha", [1.0, 0.5, 0.1, 0.01])
def test_taps_are_those_of_the_recursion(alpha):
    taps = moving_average(alpha)
    impulse = np.zeros(len(taps))
    impulse[0] = 1
    np.testing.assert_allclose(taps, lfilter([alpha], [1, alpha - 1], impulse), rtol=1e-10)
    # 1 - alpha rounds by 2**-54, each power and product by a few 2**-53 of itself.
    assert abs(1 - math.fsum(taps)) <= 2**-53 * (0.5 / alpha + 6)
    assert len(taps) <= 1 + 37 / alpha and Fraction(1 - alpha) ** len(taps) <= Fraction(1, 2**53)


KEPT = [(moving_average(0.1), np.sqrt(0.1 / 1.9)), (np.ones(8), 1 / np.sqrt(8))]
KEPT += [(2.0, (4 * np.pi * 2.0**2) ** -0.25), ([2.0, 1.0, 1.0], np.sqrt(6) / 4)]


@pytest.mark.parametrize("time, kept", KEPT)
def test_of_an_impulse_and_of_white_noise_the_square_sum_of_weights_remains(time, kept):
    """Exactly of one frame in 512, hence in expectation of noise."""
    impulse = np.zeros((512, 1, 1))
    impulse[5] = np.sqrt(512)
    assert filtered_error(impulse, [[0.0]], 0, time) == pytest.approx(kept, rel=1e-5)


def test_one_frame_is_an_image():
    image, reference = FRAMES[0], FRAMES[1]
    alone = filtered_error(image, reference)
    for time in (0, 3.0, np.ones(4), moving_average(0.1)):
        assert filtered_error(image[None], reference[None], time=time) == pytest.approx(alone, rel=1e-14)
    assert filtered_error(image, reference, 0) == pytest.approx(rms(image - reference), rel=1e-14)
    spectrum = error_spectrum(image[None], reference, animated=True)[0]
    np.testing.assert_allclose(spectrum, error_spectrum(image, reference), atol=1e-12)


def test_a_reference_may_be_one_for_all_frames_and_channels_are_averaged():
    still = np.random.default_rng(3).normal(size=(6, 8, 3))
    frames = FRAMES[..., None] * np.array([1.0, 2.0, 3.0]) + still
    each = [filtered_error(c * FRAMES, ZERO, 0.7, 1.2) for c in (1, 2, 3)]
    assert filtered_error(frames, still, 0.7, 1.2) == pytest.approx(rms(each), rel=1e-12)
    assert filtered_error(frames, np.stack([still] * 24), 0.7, 1.2) == pytest.approx(rms(each), rel=1e-12)


@pytest.mark.parametrize("time", [1.5, np.ones(8), moving_average(0.1)], ids=["Gaussian", "box", "average"])
def test_it_is_the_filter_of_expected_error(time):
    """The root mean square of a linear integrand's errors, over points, is what the closed form has."""
    points = np.random.default_rng(4).random((4, 4, 8, 1, 1))
    frames = np.moveaxis(points[..., 0, 0] - 0.5, 2, 0)
    linear = lambda x, y: jnp.prod((x - 0.5) * (y - 0.5), axis=-1)  # noqa: E731
    expected = analysis.expected_error(points, linear, analysis.Filter(0.9, time))
    assert filtered_error(frames, np.zeros((4, 4)), 0.9, time) == pytest.approx(expected, rel=1e-4)


def test_parseval():
    """The mean power is 1, and filters weight it: spectra and filtered errors are one."""
    spectrum = error_spectrum(FRAMES, ZERO, animated=True)
    assert spectrum.shape == FRAMES.shape
    assert spectrum.mean() == pytest.approx(1, rel=1e-12)
    assert spectrum[0, 0, 0] == 0
    kept = np.abs(np.fft.fft(np.ones(8) / 8, 24)) ** 2
    weighted = np.sqrt(np.mean(spectrum * kept[:, None, None]) * FRAMES.var())
    centred = FRAMES - FRAMES.mean()
    assert filtered_error(centred, ZERO, 0, np.ones(8)) == pytest.approx(weighted, rel=1e-12)


def test_a_moving_wave_has_its_frequencies_in_time_and_space():
    t, x = np.arange(10)[:, None, None], np.arange(16)
    wave = np.broadcast_to(np.cos(2 * np.pi * (3 * t / 10 + 4 * x / 16)), (10, 12, 16))
    frequency, power = analysis.radial_average(error_spectrum(wave, np.zeros((12, 16)), animated=True))
    assert power.shape == (10, len(frequency)) == (10, 8)
    assert set(zip(*np.nonzero(power > 1e-9), strict=True)) == {(3, 3), (7, 3)}
    np.testing.assert_allclose(np.fft.fftfreq(10)[[3, 7]], [0.3, -0.3])


def test_annuli_of_frames_are_those_of_each():
    powers = FRAMES**2
    frequency, power = analysis.radial_average(powers)
    for of_frame, expected in zip(power, powers, strict=True):
        alone = analysis.radial_average(expected)
        np.testing.assert_array_equal(frequency, alone[0])
        np.testing.assert_allclose(of_frame, alone[1], rtol=1e-14)


test_bad_input_is_named = refused(
    (lambda: filtered_error(FRAMES[0], ZERO[0], time=1.0), r"image must have shape \(frames, height, width"),
    (lambda: filtered_error(FRAMES, ZERO[:3], time=1.0), r"the same shape, got \(24, 6, 8\) and \(3, 6, 8\)"),
    (lambda: error_spectrum(FRAMES[0], ZERO[0], animated=True), r"image must have shape \(frames, height"),
)


@pytest.mark.parametrize("channels", [(), (3,)])
def test_after_a_gaussian_as_denoiser_the_error_is_that_after_a_filter(channels):
    """SciPy's, truncated far out; grey and in colour, which denoisers get in colour."""

    def gaussian(image):
        assert image.shape == (40, 24, 3) and image.dtype == np.float32
        return gaussian_filter1d(gaussian_filter1d(image, 1.5, 0, mode="wrap"), 1.5, 1, mode="wrap")

    image, reference = np.random.default_rng(1).random((2, 40, 24, *channels))
    filtered = gaussian(np.broadcast_to(reference.reshape(40, 24, -1), (40, 24, 3)).astype(np.float32))
    found = analysis.denoised_error(image, filtered if channels else filtered[..., 0], gaussian)
    assert found == pytest.approx(analysis.filtered_error(image, reference), rel=1e-3)
    same = analysis.denoised_error(image, reference, lambda x: x)
    assert same == pytest.approx(rms(image - reference), rel=1e-6)


def test_denoisers_get_albedo_and_normals_if_these_are_given():
    got = []
    image = np.ones((4, 5, 3))
    for others in ((), (1.0,), (1.0, 2.0), (None, 2.0)):
        analysis.denoised_error(image, image, lambda image, *others: got.append(others) or image, *others)
    assert got == [(), (1.0,), (1.0, 2.0), (None, 2.0)]


def test_the_error_after_a_denoiser_is_differentiable():
    def denoise(image):
        return (image + jnp.roll(image, 1, 0)) / 2

    image, reference = np.random.default_rng(2).random((2, 6, 5, 3), np.float32)
    measure = jax.value_and_grad(lambda image: analysis.denoised_error(image, reference, denoise))
    value, slope = jax.jit(measure)(image)
    assert float(value) == pytest.approx(analysis.denoised_error(image, reference, denoise), rel=1e-6)
    error = np.asarray(denoise(image) - reference, np.float64)
    expected = (error + np.roll(error, -1, 0)) / 2 / error.size / float(value)
    np.testing.assert_allclose(slope, expected, rtol=1e-4, atol=1e-8)


def product(point):
    return point[..., 0] * point[..., 1]


def zeros(side):
    return np.zeros((side, side))


SAMPLED = ["z, hash", *slow("randomized, contiguous, owen", "shifted, hilbert, lattice")]


@pytest.mark.parametrize("name", SAMPLED)
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


test_bad_input_of_pixel_means_is_named = refused(
    (lambda: analysis.pixel_means(product, samplers.z(4, 4, 2, 1), 4, 4, 4), "spp must be .* 2 .* got 4"),
    (lambda: analysis.filtered_error(zeros(4) + np.nan, zeros(4)), "must be finite"),
    (lambda: analysis.low_frequency_power(np.eye(8), zeros(8), 0.05), "cutoff must be .* got 0.05"),
)


RNG = np.random.default_rng(5)
REFERENCE = RNG.uniform(0.1, 1.0, (6, 8, 3))
IMAGE = REFERENCE + 0.1 * RNG.standard_normal(REFERENCE.shape)


def test_relative_errors_by_hand():
    """(1/2)^2 / (1 + 1/4) and (2/3)^2 / (4 + 1/4): of each channel by its own reference."""
    image, reference = [[[1.5, 2 + 2 / 3]]], [[[1.0, 2.0]]]
    expected = np.sqrt((0.25 / 1.25 + 4 / 9 / 4.25) / 2)
    assert relative_error(image, reference, 0.25) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_relative_errors_do_not_depend_on_the_exposure(scale):
    """In the limit of a small epsilon, and for any that is scaled, too; for a large one they are absolute."""
    limit = np.sqrt(np.mean((IMAGE / REFERENCE - 1) ** 2))
    assert relative_error(scale * IMAGE, scale * REFERENCE, 1e-16) == pytest.approx(limit, rel=1e-6)
    scaled = relative_error(scale * IMAGE, scale * REFERENCE, 0.01 * scale**2)
    assert scaled == pytest.approx(relative_error(IMAGE, REFERENCE), rel=1e-12)
    rms = np.sqrt(np.mean((IMAGE - REFERENCE) ** 2))
    assert relative_error(IMAGE, REFERENCE, 1e8) == pytest.approx(rms / 1e4, rel=1e-6)


def test_one_firefly_does_not_change_robust_errors():
    """However bright, while the error of every other pixel counts."""
    firefly = IMAGE.copy()
    errors = np.sqrt(np.mean((IMAGE - REFERENCE) ** 2, axis=2)).ravel()
    errors = np.sort(np.delete(errors, 2 * 8 + 3))
    for brightness in (10.0, 1e6):
        firefly[2, 3] = brightness
        trimmed = analysis.trimmed_error(firefly, REFERENCE, 1 / 48)
        assert trimmed == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-12)
        assert quantile_error(firefly, REFERENCE, 46 / 47) == pytest.approx(errors[-1], rel=1e-12)
        assert quantile_error(firefly, REFERENCE) == pytest.approx((errors[23] + errors[24]) / 2, rel=1e-12)
    rms = np.sqrt(np.mean((firefly - REFERENCE) ** 2))
    assert analysis.trimmed_error(firefly, REFERENCE, 0) == pytest.approx(rms)


def test_trimmed_errors_and_quantiles_by_hand():
    """Of errors 1, 2, ..., 10: shares are rounded, one pixel is kept, quantiles are interpolated."""
    image, zero = np.arange(1.0, 11.0)[:, None], np.zeros((10, 1))
    for share, kept in [(0, 10), (0.04, 10), (0.06, 9), (0.29, 7), (0.5, 5), (0.999, 1)]:
        expected = np.sqrt(np.mean(np.arange(1.0, kept + 1) ** 2))
        assert analysis.trimmed_error(-image, zero, share) == pytest.approx(expected, rel=1e-14)
    for level, expected in [(0, 1), (0.5, 5.5), (0.9, 9.1), (1, 10)]:
        assert quantile_error(-image, zero, level) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("measure", [relative_error, analysis.trimmed_error, quantile_error])
def test_an_exact_image_has_error_and_gradient_0(measure):
    value, gradient = jax.value_and_grad(measure)(jnp.asarray(REFERENCE), REFERENCE)
    assert measure(REFERENCE, REFERENCE) == value == 0 and not np.asarray(gradient).any()


test_what_no_error_can_be = refused(
    (lambda: flip(np.ones((2, 2, 2)), np.ones((2, 2, 2))), r"image must have shape .*, 3\), got \(2, 2, 2\)"),
    (lambda: flip(IMAGE, 0 * REFERENCE, hdr=True), "reference must have a largest luminance in .*got 0.0"),
    call=lambda call: call(),
    error=ValueError,
)


def test_flip_names_the_package_that_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(ImportError, match=r"pip install 'qmcjax\[flip\]'"):
        flip(IMAGE, REFERENCE)
    with pytest.raises(TypeError, match="image must be an array of real numbers, known and not traced by"):
        jax.grad(lambda image: flip(image, REFERENCE))(jnp.ones((6, 8, 3)))


def test_flip_is_that_of_its_authors_for_displayed_colours():
    """Linear light is encoded as sRGB for their command; grey has three equal channels."""
    package = pytest.importorskip("flip_evaluator")
    encode = np.where(IMAGE < 0.0031308, 12.92 * IMAGE, 1.055 * np.abs(IMAGE) ** (1 / 2.4) - 0.055)
    exact = 1.055 * REFERENCE ** (1 / 2.4) - 0.055
    shown = [np.clip(each, 0, 1).astype(np.float32) for each in (exact, encode)]
    for distance, how in [(3840.0, {}), (1000.0, {"vc": [0.5, 1000.0, 0.5]})]:
        _, expected, _ = package.evaluate(*shown, "LDR", True, False, parameters=how)
        assert 0 < flip(IMAGE, REFERENCE, distance) == pytest.approx(expected, rel=1e-4)
    grey, three = IMAGE[..., 0], np.repeat(REFERENCE[..., :1], 3, axis=2)
    assert flip(grey, three[..., 0]) == flip(np.repeat(grey[..., None], 3, axis=2), three)
    assert f"{flip(np.full((8, 8), 0.22), np.full((8, 8), 0.2)):.3f}" == "0.100"


def test_hdr_flip_does_not_depend_on_the_exposure():
    """It chooses exposures itself; a firefly is no NaN; an image is like itself."""
    pytest.importorskip("flip_evaluator")
    alone = flip(IMAGE, REFERENCE, hdr=True)
    assert flip(100 * IMAGE, 100 * REFERENCE, hdr=True) == pytest.approx(alone, rel=1e-3)
    assert flip(REFERENCE, REFERENCE, hdr=True) == flip(REFERENCE, REFERENCE) == 0
    firefly = IMAGE.copy()
    firefly[2, 3] = 1e300
    assert alone < flip(firefly, REFERENCE, hdr=True) <= 1

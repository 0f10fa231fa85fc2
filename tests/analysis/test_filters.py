"""Errors after filters in space and time, and the error that an eye at a distance sees."""

import math
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.signal import lfilter

import analysis
from analysis import Filter, error_spectrum, expected_error, filtered_error, moving_average, radial_average

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


@pytest.mark.parametrize(
    ("time", "kept"),
    [
        (moving_average(0.1), np.sqrt(0.1 / 1.9)),
        (np.ones(8), 1 / np.sqrt(8)),
        (2.0, (4 * np.pi * 2.0**2) ** -0.25),
        ([2.0, 1.0, 1.0], np.sqrt(6) / 4),
    ],
)
def test_of_an_impulse_and_of_white_noise_the_square_sum_of_weights_remains(time, kept):
    """Exactly of one frame in 512, hence in expectation of noise: 5 standard deviations."""
    impulse = np.zeros((512, 1, 1))
    impulse[5] = np.sqrt(512)
    assert filtered_error(impulse, [[0.0]], 0, time) == pytest.approx(kept, rel=1e-5)
    noise = np.random.default_rng(2).normal(size=(512, 16, 16))
    of_pixels = [filtered_error(noise[:, :, [k]], np.zeros((16, 1)), 0, time) ** 2 for k in range(16)]
    assert abs(np.mean(of_pixels) - kept**2) < 5 * np.std(of_pixels, ddof=1) / 4


def test_one_frame_is_an_image():
    image, reference = FRAMES[0], FRAMES[1]
    alone = filtered_error(image, reference)
    for time in (0, 3.0, np.ones(4), moving_average(0.1)):
        assert filtered_error(image[None], reference[None], time=time) == pytest.approx(alone, rel=1e-14)
    assert filtered_error(image, reference, 0) == pytest.approx(rms(image - reference), rel=1e-14)
    np.testing.assert_allclose(
        error_spectrum(image[None], reference, animated=True)[0], error_spectrum(image, reference), atol=1e-12
    )


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
    expected = expected_error(
        points, lambda x, y: jnp.prod((x - 0.5) * (y - 0.5), axis=-1), Filter(0.9, time)
    )
    assert filtered_error(frames, np.zeros((4, 4)), 0.9, time) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("time", [1.5, np.ones(8), moving_average(0.1)], ids=["Gaussian", "box", "average"])
def test_float32_has_the_same_digits(time):
    traced = jax.jit(lambda frames: filtered_error(frames, ZERO, time=time))(jnp.asarray(FRAMES, jnp.float32))
    assert traced.dtype == np.float32
    assert float(traced) == pytest.approx(filtered_error(FRAMES, ZERO, time=time), rel=2e-6)


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
    frequency, power = radial_average(error_spectrum(wave, np.zeros((12, 16)), animated=True))
    assert power.shape == (10, len(frequency)) == (10, 8)
    assert set(zip(*np.nonzero(power > 1e-9), strict=True)) == {(3, 3), (7, 3)}
    np.testing.assert_allclose(np.fft.fftfreq(10)[[3, 7]], [0.3, -0.3])


def test_annuli_of_frames_are_those_of_each():
    powers = FRAMES**2
    frequency, power = radial_average(powers)
    for of_frame, expected in zip(power, powers, strict=True):
        alone = radial_average(expected)
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
    assert analysis.denoised_error(image, reference, lambda x: x) == pytest.approx(
        np.sqrt(np.mean((image - reference) ** 2)), rel=1e-6
    )


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
    value, slope = jax.jit(
        jax.value_and_grad(lambda image: analysis.denoised_error(image, reference, denoise))
    )(image)
    assert float(value) == pytest.approx(analysis.denoised_error(image, reference, denoise), rel=1e-6)
    error = np.asarray(denoise(image) - reference, np.float64)
    expected = (error + np.roll(error, -1, 0)) / 2 / error.size / float(value)
    np.testing.assert_allclose(slope, expected, rtol=1e-4, atol=1e-8)

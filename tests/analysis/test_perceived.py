"""The error that an eye at a distance sees."""

import numpy as np
import pytest
from refusals import refused

import analysis

ZERO = np.zeros((64, 64))


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
    assert analysis.perceived_error(0.5 + wave, ZERO + 0.5, distance) == pytest.approx(expected, rel=1e-3)


def test_from_nearby_the_whole_error_is_seen_and_from_afar_its_mean():
    noise = np.random.default_rng(0).random((64, 32, 3))
    reference = np.zeros_like(noise)
    assert analysis.perceived_error(noise, reference, 1e-3) == pytest.approx(np.sqrt(np.mean(noise**2)))
    means = noise.mean(axis=(0, 1))
    assert analysis.perceived_error(noise, reference, 1e6) == pytest.approx(np.sqrt(np.mean(means**2)))
    distances = [100, 1000, 2000, 4000]
    errors = [analysis.perceived_error(noise - means, reference, d) for d in distances]
    assert errors == sorted(errors, reverse=True)


test_bad_input_is_named = refused(
    (np.zeros((4, 5)), 2000.0, r"one shape, got \(4, 5\) and \(64, 64\)"),
    (ZERO + np.nan, 2000.0, "must be finite"),
    (ZERO, 0.0, "distance must be positive and finite, got 0.0"),
    (ZERO, np.inf, "distance must be positive and finite, got inf"),
    call=lambda image, distance: analysis.perceived_error(image, ZERO, distance),
)

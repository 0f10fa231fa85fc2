"""Where single precision holds, by the measurements of the figure."""

import pytest

from figures.ours import point_precision


@pytest.mark.slow
def test_sums_are_as_good_as_their_terms():
    """At 2^20 samples the default path is within 2 units of the float64 mean, and a plain sum is far off."""
    measured = point_precision.sums(20)
    assert max(measured["render, float32"].values()) < 2
    assert measured["naive"][2**6] > 1 and measured["naive"][2**20] > 1000


def test_points_have_all_their_bits_up_to_the_last_index():
    measured = point_precision.points(16)
    assert max(measured["Sobol', second component"].values()) < 1
    for name in ("Halton, base 3", "Halton, base 13"):
        assert max(measured[name].values()) <= 0.501
    assert max(measured["textbook loop, base 3"].values()) > 1


def test_offsets_have_all_their_bits_at_any_resolution():
    measured = point_precision.offsets(32)
    assert list(measured["on integers"])[-1] == 65536
    assert max(measured["on integers"].values()) < 1
    assert measured["textbook, float32"][65536] > 10_000


def test_the_error_of_a_phase_grows_with_the_frequency():
    measured = point_precision.frequencies(16)
    for frequency, error in measured["scene, float32"].items():
        assert error < 2e-7 + 2.0**-23 * frequency
    for frequency, error in measured["scene, float64"].items():
        assert error < 4e-16 + 2.0**-51 * frequency


@pytest.mark.slow
def test_coordinates_of_many_dimensions():
    measured = point_precision.dimensions(16)
    assert list(measured["coordinates, float32"])[-1] == 1024
    assert max(measured["coordinates, float32"].values()) < 1
    for dims, error in measured["product, float32"].items():
        assert error < 2 * dims  # a half for each product, and as much for each factor

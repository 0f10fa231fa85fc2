"""Gradient descent on measures of points."""

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

import analysis
from qmcjax import sequences

POINTS = np.random.default_rng(1).random((16, 2))


def spread(points):
    return -analysis.soft_min_distance(points)


def away_from_low_frequencies(points):
    power = analysis.point_spectrum(points, 5).ravel()
    return jnp.sum(jnp.square(power[1:]))


def test_distance_comes_near_that_of_the_densest_packing():
    result = analysis.optimize_points(POINTS, spread, 200)
    densest = np.sqrt(2 / np.sqrt(3) / len(POINTS))
    assert 0.85 * densest < analysis.min_distance(result.points) <= densest
    assert analysis.min_distance(POINTS) < 0.3 * densest


def test_two_points_in_one_dimension():
    """The periodic discrepancy is least for points half a period apart, wherever they are."""
    result = analysis.optimize_points(np.array([[0.1], [0.2]]), analysis.periodic_discrepancy, 50)
    assert abs(np.diff(result.points, axis=0)[0, 0]) == pytest.approx(0.5, abs=1e-6)


def test_one_point_of_least_star_discrepancy():
    """The square of the discrepancy is (x^3 + (1 - x)^3) / 3."""
    result = analysis.optimize_points(np.array([[0.9]]), analysis.l2_star_discrepancy, 50, torus=False)
    np.testing.assert_allclose(result.points, 0.5, atol=1e-6)


def test_wanted_spectrum():
    result = analysis.optimize_points(POINTS, away_from_low_frequencies, 200)
    assert result.values[-1] < 1e-6 * result.values[0]


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize("measure", [analysis.l2_star_discrepancy, spread, away_from_low_frequencies])
def test_values_never_grow_and_are_the_measure(measure, torus):
    result = analysis.optimize_points(POINTS, measure, 7, torus=torus)
    assert len(result.values) == 8
    assert (np.diff(result.values) <= 0).all()
    assert result.values[-1] < result.values[0]
    again = analysis.optimize_points(result.points, measure, 1, torus=torus)
    assert again.values[0] == pytest.approx(result.values[-1], rel=1e-9)
    assert result.points.dtype == np.float64
    assert ((result.points >= 0) & (result.points < 1)).all()


def test_on_the_torus_points_leave_on_one_side_and_come_back_on_the_other():
    def to_the_left(points):
        return jnp.sum(jnp.sin(2 * jnp.pi * (points - 0.9)))  # least at 0.65, from 0.1 by way of 0

    result = analysis.optimize_points(np.array([[0.1]]), to_the_left, 50)
    np.testing.assert_allclose(result.points, 0.65, atol=1e-5)
    stopped = analysis.optimize_points(np.array([[0.1]]), to_the_left, 50, torus=False)
    assert stopped.points[0, 0] == 0


def test_a_wall_of_infinity_is_not_the_end():
    """From below 0.5 towards 0.9, where nothing may exceed 0.8."""

    def walled(points):
        return jnp.where(points.max() > 0.8, jnp.inf, jnp.sum(jnp.square(points - 0.9)))

    result = analysis.optimize_points(0.5 * POINTS, walled, 50, torus=False)
    assert result.values[-1] < 0.3 * result.values[0]
    assert result.points.max() <= 0.8
    assert np.isfinite(result.values).all()


def test_float32_points_of_a_sequence_are_taken():
    start = sequences.sobol(2).points(8)
    result = analysis.optimize_points(start, analysis.l2_star_discrepancy, 3, torus=False)
    assert result.values[-1] < result.values[0]


test_bad_input_is_named = refused(
    (np.zeros((0, 2)), spread, 1, r"points must have shape .* got \(0, 2\)"),
    (np.zeros(3), spread, 1, r"points must have shape .* got \(3,\)"),
    (np.zeros((3, 2), int), spread, 1, "points .* got int64"),
    (np.array([[0.5, 1.0]]), spread, 1, "points must be in .* got 1.0"),
    (np.array([[0.5, np.nan]]), spread, 1, "points must be in .* got nan"),
    (POINTS, spread, 0, "steps must be .* got 0"),
    (POINTS, lambda p: p[0], 1, "measure must return a floating point scalar"),
    (POINTS, lambda p: 1, 1, "measure must return a floating point scalar"),
    (POINTS, lambda p: jnp.log(p[0, 0] - p[0, 0]), 1, "measure must be finite at the start"),
    call=analysis.optimize_points,
)

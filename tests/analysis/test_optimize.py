"""Gradient descent on measures of points, on the permutations of Owen scrambling, and on any parameters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import each

import analysis
from analysis import minimize
from analysis._searches.optimize import relax
from qmcjax import sequences
from qmcjax.core.checkpoints import Checkpoint

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
    """Half a period apart, wherever they are; one point by (x^3 + (1 - x)^3) / 3, the squared discrepancy."""
    result = analysis.optimize_points(np.array([[0.1], [0.2]]), analysis.periodic_discrepancy, 50)
    assert abs(np.diff(result.points, axis=0)[0, 0]) == pytest.approx(0.5, abs=1e-6)
    result = analysis.optimize_points(np.array([[0.9]]), analysis.l2_star_discrepancy, 50, torus=False)
    np.testing.assert_allclose(result.points, 0.5, atol=1e-6)


def test_wanted_spectrum():
    result = analysis.optimize_points(POINTS, away_from_low_frequencies, 200)
    assert result.values[-1] < 1e-6 * result.values[0]


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize("measure", [analysis.l2_star_discrepancy, spread, away_from_low_frequencies])
def test_values_never_grow_and_are_the_measure(measure, torus):
    result = analysis.optimize_points(POINTS, measure, 7, torus=torus)
    assert len(result.values) == 8 and (np.diff(result.values) <= 0).all()
    assert result.values[-1] < result.values[0]
    again = analysis.optimize_points(result.points, measure, 1, torus=torus)
    assert again.values[0] == pytest.approx(result.values[-1], rel=1e-9)
    assert result.points.dtype == np.float64 and ((result.points >= 0) & (result.points < 1)).all()


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


def warnock(points):
    """Return the L2-star discrepancy by its sum over pairs, which compiles fast."""
    n, dims = points.shape
    larger = jnp.maximum(points[:, None], points[None])
    singles = jnp.sum(jnp.prod(1 - jnp.square(points), axis=1)) * 2.0 ** (1 - dims) / n
    return jnp.sqrt(3.0**-dims - singles + jnp.sum(jnp.prod(1 - larger, axis=2)) / n**2)


def measured(points):
    """Return the discrepancy of middles of cells."""
    return float(analysis.l2_star_discrepancy(at(points)))


def integers(sequence, n):
    return np.floor(np.asarray(sequence.points(n, dtype=jnp.float64)) * n).astype(int)


def net(m):
    """Return a (0,m,2)-net as integers."""
    return integers(sequences.hammersley_net(m), 2**m)


def at(points):
    """Return the middles of cells."""
    return (np.asarray(points) + 0.5) / len(points)


def test_hard_numbers_are_nested_permutations():
    """All ways to flip the digits of four points: what a loop over points and digits gives, 0 and 1."""
    given = net(2)
    form = relax(given)
    for code in range(2**6):
        flipped = np.array([code >> k & 1 for k in range(6)]).reshape(2, 3)
        expected = np.empty((4, 2))
        for i, j in np.ndindex(4, 2):
            high, low = given[i, j] >> 1, given[i, j] & 1
            high_scrambled = high ^ flipped[j, 0]
            expected[i, j] = (2 * high_scrambled + (low ^ flipped[j, 1 + high]) + 0.5) / 4
        with jax.enable_x64(True):
            np.testing.assert_array_equal(form(jnp.asarray(1.0 - 2.0 * flipped)), expected)


def test_between_lies_the_mean_over_coins():
    """Point by point: of all 8 scramblings of a coordinate, weighted by their probabilities."""
    form, s = relax(net(2)), np.array([0.3, 0.6, 0.9])
    mean = np.zeros((4, 2))
    with jax.enable_x64(True):
        for code in range(8):
            flipped = np.array([code >> k & 1 for k in range(3)])
            chance = np.prod(np.where(flipped, s, 1 - s))
            mean += chance * np.asarray(form(jnp.asarray([1.0 - 2 * flipped] * 2)))
        np.testing.assert_allclose(form(jnp.asarray([1 - 2 * s] * 2)), mean, rtol=1e-14)


def test_gradient_is_that_of_finite_differences():
    form, rng = relax(net(3)), np.random.default_rng(1)
    kept, step = rng.uniform(-1, 1, (2, 7)), 1e-6
    with jax.enable_x64(True):
        value = jax.jit(lambda kept: warnock(form(kept)))
        gradient = np.asarray(jax.grad(value)(kept))
        for place in np.ndindex(kept.shape):
            moved = np.zeros_like(kept)
            moved[place] = step
            slope = float(value(kept + moved) - value(kept - moved)) / (2 * step)
            assert slope == pytest.approx(gradient[place], rel=1e-5, abs=1e-9)


OTHERS = {"(0,4,3)": sequences.sobol_net_3d(4), "(1,4,4)": sequences.sobol(4)}
NETS = {"(0,5,2)": net(5), **{name: integers(made, 16) for name, made in OTHERS.items()}}


@pytest.mark.slow
@each("given", NETS)
def test_nets_stay_nets_with_the_same_t(given):
    """And what is handed out is measured as said."""
    result = analysis.optimize_scrambling(given, warnock, 10)
    assert analysis.t_value(result.points / len(given)) == analysis.t_value(given / len(given))
    assert result.values[-1] == pytest.approx(measured(result.points), rel=1e-12)
    assert result.values[0] == pytest.approx(measured(given), rel=1e-12)
    assert (np.diff(result.values) <= 0).all() and result.values[-1] < result.values[0]
    assert not np.array_equal(result.points, given) and 11 < len(result.values) <= 41


def test_the_best_of_a_small_net_is_found():
    """Of all 64 scramblings of four points, and under every one of some keys."""
    given = net(2)
    with jax.enable_x64(True):
        form = relax(given)
        codes = (1.0 - 2.0 * np.array([[c >> k & 1 for k in range(6)] for c in range(64)])).reshape(64, 2, 3)
        best = float(jax.lax.map(lambda c: warnock(form(c)), jnp.asarray(codes)).min())
    found = [analysis.optimize_scrambling(given, warnock, 20, key).values[-1] for key in range(4)]
    assert min(found) == pytest.approx(best, rel=1e-12)


def test_rows_stay_in_place():
    """A measure of points in order: point k is to be near k / n in its first coordinate."""
    given = integers(sequences.sobol(2), 32)

    def off(points):
        return jnp.sum(jnp.square(points[:, 0] - (np.arange(32) + 0.5) / 32))

    result = analysis.optimize_scrambling(given, off, 60)
    assert result.values[-1] == pytest.approx(np.sum((at(result.points)[:, 0] - at(np.arange(32))) ** 2))


def test_keys_begin_elsewhere_and_repeat():
    runs = [analysis.optimize_scrambling(net(4), warnock, 3, key) for key in (1, 1, 2)]
    np.testing.assert_array_equal(runs[0].values, runs[1].values)
    assert len(runs[0].values) != len(runs[2].values) or (runs[0].values != runs[2].values).any()


START = {"a": np.zeros(3, np.float32), "b": np.float32(2.0)}
TARGET = np.array([0.5, -1.0, 2.0], np.float32)


def bowl(free, key):
    """Return a mean over keys with its minimum at the target, and at 1."""
    random = jax.random.normal(key, (3,)) / 10
    return jnp.sum((free["a"] - TARGET + random) ** 2) + (free["b"] - 1) ** 2


def test_the_minimum_of_a_mean_over_keys_is_found():
    made = minimize(bowl, START, 1, 4000, rate=0.05)
    np.testing.assert_allclose(made.parameters["a"], TARGET, atol=0.03)
    assert made.parameters["b"] == pytest.approx(1, abs=1e-3)
    assert made.losses.shape == (200,)
    # The variance of three random numbers; over 800 keys, 5 sigma of their sum of squares.
    assert made.losses[-40:].mean() == pytest.approx(0.03, abs=5 * 0.01 * np.sqrt(6 / 800))
    assert all(isinstance(leaf, np.ndarray) and leaf.dtype == np.float32 for leaf in made.parameters.values())


def test_parameters_stay_in_a_projection():
    given = {"rate": 0.1, "noise": 1.0, "project": jnp.abs}
    made = minimize(lambda a, key: jnp.sum(a), np.ones(2, np.float32), 1, 200, **given)
    assert (made.parameters >= 0).all() and made.parameters.max() < 0.05


def test_interrupted_runs_go_on_to_the_same_bits(tmp_path):
    def interrupt(finished):
        if finished >= 0.5:
            raise KeyboardInterrupt

    whole = minimize(bowl, START, 1, 200, noise=0.5)
    kept = Checkpoint(tmp_path / "state", "bowl")
    with pytest.raises(KeyboardInterrupt):
        minimize(bowl, START, 1, 200, noise=0.5, checkpoint=kept, progress=interrupt)
    resumed = minimize(bowl, START, 1, 200, noise=0.5, checkpoint=kept)
    np.testing.assert_array_equal(resumed.parameters["a"], whole.parameters["a"])
    np.testing.assert_array_equal(resumed.losses, whole.losses)


def test_a_loss_that_stops_being_finite_is_an_error():
    with pytest.raises(ValueError, match="loss must stay finite, got nan before step"):
        minimize(lambda a, key: jnp.sum(jnp.sqrt(a)), np.full(2, 0.1, np.float32), 1, 400, rate=0.1)


def test_parameters_keep_their_dtype():
    with pytest.raises(ValueError, match="parameters must be float32 unless"):
        minimize(bowl, jax.tree.map(np.float64, START), 1)

"""A hundred integrands with exact integrals, and intervals over them."""

import numpy as np
import pytest

from figures.shared.integrands import hundred_integrands
from qmcjax import integrate, sequences
from qmcjax.integration import _intervals

INTEGRANDS = hundred_integrands.integrands()


def test_there_are_a_hundred_of_all_classes_and_dimensions():
    assert len(INTEGRANDS) == 100
    for of_class, formulas in hundred_integrands.CLASSES.items():
        of = [each for each in INTEGRANDS if each.of_class == of_class]
        assert len(of) in (16, 17) and {each.formula for each in of} == set(formulas)
        assert {each.dims for each in of} == set(range(1, 9))


@pytest.fixture(scope="module")
def values():
    points = sequences.owen(sequences.sobol(hundred_integrands.DIMS), 1).points(2**15)
    return points, np.asarray(hundred_integrands.together(points))


@pytest.mark.slow
def test_integrals_are_exact(values):
    """By means over a net, within 5 standard errors of random points; all values are in [0, 1]."""
    found = values[1]
    assert found.min() >= 0 and found.max() <= 1
    error = found.mean(axis=0) - [each.integral for each in INTEGRANDS]
    assert (abs(error) < 5 * found.std(axis=0) / np.sqrt(len(found)) + 1e-6).all()
    # The bound is not so wide that it hides an error: most integrals are known to a thousandth.
    assert np.median(abs(error)) < 1e-4


@pytest.mark.slow
def test_single_integrands_are_columns_of_all(values):
    points, found = values
    for place in range(0, 100, 7):
        alone = INTEGRANDS[place].integrand(points[:64])
        np.testing.assert_allclose(alone, found[:64, place], rtol=2e-5, atol=1e-7)


@pytest.mark.slow
def test_further_coordinates_do_not_count(values):
    """Those that an integrand does not have."""
    points = np.asarray(values[0][:64])
    for place in range(0, 100, 7):
        moved = points.copy()
        moved[:, INTEGRANDS[place].dims :] = 0.123
        found = [np.asarray(INTEGRANDS[place].integrand(of)) for of in (points, moved)]
        np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("chance", [0.03, 0.5])
def test_bernstein_intervals_hold_means_and_are_wider_than_betting(chance):
    """Of 1000 coins, 400 times, at 80 %; with the same level as bets."""
    coins = (np.random.default_rng(3).random((1000, 400)) < chance).astype(float)
    low, high = hundred_integrands.bernstein(coins, 0.8)
    held = np.mean((low <= chance) & (chance <= high))
    assert held >= 0.8
    normal = 2 * 1.2816 * np.sqrt(chance * (1 - chance) / 1000)
    assert normal < (high - low).mean() < 3 * normal
    other = _intervals.betting_interval(coins, 0.8)
    assert (high - low > other[1] - other[0]).mean() > 0.99


@pytest.mark.slow
def test_intervals_are_those_of_integrate():
    found = hundred_integrands.measure({"few": (8, 32), "many": (16, 32)}, [5], lambda part: None)
    assert set(found) == set(hundred_integrands.CASES)
    how = dict(replicates=8, key=5, interval="median")
    made = integrate(hundred_integrands.together, sequences.sobol(8), 32, **how)
    low, high = made.interval(0.95)
    exact = [each.integral for each in INTEGRANDS]
    of = found["median", "few"]
    np.testing.assert_allclose(of.width[0], high - low)
    np.testing.assert_array_equal(of.held[0], (low <= exact) & (exact <= high))
    assert (found["empirical Bernstein", "many"].width >= found["betting", "many"].width).all()


@pytest.mark.slow
def test_results_to_a_tolerance_hold_integrals():
    """Few keys: 8 results of each of 9 integrands, and those that reached the tolerance are within it."""
    width = np.full(100, 0.02)
    found = hundred_integrands.stop_at_tolerance("student", width, range(8), 2048, 12)
    assert found.held.shape == (8, 9) and set(np.unique(found.n)) <= {1024, 2048}
    assert found.held.mean() >= 0.95 - 5 * np.sqrt(0.95 * 0.05 / 72)
    assert found.reached.any() and (found.within[found.reached]).mean() > 0.85

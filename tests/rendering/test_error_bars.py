"""Intervals of integrals: by order statistics and by betting, their guarantees and where these end."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.stats import binom
from tables import few, slow

import qmcjax as qj
from qmcjax import sequences
from qmcjax.integration import _intervals
from qmcjax.integration._doubts import tail_index

SOBOL = sequences.sobol(2)
INTERVALS = {"student": {}, "median": {}, "quantile": {}, "betting": {"limits": (0, 3)}}


def smooth(points):
    """Return values with the integral 1, in [0, 3]."""
    return jnp.exp(points[:, 0] + points[:, 1]) / points.dtype.type(np.expm1(1) ** 2)


def estimate(function, kind, key, n=64, replicates=8, sequence=SOBOL, **more):
    how = {"interval": kind} | INTERVALS[kind] | more
    return qj.integrate(function, sequence, n, replicates=replicates, key=key, **how)


# -- order statistics


@pytest.mark.parametrize("count", [1, 5, 6, 9, 12])
@pytest.mark.parametrize("level", [0.5, 0.9, 0.95])
def test_the_rank_is_the_best_that_covers(count, level):
    """Of all patterns of values below and above the median, by counting them."""
    below = [sum(signs) for signs in itertools.product((0, 1), repeat=count)]

    def covered(rank):
        return np.mean([rank <= number <= count - rank for number in below])

    rank = _intervals.rank(count, level)
    assert rank == 0 or covered(rank) >= level
    assert rank == count // 2 or covered(rank + 1) < level


def test_order_statistics_hold_the_median_of_a_skewed_distribution_and_not_its_mean():
    """Exponential: the median is log 2, the mean 1; at 400 values the interval excludes the latter."""
    values = np.random.default_rng(1).exponential(size=(400, 1000))
    rank = _intervals.rank(400, 0.95)
    low, high = (_intervals.of_rank(values, place) for place in (rank - 1, 400 - rank))
    exact = 1 - 2 * binom.cdf(rank - 1, 400, 0.5)
    held = np.mean((low <= np.log(2)) & (np.log(2) <= high))
    assert abs(held - exact) < 5 * np.sqrt(exact * (1 - exact) / 1000)
    assert np.mean((low <= 1) & (high >= 1)) < 0.05


# -- betting


@pytest.mark.parametrize("chance", [0.001, 0.1, 0.3, 0.5, 0.97])
def test_betting_fails_with_the_stated_probability_at_most(chance):
    """Exactly, by the probabilities of all 4096 sequences of 12 coins."""
    coins = np.array(list(itertools.product((0.0, 1.0), repeat=12))).T
    probability = np.prod(np.where(coins == 1, chance, 1 - chance), axis=0)
    assert np.isclose(probability.sum(), 1)
    for level in (0.5, 0.9, 0.95):
        low, high = _intervals.betting_interval(coins, level)
        assert probability[(low > chance) | (high < chance)].sum() <= 1 - level
        assert ((low >= 0) & (high <= 1) & (low < high)).all()


def test_bets_are_fair():
    """If they depend on earlier values only, the expected capital stays 1: over all sequences of 12 coins."""
    coins = np.array(list(itertools.product((0.0, 1.0), repeat=12))).T
    chance = 0.2
    probability = np.prod(np.where(coins == 1, chance, 1 - chance), axis=0)
    stakes = np.minimum(_intervals._bets(coins, np.log(40), np), 0.75 / chance)
    capital = np.prod(1 + stakes * (coins - chance), axis=0)
    assert abs(probability @ capital - 1) < 1e-12


@pytest.mark.parametrize("level", [0.9, 0.999])
def test_at_the_ends_the_capital_is_two_over_the_error(level):
    values = np.random.default_rng(2).uniform(size=200)
    low, high = _intervals.betting_interval(values, level)
    bets = _intervals._bets(values, np.log(2 / (1 - level)), np)
    for end, of in ((low, values), (1 - high, 1 - values)):
        capital = np.prod(1 + np.minimum(bets, 0.75 / end) * (of - end))
        assert capital == pytest.approx(2 / (1 - level), rel=1e-9)


def test_betting_is_as_narrow_as_the_values_vary():
    """Of 1000 values, compared to a normal interval; but not below the range divided by their number."""
    generator = np.random.default_rng(2)
    spread = {width: 0.3 + width * (generator.random(1000) - 0.5) for width in (0.001, 0.1, 0.6)}
    widths = {}
    for width, values in spread.items():
        low, high = _intervals.betting_interval(values, 0.95)
        assert low < 0.3 < high
        mirrored = _intervals.betting_interval(1 - values, 0.95)
        np.testing.assert_allclose((1 - mirrored[1], 1 - mirrored[0]), (low, high), rtol=0, atol=1e-12)
        widths[width] = high - low
    normal = 2 * 1.96 * 0.6 / np.sqrt(12 * 1000)
    assert normal < widths[0.6] < 1.5 * normal
    assert 1 / 1000 < widths[0.001] < widths[0.1] < widths[0.6]


# -- integrals


@pytest.mark.parametrize("interval", few(INTERVALS, "student"))
def test_intervals_hold_integrals_as_often_as_they_say(interval):
    """Over 100 keys; by order statistics 8 replicates cover with 93 %, betting always."""
    level, held, least = 0.9, 0, {"student": 0.9, "betting": 1.0}.get(interval, 1 - 18 / 256)
    for key in range(100):
        low, high = estimate(smooth, interval, key).interval(level)
        held += bool(low <= 1 <= high)
    assert abs(held - 100 * least) <= 5 * np.sqrt(100 * least * (1 - least))


def geometric_error(interval):
    """Return the geometric mean of errors over 20 keys, of 15 replicates with 4096 points."""
    how = {"n": 4096, "replicates": 15, "dtype": jnp.float64}
    found = np.array([float(estimate(smooth, interval, key, **how).integral) for key in range(20)])
    return np.exp(np.mean(np.log(np.abs(found - 1))))


@pytest.mark.slow
def test_the_median_is_for_linear_scrambling():
    """Of a smooth function it is closer than the mean by far, and gains nothing with Owen scrambling."""
    median, nested, mean = (geometric_error(how) for how in ("median", "quantile", "student"))
    assert median < mean / 3
    assert nested > mean / 2


def test_the_estimate_is_the_median_of_the_means():
    found = estimate(smooth, "median", 3)
    assert found.means.shape == (8,) and found.n == 64
    assert found.integral == np.median(found.means)
    means = estimate(smooth, "student", 3).means
    assert estimate(smooth, "betting", 3).integral == pytest.approx(np.mean(means), rel=len(means) * 2**-52)
    copy = sequences.linear_matrix_scramble(SOBOL, jax.random.split(jax.random.key(3), 8)[0])
    points = np.asarray(copy.points(64), np.float64) + 2.0**-24
    alone = np.exp(points.sum(axis=1)).mean() / np.expm1(1) ** 2
    np.testing.assert_allclose(found.means[0], alone, rtol=3e-7)


@pytest.mark.slow
@pytest.mark.parametrize("interval", ["median", "betting"])
def test_trees_and_compiled_programs(interval):
    """Each number as it is alone; the same under jit."""

    def several(points):
        return {"a": points, "b": 3 * points[:, 1]}

    def leaves(points):
        return jnp.stack([points[:, 0], points[:, 1], 3 * points[:, 1]], axis=1)

    # The program of all replicates has a copy of the function for each.
    how = {"kind": interval, "replicates": 6}
    low, high = estimate(several, key=5, **how).interval(0.9)
    for end, alone in zip((low, high), estimate(leaves, key=5, **how).interval(0.9), strict=True):
        np.testing.assert_allclose(end["a"], alone[:2], rtol=1e-6)
        np.testing.assert_allclose(end["b"], alone[2], rtol=1e-6)
    compiled = jax.jit(lambda key: estimate(several, key=key, **how).interval(0.9))(jax.random.key(5))
    for one, other in zip(jax.tree.leaves(compiled), jax.tree.leaves((low, high)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5)


# -- heavy tails

TAILS = {  # functions of u, whether "student" and "quantile" intervals are alarmed
    "x**-0.9": (lambda u, xp: u**-0.9, True, True),
    "x**-0.5": (lambda u, xp: 1e3 - u**-0.5, True, None),
    "log": (lambda u, xp: -xp.log(u), False, False),
    "bounded": (lambda u, xp: xp.exp(u), False, False),
    "a narrow peak": (lambda u, xp: u**200, False, False),
    "a rare event": (lambda u, xp: u < 2e-3, False, False),
}


@pytest.mark.parametrize("name", TAILS)
def test_heavy_tails_are_told_from_long_and_narrow_ones(name):
    """By stratified points of 8 replicates, of 64 keys."""
    function, student, quantile = TAILS[name]
    u = (np.arange(512)[:, None] + np.random.default_rng(1).random((8, 512, 64))).reshape(-1, 64) / 512
    index = tail_index(1.0 * function(u, np))
    for kind, alarmed in (("student", student), ("quantile", quantile)):
        least = _intervals.RULES[kind].heavy
        assert alarmed is None or np.count_nonzero((index > least) == alarmed) >= 60


@pytest.mark.parametrize("name", few(TAILS, "x**-0.9", "log"))
def test_heavy_tails_are_reported(name):
    function, student, quantile = TAILS[name]
    ways = ("student", student, 'interval="quantile" is more'), ("quantile", quantile, "choose another")
    for kind, alarmed, advice in ways:
        found = estimate(lambda p: function(p[:, 0], jnp), kind, 3, n=512)
        assert alarmed is None or found.reached is not alarmed
        assert alarmed is not True or (found.reason.startswith("values are heavy") and advice in found.reason)


def test_products_of_coordinates_do_not_overflow():
    """XLA moves constant factors out of them, and the range of values was NaN."""
    found = qj.integrate(lambda p: jnp.prod(2 * p, axis=1), sequences.sobol(6), 256, replicates=4, key=1)
    low, high = found.interval(1 - 5e-7)
    assert low < 1 < high


# -- to a tolerance


def test_the_level_of_a_tolerance_is_for_all_numbers():
    def values(p):
        return p[:, :1] * jnp.arange(1, 6.0)[None], p

    found = estimate(values, "student", 1, n=2048, tolerance=1.0)
    assert found.level == 1 - 0.05 / (2 * (5 + 2))


@pytest.mark.parametrize("kind", ["student", *slow("median")])
def test_the_number_of_points_doubles_until_the_interval_is_small_enough(kind):
    """Not before; the estimate is that of the points at once; the integral is within the tolerance."""
    how = {"n": 2**16, "replicates": 10}
    found = estimate(smooth, kind, 2, tolerance=2e-5, **how)
    assert 1024 < found.n < 2**16 and found.n % 1024 == 0
    level = 1 - 0.05 / 7  # of 2**10 ... 2**16 points

    def half(estimate):
        low, high = estimate.interval(level)
        return float(high - low) / 2

    at_once = estimate(smooth, kind, 2, **how | {"n": found.n})
    with pytest.warns(RuntimeWarning, match="was not reached"):  # the programs of the first doublings
        before = estimate(smooth, kind, 2, **how | {"n": found.n // 2}, tolerance=1e-12)
    assert before.n == found.n // 2
    np.testing.assert_allclose(found.means, at_once.means, rtol=1e-14)
    assert half(found) <= 2e-5 < half(before)
    # What rounding adds is estimated from the first 1024 points, and not from 4096.
    np.testing.assert_allclose(half(found), half(at_once), rtol=1e-3)
    low, high = found.interval(level)
    assert abs((low + high) / 2 - 1) < 2e-5


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["median", "quantile"])
def test_medians_and_their_intervals_have_derivatives(kind):
    """They are proportional to a factor of the function, so the derivative at 1 is the value."""

    def scaled(factor):
        found = estimate(lambda p: factor * jnp.exp(p[:, 0]), kind, 1, replicates=6)
        ends = (each.astype(jnp.float32) for each in (found.integral, *found.interval(0.9)))
        return sum(weight * end for weight, end in zip((1, 2, 4), ends, strict=True))

    value, slope = jax.value_and_grad(scaled)(jnp.float32(1))
    assert abs(float(slope) - float(value)) < 1e-5


def test_a_tolerance_that_is_not_reached_is_reported():
    with pytest.warns(RuntimeWarning, match="tolerance=1e-09 was not reached with n=2048: the half width is"):
        found = estimate(smooth, "student", 1, n=3000, tolerance=1e-9)
    assert found.n == 2048
    assert found.reached is False and found.reason.startswith("tolerance=1e-09 was not reached with n=2048")
    few = estimate(smooth, "student", 1, n=100, tolerance=1.0)
    assert few.n == 100 and few.reached is True
    assert "was reached with n=100: the half width is " in few.reason


BY_KEY = jax.jit(lambda key: estimate(smooth, "student", key, tolerance=1.0))
test_bad_input_is_named = refused(
    (lambda: estimate(smooth, "median", 1, sequence=sequences.halton(2)), 'not be "median": sequence must'),
    (lambda: estimate(smooth, "betting", 1, limits=None), "limits must be two numbers .* got None"),
    (lambda: estimate(smooth, "betting", 1, limits=(-1e308, 1e308)), "limits must be .* finite difference"),
    (lambda: estimate(smooth, "betting", 1, limits=(0, 0.5)), "limits must bound all values, got"),
    (TypeError, lambda: estimate(smooth, "student", 1, tolerance=[1.0]), "tolerance must be a number, got"),
    (TypeError, lambda: BY_KEY(jax.random.key(1)), "tolerance must be None where the .* is traced"),
    (lambda: estimate(smooth, "median", 1, n=2**20, tolerance=1.0), "at least 9 for a tolerance, got 8"),
    (lambda: estimate(smooth, "median", 1, replicates=4).interval(0.9), "at most 0.875 with 4 replicates"),
    error=ValueError,
)

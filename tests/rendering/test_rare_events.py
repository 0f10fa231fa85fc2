"""What no replicate saw: intervals of indicators hold the probability, or say that they are not sure."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import rare_events
from scipy.stats import binom
from tables import slow

import qmcjax as qj
from qmcjax import sequences
from qmcjax.integration._estimate import estimate
from qmcjax.integration._intervals import most_unseen

SOBOL = sequences.sobol(1)


def below(edge):
    return lambda points: points[:, 0] < edge


def of_counts(counts, n, spread, limits=None, kind="student"):
    """Return what is made of replicates with so many ones among n zeros."""
    with jax.enable_x64(True):
        found = [jnp.asarray([count / n]) for count in counts]
        some, like = jnp.zeros((n, 1)), jax.ShapeDtypeStruct((4096, 1), jnp.bool_)
        how = {"n": n, "kind": kind, "limits": limits}
        return estimate(found, some, np.array([spread]), like, np.zeros(1), np.dtype(np.float32), **how)


@pytest.mark.parametrize("kind, replicates", [*(("student", n) for n in (4, 8, 32)), ("quantile", 32)])
@pytest.mark.parametrize("limits", [None, (0, 1)])
def test_counts_of_an_interval_cover_exactly(kind, replicates, limits):
    """Of x < p, a replicate has one of two counts, and all of them a binomial number of the larger one."""
    n, base = 64, 0 if limits else 3
    counts = base + (np.arange(replicates) < np.arange(replicates + 1)[:, None])
    made = [of_counts(each, n, 1.0, limits, kind) for each in counts]
    for level in (0.9, 0.95, 0.99):
        ends = np.array([each.interval(level) for each in made])[..., 0]
        for part in np.linspace(0, 1, 201):
            exact = (base + part) / n
            held = (ends[:, 0] <= exact) & (exact <= ends[:, 1])
            assert binom.pmf(np.arange(replicates + 1), replicates, part)[held].sum() >= level


@pytest.mark.parametrize("replicates", [2, 4, 8, 100, 65536])
def test_what_is_missed_by_all_replicates(replicates):
    """Counts of mean and variance m are 0 with a probability of 1 / (1 + m) if they are 0 or 1 + m."""
    most = most_unseen(replicates, 0.95) / replicates
    assert (1 / (1 + most)) ** replicates == pytest.approx(0.025, rel=1e-9)
    assert most * replicates > -np.log(0.025)  # of independent points


@pytest.mark.parametrize("kind", ["student", *slow("median", "quantile")])
def test_equal_values_are_no_certainty(kind):
    """An event of probability 1e-4 that 8 * 64 points miss."""
    how = {"replicates": 8, "key": 2, "interval": kind}
    found = qj.integrate(below(1e-4), SOBOL, 64, **how)
    assert found.reached is False and "all 512 values seen are equal" in found.reason
    with pytest.warns(RuntimeWarning, match="below 0.0092 may have been missed: pass limits, or more points"):
        assert float(found.interval()[1]) < 1e-30
    bounded = qj.integrate(below(1e-4), SOBOL, 64, limits=(0, 1), **how)
    low, high = bounded.interval()
    assert bounded.reached is True and bounded.reason is None
    assert -1e-30 < low < 1e-4 < high < 0.016
    with pytest.warns(RuntimeWarning, match=r"tolerance=0.0001 was not reached with n=128: all 1536 values"):
        asked = qj.integrate(below(1e-5), SOBOL, 128, **how | {"replicates": 12}, tolerance=1e-4)
    assert asked.reached is False


def test_numbers_of_a_tree_that_are_equal_are_counted():
    def values(points):
        return {"x": points[:, 0], "rare": points < 1e-6, "both": points * jnp.float32([[1, 0]])}

    found = qj.integrate(values, SOBOL, 64, replicates=4, key=1)
    assert found.reason.startswith("all 256 values seen of 2 of the function's 4 numbers are equal")


def test_a_later_value_counts_with_its_range():
    """The first 4096 points of the first replicate miss the event, and all means tell that it came."""
    found = qj.integrate(lambda p: jnp.where(p[:, 0] < 3e-5, 5.0, 0.0), SOBOL, 2**15, replicates=8, key=3)
    first = sequences.owen(SOBOL, jax.random.split(jax.random.key(3), 8)[0]).points(4096)
    assert (first > 3e-5).all() and (found.means > 0).any() and found.reached is True
    assert found.unseen == 5 / (8 * 2**15)


def test_equal_means_of_a_smooth_function_are_no_counts():
    """Linear scrambling makes many means of x equal up to rounding: its interval stays as narrow as that."""
    how = {"replicates": 16, "key": 1, "interval": "median", "dtype": jnp.float64}
    found = qj.integrate(lambda p: p[:, 0], SOBOL, 1024, **how)
    low, high = found.interval()
    assert np.diff(np.sort(found.means)).min() < 1e-15
    assert found.unseen == 0 and high - low < 1e-6


def test_numbers_too_small_for_float32_are_no_certainty():
    found = qj.integrate(lambda p: p[:, 0] * np.float32(1e-38), SOBOL, 64, replicates=8, key=1)
    with pytest.warns(RuntimeWarning, match="are equal"):
        low, high = found.interval()
    assert low < 0.5e-38 < high


@pytest.mark.parametrize("dtype, seen", [(jnp.float32, 1.0), (jnp.float64, 0.5)])
def test_a_bit_below_the_grid_of_the_points(dtype, seen):
    """Bit 24 of a point is 1 in the centres of cells of side 2**-23; betting holds the mean over these."""

    def bit(points):
        return jnp.mod(jnp.floor(points[:, 0] * 2**24), 2)

    found = qj.integrate(bit, SOBOL, 16, replicates=64, key=1, interval="betting", limits=(0, 1), dtype=dtype)
    low, high = found.interval()
    assert low <= seen <= high and (low > 0.5) == (seen == 1)


MORE = [
    (n, replicates, limits, max(10, min(200, 2**23 // (n * replicates))))
    for n, counts in ((2**4, (4, 8, 32)), (2**10, (4, 8, 32)), (2**16, (4, 8)), (2**20, (4,)))
    for replicates in counts
    for limits in (False, True)
]


@pytest.mark.parametrize("cell", [(256, 4, False, 20), *slow(*MORE)], ids=str)
def test_intervals_of_indicators_hold_or_are_not_sure(cell):
    """Of 8 events with 14 probabilities; Student's interval of the means alone misses the rare ones."""
    found, (n, replicates, limits, trials) = rare_events.cell(*cell), cell
    assert (found.held + found.unsure >= 0.95 - 5 * np.sqrt(0.95 * 0.05 / trials)).all()
    if limits:
        assert (found.unsure == 0).all()
    elif n <= 2**10:
        assert found.alone.min() < 0.5 and found.unsure.max() > 0.9
    common = n * replicates * rare_events.EXACT.min(axis=-1)[0] > 100
    assert (found.unsure[:, common] == 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("limits", [False, True])
def test_tolerances_that_are_reached_hold(limits):
    """Of 640 results, with up to 8 * 2**16 points; with limits also those of events that never came."""
    reached, within = rare_events.stop_at_tolerance(range(10), 2**16, limits, (0, 2, 4, 6))
    wrong = (reached & ~within).mean(axis=-1)
    assert (wrong <= 0.05 + 5 * np.sqrt(0.05 * 0.95 / 10)).all()
    assert wrong.mean() <= 0.05
    assert reached[:, 2:].mean() > 0.9
    assert (reached[:, 0].mean() > 0.9) == limits  # of a probability of 1e-6


def test_traced_replicates_make_no_doubt():
    """Where nothing is known; the interval is that of the values, without a warning."""

    @jax.jit
    def traced(key):
        found = qj.integrate(below(1e-6), SOBOL, 64, replicates=4, key=key)
        assert found.reached is None and found.reason is None
        return found.interval()

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        low, high = map(float, traced(jax.random.key(1)))
    assert -1e-30 < low <= high < 1e-30

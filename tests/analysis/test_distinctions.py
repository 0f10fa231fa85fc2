"""Statements about samplers from few keys: how often they are false, and that they are Holm's."""

from itertools import combinations
from math import inf

import numpy as np
import pytest
from scipy import stats

from analysis import Comparison, ComparisonRow
from qmcjax.core import student

TRIALS = 400


def row(sampler, values, spp=1):
    nothing = np.zeros(1)
    of = {"RMS error": tuple(map(float, values))}
    return ComparisonRow("s", sampler, spp, of, 0.0, nothing, nothing, np.zeros((2, 2), np.float32))


def compared(*values):
    rows = tuple(row(f"sampler {k}", each) for k, each in enumerate(values))
    return Comparison(rows, {}, {}, {}, {})


def normal(rng, size):
    """Of images: root mean squares over pixels, which scatter by a few per cent; others have heavy tails."""
    return 0.1 * (1 + 0.05 * rng.standard_normal(size))


def lognormal(rng, size):
    return np.exp(rng.standard_normal(size))


def heavy(rng, size):
    """With logarithms that have no third moment."""
    return 0.1 * np.exp(0.3 * rng.standard_t(3, size))


ERRORS = {"normal": normal, "lognormal": lognormal, "heavy": heavy}
MEANS = {"normal": np.log(0.1) - 0.05**2 / 2, "lognormal": 0.0, "heavy": np.log(0.1)}
"""Of the logarithms; that of the normal ones to 5e-6."""


def most(part, trials=TRIALS):
    """Return the part of trials that 5 standard deviations above this one are."""
    return part + 5 * np.sqrt(part * (1 - part) / trials)


@pytest.mark.parametrize("errors", ERRORS)
@pytest.mark.parametrize(("samplers", "keys"), [(2, 4), (2, 8), (3, 4), (6, 4), (12, 16)])
def test_identical_samplers_are_told_apart_in_5_of_100_cases_at_most(samplers, keys, errors):
    """In any place of the table of ranks: an interval that is not [1, n] is a distinction."""
    rng = np.random.default_rng(samplers + 100 * keys)
    false = 0
    for _ in range(TRIALS):
        ranks = compared(*ERRORS[errors](rng, (samplers, keys))).ranks("s", 1)
        false += any((low, high) != (1, samplers) for _, low, high in ranks.values())
    assert false / TRIALS < most(0.05)


@pytest.mark.parametrize("errors", ERRORS)
@pytest.mark.parametrize("keys", [4, 8, 16])
def test_intervals_hold_the_mean(keys, errors):
    """The geometric mean over all keys."""
    rng = np.random.default_rng(keys)
    found = [row("a", values).interval("RMS error") for values in ERRORS[errors](rng, (TRIALS, keys))]
    missed = np.mean([not low < np.exp(MEANS[errors]) < high for low, high in found])
    assert missed < most(0.05)


@pytest.mark.parametrize("errors", ERRORS)
@pytest.mark.parametrize(("keys", "shared"), [(4, False), (8, False), (8, True)])
def test_intervals_hold_the_slope(keys, shared, errors):
    """Whether or not errors of the same key at different numbers of samples have something in common."""
    rng = np.random.default_rng(keys)
    spps, missed = (1, 4, 16), 0
    for _ in range(TRIALS):
        own = ERRORS[errors](rng, (3, keys))
        common = ERRORS[errors](rng, keys) if shared else 1.0
        rows = tuple(row("a", own[k] * common * spp**-0.7, spp) for k, spp in enumerate(spps))
        _, low, high = Comparison(rows, {}, {}, {}, {}).slope("s", "a")
        missed += not low < -0.7 < high
    assert missed / TRIALS < most(0.05)


def p_value(values, first, second, margin):
    """Of the hypothesis that one mean is not the larger by more than this under each condition."""
    ways = values[:, first] - values[:, second], values[:, second] - values[:, first]
    p = [stats.ttest_1samp(way, margin, axis=1, alternative="greater").pvalue.max() for way in ways]
    return 2 * min(p)


@pytest.mark.parametrize("margin", [0.0, 0.4])
@pytest.mark.parametrize("conditions", [1, 2])
def test_differences_are_those_of_holm(conditions, margin):
    """Against scipy's tests of each pair, and the procedure as it is printed."""
    rng = np.random.default_rng(conditions)
    samples, n, told = 5, 7, []
    for _ in range(8):
        values = np.linspace(0, 3, samples)[:, None] + 0.5 * rng.standard_normal((conditions, samples, n))
        low, high = student.differences(values, margin)
        np.testing.assert_array_equal(low, -high.T)
        pairs = list(combinations(range(samples), 2))
        p = {(i, j): p_value(values, i, j, margin) for i, j in pairs}
        left = sorted(pairs, key=p.__getitem__)
        while len(left) > 1 and p[left[0]] <= 0.05 / len(left):
            left.pop(0)
        level = 1 - 0.05 / len(left)
        rejected = {pair for pair in pairs if p[pair] <= 0.05 / len(left)}
        assert rejected == {(i, j) for i, j in pairs if low[i, j] > margin or low[j, i] > margin}
        told.append(len(rejected))
        for i, j in pairs:
            of = [stats.ttest_rel(each[i], each[j]).confidence_interval(level) for each in values]
            np.testing.assert_allclose(low[i, j], min(each.low for each in of))
            np.testing.assert_allclose(high[i, j], max(each.high for each in of))
    assert 0 < min(told) < max(told) <= len(pairs)


def test_samples_without_scatter():
    """Only a sign decides: differences of 0 are none."""
    values = np.array([[[1.0] * 5, [1.0] * 5, [2.0] * 5]])
    low, high = student.differences(values)
    np.testing.assert_array_equal(low, values[0, :, None, 0] - values[0, None, :, 0])
    np.testing.assert_array_equal(low, high)
    assert (student.differences(values, 1.0)[0] <= 1).all()
    # A pair that is alike is one of the three that are left.
    values[0, 2] = [1.0, 1.1, 1.2, 0.7, 1.3]
    interval = stats.ttest_rel(values[0, 2], values[0, 0]).confidence_interval(1 - 0.05 / 3)
    assert student.differences(values)[0][2, 0] == pytest.approx(interval.low)


@pytest.mark.parametrize("keys", [1, 2, 3])
def test_fewer_than_4_keys_say_nothing(keys):
    rng = np.random.default_rng(keys)
    errors = np.array([1.0, 2.0, 1e6])[:, None] * (1 + 1e-6 * rng.random((3, keys)))
    few = compared(*errors)
    assert [rank for rank, *_ in few.ranks("s", 1).values()] == [1, 2, 3]
    assert {tuple(between) for _, *between in few.ranks("s", 1).values()} == {(1, 3)}
    assert {each.interval("RMS error") for each in few.rows} == {(0.0, inf)}
    rows = tuple(row("a", values, spp) for values, spp in zip(errors, (1, 4, 16), strict=True))
    assert Comparison(rows, {}, {}, {}, {}).slope("s", "a")[1:] == (-inf, inf)


def test_what_has_no_key_or_no_error_has_no_certain_rank():
    """The others keep theirs, and are not compared with it."""
    errors = np.array([1.0, 2.0])[:, None] * (1 + 1e-3 * np.random.default_rng(1).random((2, 8)))
    fixed, exact = [1e-6], [0.0, *[1e-6] * 7]
    ranks = compared(*errors, fixed, exact).ranks("s", 1)
    assert list(ranks.values()) == [(3, 1, 3), (4, 2, 4), (2, 1, 4), (1, 1, 4)]
    assert row("a", exact).interval("RMS error") == (0.0, inf) and row("a", exact).mean("RMS error") == 0


def test_power_grows_with_keys_and_pairs_share_what_keys_have_in_common():
    """Errors of a key that are all large, or all small, are told apart all the same."""
    rng = np.random.default_rng(2)
    common = np.exp(rng.standard_normal(8))
    errors = common * np.array([1.0, 1.2])[:, None] * (1 + 0.05 * rng.random((2, 8)))
    assert list(compared(*errors).ranks("s", 1).values()) == [(1, 1, 1), (2, 2, 2)]
    assert row("a", errors[0]).interval("RMS error")[1] > 1.2 * row("a", errors[1]).interval("RMS error")[0]

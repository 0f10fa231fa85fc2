"""Statements about means, judged by intervals: true, false, or neither."""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from figures.making.schema import UNDECIDED
from qmcjax.core import student


def interval(values: ArrayLike) -> dict[str, float]:
    """Return the mean of independent values and, of enough of them, the ends of its interval of 95 %."""
    values = np.asarray(values, np.float64)
    low, high = student.interval(values)
    return {"mean": float(np.mean(values))} | ({"low": low, "high": high} if np.isfinite(low) else {})


def ratio(first: ArrayLike, second: ArrayLike) -> dict[str, float]:
    """Return the geometric mean of ratios of positive values, and the ends of its interval of 95 %."""
    logs = np.log(np.asarray(first, np.float64) / np.asarray(second, np.float64))
    return {end: float(np.exp(value)) for end, value in interval(logs).items()}


class Ratio(NamedTuple):
    """A geometric mean of ratios, and the ends of its interval of 95 %."""

    middle: float
    low: float
    high: float


def of_logarithms(values: ArrayLike) -> Ratio:
    """Return the geometric mean of ratios of the independent cases, whose logarithms are given."""
    logs = np.asarray(values, np.float64)
    return Ratio(*(float(np.exp(value)) for value in (logs.mean(), *student.interval(logs))))


def ratios(cases: Mapping[str, Mapping[str, ArrayLike]], one: str, other: str) -> dict[str, dict[str, float]]:
    """Return the ratio of the positive values of two names in each case."""
    return {case: ratio(of[one], of[other]) for case, of in cases.items()}


def below(values: ArrayLike, limit: float) -> bool | str:
    """Return whether the mean of independent values is below a limit, by its interval of 95 %.

    `UNDECIDED` if the interval contains the limit.
    """
    low, high = student.interval(np.asarray(values, np.float64))
    return True if high < limit else False if low > limit else UNDECIDED


def smaller(first: ArrayLike, second: ArrayLike, factor: float = 1.0) -> bool | str:
    """Return whether positive values are below ``factor`` times others of the same keys, on average."""
    ratios = np.asarray(first, np.float64) / np.asarray(second, np.float64)
    return below(np.log(ratios), float(np.log(factor)))


def alike(first: ArrayLike, second: ArrayLike, factor: float) -> bool | str:
    """Return whether positive values are within a factor of others, in both directions, on average."""
    return all_of(smaller(first, second, factor), smaller(second, first, factor))


def falls(counts: ArrayLike, values: ArrayLike) -> bool | str:
    """Return whether positive values fall with the number of samples: by the exponent's interval of 95 %."""
    from scipy import stats

    x, y = np.log(np.asarray(counts, np.float64)), np.log(np.asarray(values, np.float64))
    if len(x) < 4:
        return UNDECIDED
    slope, _, _, _, error = stats.linregress(x, y)
    half = stats.t.ppf(0.975, len(x) - 2) * error
    return True if slope + half < 0 else False if slope - half > 0 else UNDECIDED


def all_smaller(
    of: Mapping[str, ArrayLike], ones: Iterable[str], others: Iterable[str], factor: float = 1.0
) -> bool | str:
    """Return whether positive values of some names are below ``factor`` times those of all others."""
    return all_of(*(smaller(of[one], of[other], factor) for one, other in product(ones, others)))


def all_of(*found: bool | str) -> bool | str:
    """Return whether statements hold together."""
    return False if False in found else UNDECIDED if UNDECIDED in found else True


def any_of(*found: bool | str) -> bool | str:
    """Return whether one of some statements holds."""
    return True if True in found else UNDECIDED if UNDECIDED in found else False

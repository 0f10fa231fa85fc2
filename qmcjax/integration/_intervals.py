"""Confidence intervals without normality: of a mean by betting, of a median by order statistics.

A gambler who bets that the mean exceeds m, staking a part of the capital on each value in turn, expects no
gain if it does not; by Markov's inequality the capital then rarely reaches 1 / alpha. All m for which it does
lie below the interval, and likewise above [1]_. Bets depend only on earlier values, and are large if these
vary little.

References
----------
.. [1] I. Waudby-Smith, A. Ramdas, "Estimating Means of Bounded Random Variables by Betting", J. R. Stat. Soc.
   B 86, 2024.
.. [2] J. R. M. Hosking, J. R. Wallis, "Parameter and Quantile Estimation for the Generalized Pareto
   Distribution", Technometrics 29, 1987.
"""

import math
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

_PART = 0.75
"""Largest fraction of the capital that a bet can lose."""

_STEPS = 60
"""Number of bisection steps."""


def betting_interval(values: Any, level: float, xp: Any = np) -> tuple[Any, Any]:
    """Return an interval for the mean of values in [0, 1] that fails with probability 1 - ``level``.

    ``values``: shape (count, ...), independent along the first axis. ``xp``: their module, NumPy or ``jnp``.
    """
    needed = math.log(2 / (1 - level))
    bets = _bets(values, needed, xp)
    return _low(values, bets, needed, xp), 1 - _low(1 - values, bets, needed, xp)


def _bets(values: Any, needed: float, xp: Any) -> Any:
    """Return the best bets for a normal distribution with the variance of the preceding values."""
    count = len(values)
    number = xp.arange(1, count + 1, dtype=values.dtype).reshape(count, *(1,) * (values.ndim - 1))
    mean = (0.5 + xp.cumsum(values, axis=0)) / (number + 1)
    variance = (0.25 + xp.cumsum((values - mean) ** 2, axis=0)) / (number + 1)
    before = xp.concatenate([xp.full_like(variance[:1], 0.25), variance[:-1]])
    return xp.sqrt(2 * needed / (count * before))


def _low(values: Any, bets: Any, needed: float, xp: Any) -> Any:
    """Return the largest mean for which bets on a larger one reach the needed capital, 0 if there is none."""

    def halved(_: Any, ends: tuple[Any, Any]) -> tuple[Any, Any]:
        low, high = ends
        middle = (low + high) / 2
        stakes = xp.minimum(bets, _PART / middle[None])
        reached = xp.sum(xp.log1p(stakes * (values - middle[None])), axis=0) >= needed
        return xp.where(reached, middle, low), xp.where(reached, high, middle)

    ends = xp.zeros_like(values[0]), xp.ones_like(values[0])
    if xp is not np:
        return jax.lax.fori_loop(0, _STEPS, halved, ends)[0]
    for step in range(_STEPS):
        ends = halved(step, ends)
    return ends[0]


def rank(count: int, level: float) -> int:
    """Return the largest k for which the k-th smallest and k-th largest value enclose the median.

    They do so with a probability of at least ``level``, for any distribution. 0 if there is no such k: it
    takes 1 - log2(1 - level) values.
    """
    from scipy.special import bdtr

    # The median is outside if fewer than k values lie on one side of it.
    ranks = np.arange(1, count // 2 + 1)
    return int(np.count_nonzero(1 - 2 * bdtr(ranks - 1, count, 0.5) >= level))


def rank_interval(values: NDArray, level: float) -> tuple[NDArray, NDArray]:
    """Return the ends of the interval for the median, shape (...), of ``values``, shape (count, ...)."""
    place = rank(len(values), level)
    ordered = np.sort(values, axis=0)
    return ordered[place - 1], ordered[len(values) - place]


def tail_index(values: NDArray) -> NDArray:
    """Return the index of the heavier tail of each column, shape (count, columns), or 0.

    For an index c, values above v have a probability like v**(-1 / c). Their excesses over a large value are
    generalised Pareto, which gives c by L-moments [2]_: here of the 128 largest of 4096 values. 0 if the 32
    largest alone have a negative index, since narrow peaks look heavy from afar; for fewer than 512 values;
    and if at most half of the largest are distinct (counts).
    """
    found = np.zeros(values.shape[1])
    most = min(len(values) // 16, 128)
    if most < 32:
        return found
    for side in (values, -values):
        largest = np.sort(np.partition(side, -most - 1, axis=0)[-most - 1 :], axis=0)
        highest, high = (_pareto_index(largest[-count - 1 :]) for count in (max(most // 4, 16), most))
        found = np.maximum(found, np.where(highest > 0, high, 0))
    return found


def _pareto_index(ordered: NDArray) -> NDArray:
    excesses = ordered[1:] - ordered[0]
    count = len(excesses)
    distinct = np.count_nonzero(np.diff(ordered, axis=0), axis=0) > count // 2
    weights = (2 * np.arange(count) - (count - 1)) / (count - 1)
    mean, half_difference = excesses.mean(axis=0), (weights[:, None] * excesses).mean(axis=0)
    return np.where(distinct, 2 - mean / np.where(distinct, half_difference, 1), 0)

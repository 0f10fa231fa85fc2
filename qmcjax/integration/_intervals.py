"""Confidence intervals without normality: of a mean by betting, of a median by order statistics.

Who bets on the mean being larger than m, a part of the capital on each value in turn, expects no gain if it
is not; by Markov's inequality the capital then seldom reaches 1 / alpha. All m that it is reached for are
below the interval; likewise above [1]_. Bets depend on earlier values only, and are large where these vary
little.

References
----------
.. [1] I. Waudby-Smith, A. Ramdas, "Estimating Means of Bounded Random Variables by Betting", J. R. Stat. Soc.
   B 86, 2024.
"""

import math
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

_PART = 0.75
"""Of the capital, that a bet can lose at most."""

_STEPS = 60
"""Of bisection."""


def betting_interval(values: Any, level: float, xp: Any = np) -> tuple[Any, Any]:
    """Return an interval of the mean of values in [0, 1] that fails with a probability of 1 - ``level``.

    ``values``: shape (count, ...), independent along the first axis. ``xp``: NumPy, or its like for them.
    """
    needed = math.log(2 / (1 - level))
    bets = _bets(values, needed, xp)
    return _low(values, bets, needed, xp), 1 - _low(1 - values, bets, needed, xp)


def _bets(values: Any, needed: float, xp: Any) -> Any:
    """Return what would be best for a normal distribution with the variance of the values before."""
    count = len(values)
    number = xp.arange(1, count + 1, dtype=values.dtype).reshape(count, *(1,) * (values.ndim - 1))
    mean = (0.5 + xp.cumsum(values, axis=0)) / (number + 1)
    variance = (0.25 + xp.cumsum((values - mean) ** 2, axis=0)) / (number + 1)
    before = xp.concatenate([xp.full_like(variance[:1], 0.25), variance[:-1]])
    return xp.sqrt(2 * needed / (count * before))


def _low(values: Any, bets: Any, needed: float, xp: Any) -> Any:
    """Return the largest mean at which the capital of bets on a larger one is reached; 0 if there is none."""

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
    """Return the largest k for which the k-th smallest and largest of some values enclose their median.

    With a probability of at least ``level``, whatever the distribution. 0 if there is none: it takes
    1 - log2(1 - level) values.
    """
    from scipy.special import bdtr

    # The median lies outside if fewer than k values are on one of its sides.
    ranks = np.arange(1, count // 2 + 1)
    return int(np.count_nonzero(1 - 2 * bdtr(ranks - 1, count, 0.5) >= level))


def rank_interval(values: NDArray, level: float) -> tuple[NDArray, NDArray]:
    """Return the interval of the median: ``values`` of shape (count, ...) to low and high, shape (...)."""
    place = rank(len(values), level)
    ordered = np.sort(values, axis=0)
    return ordered[place - 1], ordered[len(values) - place]

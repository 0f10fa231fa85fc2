"""Confidence intervals without normality: of a mean by betting, of a median by order statistics.

A gambler who bets that the mean exceeds m, staking a part of the capital on each value in turn, expects no
gain if it does not; by Markov's inequality the capital then rarely reaches 1 / alpha. All m for which it does
lie below the interval, and likewise above [1]_. Bets depend only on earlier values, and are large if these
vary little.

References
----------
.. [1] I. Waudby-Smith, A. Ramdas, "Estimating Means of Bounded Random Variables by Betting", J. R. Stat. Soc.
   B 86, 2024.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

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


def of_rank(values: Any, place: int, xp: Any = np) -> Any:
    """Return the values of a rank, counted from 0, along the first axis, with derivatives.

    JAX computes derivatives outside the float64 mode of a program, where those of ``jnp.sort`` fail.
    """
    if xp is np:
        return np.sort(values, axis=0)[place]
    ranks = jnp.argsort(jnp.argsort(jax.lax.stop_gradient(values), axis=0), axis=0)
    return jnp.sum(values * (ranks == place).astype(values.dtype), axis=0)


COUNTED = 3
"""Weight of the squared unseen part in the squared standard error."""


def most_unseen(replicates: int, level: float) -> float:
    """Return the maximum expected count, over all replicates, of an event that none of them saw.

    If it is expected m times in a replicate, with a variance of at most m as for independent points, the
    replicate sees it with a probability of at least m / (1 + m), by Cantelli's inequality. All replicates
    miss it with a probability of at most (1 - level) / 2 if m is at least the returned number divided by
    ``replicates``. The number tends to -log((1 - level) / 2), the rule of three for independent points.
    """
    return replicates * (((1 - level) / 2) ** (-1 / replicates) - 1)


class Replicates(NamedTuple):
    """Numbers of an estimate: arrays of the module ``xp``, NumPy or ``jnp``."""

    xp: Any
    integral: Any
    error: Any
    unseen: Any
    means: Any
    limits: tuple[float, float] | None


def _student(of: Replicates, level: float) -> tuple[Any, Any]:
    from scipy.special import stdtrit

    count = len(of.means)
    quantile = float(stdtrit(count - 1, (1 + level) / 2))
    # The standard error includes a part for unseen events.
    more = max(most_unseen(count, level) ** 2 - COUNTED * quantile**2, 0)
    half = quantile * of.error
    if more:
        half = of.xp.sqrt(of.xp.square(half) + more * of.xp.square(of.unseen))
    return of.integral - half, of.integral + half


def _ranks(of: Replicates, level: float) -> tuple[Any, Any]:
    count = len(of.means)
    place = rank(count, level)
    if not place:
        raise ValueError(
            f"level must be at most {1 - 2.0 ** (1 - count):g} with {count} replicates, got {level!r}"
        )
    # The mean of counts differs from their median, by one count if events are rare.
    more = max(most_unseen(count, level), count) * of.unseen
    return of_rank(of.means, place - 1, of.xp) - more, of_rank(of.means, count - place, of.xp) + more


def _betting(of: Replicates, level: float) -> tuple[Any, Any]:
    assert of.limits is not None
    least, most = of.limits
    unit = of.xp.clip((of.means - least) / (most - least), 0, 1)
    low, high = betting_interval(unit, level, of.xp)
    return least + (most - least) * low, least + (most - least) * high


class Rule(NamedTuple):
    """How the ends of an interval follow from the replicates."""

    ends: Callable[[Replicates, float], tuple[Any, Any]]
    by_ranks: bool
    """Whether the integral is the median of the replicates, and the ends are order statistics."""
    heavy: float
    """Tail index from which intervals are unreliable."""
    advice: str = ""


_MEDIANS = Rule(
    _ranks, True, 0.55, "medians of means are far from the integral, choose another variable of integration"
)
RULES = {
    "student": Rule(
        _student, False, 0.3, 'interval="quantile" is more reliable, or another variable of integration'
    ),
    "median": _MEDIANS,
    "quantile": _MEDIANS,
    "betting": Rule(_betting, False, math.inf),
}
"""By the kind of an interval."""

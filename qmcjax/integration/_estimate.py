"""Estimates of an integral from replicates."""

import math
import warnings
from dataclasses import field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.integration._doubts import LEAST, doubt, largest, tail_index
from qmcjax.integration._intervals import COUNTED, RULES, Replicates, of_rank, rank
from qmcjax.integration._means import of_columns


@frozen_pytree
class Estimate:
    """An integral from independent replicates, with its error.

    Results are float64, in the structure of the values.
    """

    integral: Any
    """The mean of the replicates; for "median" and "quantile" intervals their median."""
    standard_error: Any
    """Standard error of the mean; see :func:`integrate` for counts."""
    rounding: Any
    """Rounding error, which the replicates do not show: see :func:`integrate`."""
    means: Any
    """Mean of each replicate, with a first axis of length ``replicates``."""
    unseen: Any
    """If values take few levels and two means are equal, the range of values divided by their number; else 0.

    Infinite if all observed values are equal and there are no limits."""
    tail: Any
    """Tail index c: values above v have a probability like v**(-1 / c); 0 if light, or values are traced."""
    displacement: Any
    """How far rounding moves points of ``bounds``, as a part of the side; of 1 if that is infinite."""
    replicates: int = field(metadata={"static": True})
    """Number of replicates."""
    n: int = field(metadata={"static": True})
    """Number of points of each replicate."""
    kind: str = field(default="student", metadata={"static": True})
    """Kind of the intervals, as passed to :func:`integrate`."""
    limits: tuple[float, float] | None = field(default=None, metadata={"static": True})
    """Bounds of the function's values."""
    tolerance: float | None = field(default=None, metadata={"static": True})
    """The requested tolerance."""
    level: float = field(default=0.95, metadata={"static": True})
    """Level of the interval that is compared with the tolerance, of each number."""

    def __repr__(self) -> str:
        error = f"standard_error={self.standard_error!r}"
        return f"Estimate(integral={self.integral!r}, {error}, n={self.n}, replicates={self.replicates})"

    @property
    def reached(self) -> bool | None:
        """Whether the interval is reliable and, with a tolerance, small enough.

        None if values are traced.
        """
        if self._traced():
            return None
        return not doubt(self) and (self.tolerance is None or self._half_width() <= self.tolerance)

    @property
    def reason(self) -> str | None:
        """Why the points sufficed or not; None without a tolerance or a doubt, or if values are traced."""
        if self._traced():
            return None
        why = doubt(self)
        if self.tolerance is None:
            return why
        state = "was reached" if self.reached else "was not reached"
        why = why or f"the half width is {self._half_width():g}"
        rounding = largest(self.rounding)
        if rounding > self.tolerance:
            why += f", of which rounding makes {rounding:g}"
        return f"tolerance={self.tolerance:g} {state} with n={self.n}: {why}"

    def interval(self, level: float = 0.95) -> tuple[Any, Any]:
        """Return a confidence interval of the integral, widened by ``rounding``.

        Its kind is that passed to :func:`integrate`. The level is that of each number; k numbers are in their
        intervals together with a probability of at least 1 - k (1 - level). A RuntimeWarning is emitted if
        the interval is unreliable, see ``reason``; ``reached`` is then False.

        Parameters
        ----------
        level : float
            Confidence level, in (0, 1). For "median" and "quantile" at most 1 - 2**(1 - replicates).

        Returns
        -------
        low, high, float64, in the structure of the values
        """
        level = _level(level)
        if not self._traced() and (why := doubt(self)):
            warnings.warn(why, RuntimeWarning, stacklevel=2)
        return self._interval(level)

    def _interval(self, level: float) -> tuple[Any, Any]:
        def ends(rounding: Any, integral: Any, error: Any, unseen: Any, means: Any) -> tuple[Any, Any]:
            xp: Any = jnp if any(isinstance(each, Tracer) for each in (rounding, means)) else np
            unseen = xp.where(xp.isinf(unseen), 0, unseen)
            of = Replicates(xp, integral, error, unseen, means, self.limits)
            low, high = RULES[self.kind].ends(of, level)
            if self.limits is not None:
                low, high = (xp.clip(end, *self.limits) for end in (low, high))
            return low - rounding, high + rounding

        numbers = self.rounding, self.integral, self.standard_error, self.unseen, self.means
        structure = jax.tree.structure(self.integral)
        with jax.enable_x64(True):  # or traced values would become float32 here
            found = list(map(ends, *map(jax.tree.leaves, numbers)))
        return structure.unflatten(low for low, _ in found), structure.unflatten(high for _, high in found)

    def _half_width(self) -> float:
        low, high = self._interval(self.level)
        return largest(jax.tree.map(lambda low, high: high - low, low, high)) / 2

    def _traced(self) -> bool:
        return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(self.standard_error))


def validate_limits(limits: Any, kind: str, replicates: int | None) -> tuple[float, float] | None:
    """Validate bounds of values: required for betting intervals, and allowed only with replicates."""
    if limits is None:
        if kind == "betting":
            raise ValueError('limits must be two numbers for interval="betting", got None')
        return None
    if replicates is None:
        raise ValueError(f"limits must be None without replicates, got {checks.shown(limits)}")
    wanted = "two finite numbers, the lower one first, with a finite difference"
    known = checks.known_array("limits", limits, np.number, wanted)
    real = known.shape == (2,) and not np.iscomplexobj(known)
    least, most = map(float, known) if real else (math.nan, math.nan)
    if not 0 < most - least < math.inf:
        raise ValueError(f"limits must be {wanted}, got {checks.shown(limits)}")
    return least, most


def limits_of_integral(limits: tuple[float, float], volume: float) -> tuple[float, float]:
    """Return the bounds of the integral over a box of known, finite volume."""
    least, most = limits[0] * volume, limits[1] * volume
    if not math.isfinite(most - least):
        raise ValueError(f"limits must be None for bounds of an infinite or unknown volume, got {limits}")
    return least, most


def _check_means(means: Array, made: Estimate, limits: tuple[float, float]) -> None:
    """Raise a ValueError if the mean of a replicate exceeds the bounds by more than rounding."""
    if isinstance(means, Tracer):
        return
    allowed = largest(made.rounding)
    if means.min() < limits[0] - allowed or means.max() > limits[1] + allowed:
        raise ValueError(
            f"limits must bound all values, got {limits}, and means in [{means.min()}, {means.max()}]"
        )


_FIRST = 1024
"""Points per replicate before an interval is first compared with a tolerance."""

_ERROR = 0.05
"""Probability that any of these intervals misses the integral of any number."""


def doublings(
    tolerance: Any, n: int, replicates: int | None, kind: str, numbers: int
) -> tuple[list[int], float]:
    """Return the numbers of points at which to compare intervals with a tolerance, and the level of each."""
    checks.positive("tolerance", tolerance)
    if isinstance(tolerance, Tracer) or np.ndim(tolerance):
        raise TypeError(f"tolerance must be a number, got {checks.shown(tolerance)}")
    if replicates is None:
        raise ValueError(f"tolerance must be None without replicates, got {checks.shown(tolerance)}")
    sizes = [min(n, _FIRST)]
    while 2 * sizes[-1] <= n and n > _FIRST:
        sizes.append(2 * sizes[-1])
    level = 1 - _ERROR / (len(sizes) * numbers)
    if RULES[kind].by_ranks and not rank(replicates, level):
        least = math.ceil(1 - math.log2(1 - level))
        of = f" of {numbers} numbers" if numbers > 1 else ""
        raise ValueError(f"replicates must be at least {least} for a tolerance{of}, got {replicates}")
    return sizes, level


def _level(level: Any) -> float:
    if isinstance(level, bool) or not isinstance(level, float | int | np.floating):
        raise TypeError(f"level must be a number in (0, 1), got {checks.shown(level)}")
    if not 0 < level < 1:
        raise ValueError(f"level must be a number in (0, 1), got {level!r}")
    return float(level)


_FEW = 256
"""Number of values of which at least half are distinct, unless a function takes few values (counts)."""


def _median(values: Array) -> Array:
    middle = len(values) // 2
    return (of_rank(values, len(values) - 1 - middle, jnp) + of_rank(values, middle, jnp)) / 2


def estimate(
    found: list[Array], some: Array, spread: Any, like: Any, moved: Any, dtype: np.dtype, **settings: Any
) -> Estimate:
    """Return the mean or median of replicates, the standard error, and the rounding error.

    ``some``: columns of a few values; ``spread``: range of the observed values, shape (columns,); ``moved``:
    how far rounding moves points along each side, shape (dims,); ``settings``: static fields of the estimate.
    """
    known = not any(isinstance(each, Tracer) for each in (*found, some))
    spread, limits = np.asarray(spread) if known else spread, settings["limits"]
    reach: Any = spread if limits is None else np.full(spread.shape, limits[1] - limits[0])
    made_of = (_compiled_columns if known else _columns)(
        tuple(found), some, spread, reach, settings["n"], RULES[settings["kind"]].by_ranks
    )
    means, middle, error, magnitude, unseen = jax.tree.map(np.asarray, made_of) if known else made_of
    wide = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, np.float64), like)

    def values(columns: Any) -> Any:
        return of_columns(columns, wide, np.dtype(np.float64))

    def rounding(leaf: Any, magnitude: Array, shift: Array) -> Array:
        types = [dtype, *([leaf.dtype] if jnp.issubdtype(leaf.dtype, jnp.floating) else [])]
        return magnitude * max(float(jnp.finfo(each).eps) for each in types) + shift

    made = Estimate(
        integral=values(middle),
        standard_error=values(error),
        rounding=jax.tree.map(
            rounding, like, values(magnitude), values(spread * moved.sum().astype(spread.dtype))
        ),
        means=values(means),
        unseen=values(unseen),
        tail=values(tail_index(np.asarray(some)) if known else np.zeros(spread.shape)),
        displacement=moved.max(),
        replicates=len(found),
        **settings,
    )
    if limits is not None:
        _check_means(means, made, limits)
    return made


def _columns(
    found: tuple[Array, ...], some: Array, spread: Array, reach: Array, n: int, by_ranks: bool
) -> tuple[Array, ...]:
    """Return the means of all replicates, their mean or median, and its observed, rounding, unseen error."""
    means = jnp.stack(found)
    mean = means.mean(axis=0)
    magnitude = jax.lax.stop_gradient(jnp.maximum(abs(some).mean(axis=0), abs(mean)))
    fixed = jax.lax.stop_gradient(means)
    equal = jnp.diff(jnp.sort(fixed, axis=0), axis=0).min(axis=0) <= 4 * np.finfo(np.float64).eps * magnitude
    # Means of smooth functions may be equal to rounding, but their values are not.
    few = jnp.sort(some[:_FEW], axis=0)
    equal &= jnp.sum(jnp.diff(few, axis=0) > 0, axis=0) < max(2, len(few) // 2)
    unseen = jnp.where(equal, reach / (n * len(found)), 0)
    constant = (reach == 0) & (jnp.ptp(fixed, axis=0) == 0)
    varied = jnp.where(jnp.ptp(fixed, axis=0) > 0, jnp.var(means, axis=0, ddof=1), 0)
    error = jnp.sqrt(varied / len(found) + COUNTED * jnp.square(unseen))
    return (
        means,
        _median(means) if by_ranks else mean,
        error,
        magnitude + spread / 2 + LEAST,
        jnp.where(constant, jnp.inf, unseen),
    )


_compiled_columns = jax.jit(_columns, static_argnums=(4, 5))

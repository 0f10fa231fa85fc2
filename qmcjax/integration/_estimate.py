"""Estimates of an integral from replicates."""

import math
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks
from qmcjax.integration import _intervals
from qmcjax.integration._means import as_complex, of_columns


class Estimate(NamedTuple):
    """An integral from independent replicates, with its error.

    Results are float64, in the structure of the values; complex numbers have errors for real and imaginary
    part.
    """

    integral: Any
    """The mean of the replicates; for "median" and "quantile" intervals their median."""
    standard_error: Any
    """Standard error of the mean; see :func:`integrate` for counts."""
    replicates: int
    """Number of replicates."""
    rounding: Any
    """Rounding error, which the replicates do not show: see :func:`integrate`."""
    means: Any
    """Mean of each replicate, with a first axis of length ``replicates``."""
    n: int
    """Number of points of each replicate."""
    unseen: Any
    """If values take few levels and two means are equal, the range of values divided by their number; else 0.

    Infinite if all observed values are equal and there are no limits."""
    limits: tuple[float, float] | None = None
    """Bounds of the function's values."""
    tolerance: float | None = None
    """The requested tolerance."""
    level: float = 0.95
    """Level of the interval that is compared with the tolerance, of each number."""
    tail: Any = 0.0
    """Tail index c: values above v have a probability like v**(-1 / c); 0 if light, or values are traced."""
    displacement: Any = 0.0
    """How far rounding moves points of ``bounds``, as a part of the side; of 1 if that is infinite."""

    @property
    def reached(self) -> bool | None:
        """Whether the interval is reliable and, with a tolerance, small enough.

        None if values are traced.
        """
        if self._traced():
            return None
        return not self._doubt() and (self.tolerance is None or self._half_width() <= self.tolerance)

    @property
    def reason(self) -> str | None:
        """Why the points sufficed or not; None without a tolerance or a doubt, or if values are traced."""
        if self._traced() or self.tolerance is None:
            return self._doubt()
        state = "was reached" if self.reached else "was not reached"
        why = self._doubt() or f"the half width is {self._half_width():g}"
        rounding = max(float(part.max(initial=0)) for part in _parts(self.rounding))
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
        if doubt := self._doubt():
            warnings.warn(doubt, RuntimeWarning, stacklevel=2)
        return self._interval(level)

    def _interval(self, level: float) -> tuple[Any, Any]:
        def ends(xp: Any, rounding: Any, integral: Any, error: Any, unseen: Any, means: Any) -> Any:
            unseen = xp.where(xp.isinf(unseen), 0, unseen)
            low, high = self._ends(level, xp, integral, error, unseen, means)
            if self.limits is not None:
                low, high = (xp.clip(end, *self.limits) for end in (low, high))
            return low - rounding, high + rounding

        with jax.enable_x64(True):  # or traced values would become float32 here
            return _apart(ends, self.rounding, self.integral, self.standard_error, self.unseen, self.means)

    def _ends(
        self, level: float, xp: Any, integral: Any, error: Any, unseen: Any, means: Any
    ) -> tuple[Any, Any]:
        from scipy.special import stdtrit

        quantile = float(stdtrit(self.replicates - 1, (1 + level) / 2))
        # The standard error includes a part for unseen events.
        more = max(_most_unseen(self.replicates, level) ** 2 - _COUNTED * quantile**2, 0)
        half = xp.sqrt(xp.square(quantile * error) + more * xp.square(unseen)) if more else quantile * error
        return integral - half, integral + half

    def _half_width(self) -> float:
        low, high = map(jax.tree.leaves, self._interval(self.level))
        widths: list[Any] = [np.asarray(b - a) for a, b in zip(low, high, strict=True)]
        return max(float(np.maximum(w.real, w.imag).max(initial=0)) for w in widths) / 2

    def _traced(self) -> bool:
        return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(self.standard_error))

    def _doubt(self) -> str | None:
        if self._traced():
            return None
        parts = _parts(self.unseen)
        still, count = sum(np.count_nonzero(np.isinf(part)) for part in parts), self.n * self.replicates
        if still:
            of = sum(part.size for part in parts)
            where = "" if of == 1 else f" of {still} of the function's {of} numbers"
            missed = _most_unseen(self.replicates, self.level) / count
            return (
                f"all {count} values seen{where} are equal, and an event with a probability below "
                f"{missed:.2g} may have been missed: pass limits, or more points"
            )
        places = 0.5 / max(float(self.displacement), _LEAST)
        if places < _PLACES:
            return (
                f"points have about {places:.2g} different places along a side of bounds: "
                "pass a wider dtype, or move the origin"
            )
        tail = max(float(part.max(initial=0)) for part in _parts(self.tail))
        least, advice = self._heavy
        return f"values are heavy-tailed (index {tail:.2g}): {advice}" if tail > least else None

    _heavy = 0.3, 'interval="quantile" is more reliable, or another variable of integration'


class QuantileEstimate(Estimate):
    __slots__ = ()

    def _ends(
        self, level: float, xp: Any, integral: Any, error: Any, unseen: Any, means: Any
    ) -> tuple[Any, Any]:
        del integral, error
        place = _intervals.rank(self.replicates, level)
        if not place:
            most = 1 - 2.0 ** (1 - self.replicates)
            raise ValueError(
                f"level must be at most {most:g} with {self.replicates} replicates, got {level!r}"
            )
        if xp is np:
            low, high = _intervals.rank_interval(means, level)
        else:
            low, high = _of_rank(means, place - 1), _of_rank(means, self.replicates - place)
        # The mean of counts differs from their median, by one count if events are rare.
        more = max(_most_unseen(self.replicates, level), self.replicates) * unseen
        return low - more, high + more

    _heavy = 0.55, "medians of means are far from the integral, choose another variable of integration"


class BettingEstimate(Estimate):
    __slots__ = ()

    def _ends(
        self, level: float, xp: Any, integral: Any, error: Any, unseen: Any, means: Any
    ) -> tuple[Any, Any]:
        del integral, error, unseen
        assert self.limits is not None
        least, most = self.limits
        unit = xp.clip((means - least) / (most - least), 0, 1)
        low, high = _intervals.betting_interval(unit, level, xp)
        return least + (most - least) * low, least + (most - least) * high

    _heavy = math.inf, ""


_LEAST = float(np.finfo(np.float32).tiny / np.finfo(np.float32).eps)
"""Added to the magnitude of values, since processors may flush subnormal numbers to 0."""

_FEW = 256
"""Number of values of which at least half are distinct, unless a function takes few values (counts)."""

_PLACES = 1024
"""Number of places along a side from which intervals are reliable."""

_COUNTED = 3
"""Weight of the squared unseen part in the squared standard error."""


def _most_unseen(replicates: int, level: float) -> float:
    """Return the maximum expected count, over all replicates, of an event that none of them saw.

    If it is expected m times in a replicate, with a variance of at most m as for independent points, the
    replicate sees it with a probability of at least m / (1 + m), by Cantelli's inequality. All replicates
    miss it with a probability of at most (1 - level) / 2 if m is at least the returned number divided by
    ``replicates``. The number tends to -log((1 - level) / 2), the rule of three for independent points.
    """
    return replicates * (((1 - level) / 2) ** (-1 / replicates) - 1)


KINDS: dict[str, type[Estimate]] = {
    "student": Estimate,
    "median": QuantileEstimate,
    "quantile": QuantileEstimate,
    "betting": BettingEstimate,
}
"""Classes of estimates by the kind of their intervals."""


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
    allowed = max(float(abs(np.asarray(leaf)).max(initial=0)) for leaf in jax.tree.leaves(made.rounding))
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
    if KINDS[kind] is QuantileEstimate and not _intervals.rank(replicates, level):
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


def _parts(tree: Any) -> list[Any]:
    """Return the leaves, with real and imaginary parts separately."""
    leaves: list[Any] = [np.asarray(leaf) for leaf in jax.tree.leaves(tree)]
    return [part for each in leaves for part in (each.real, each.imag)[: 1 + np.iscomplexobj(each)]]


def _apart(ends: Callable[..., tuple[Any, Any]], *trees: Any) -> tuple[Any, Any]:
    """Return two trees of ends, with real and imaginary parts treated separately."""

    def each(*leaves: Any) -> tuple[Any, Any]:
        xp: Any = jnp if any(isinstance(leaf, Tracer) for leaf in leaves) else np
        if not xp.iscomplexobj(leaves[0]):
            return ends(xp, *leaves)
        low, high = map(as_complex, ends(xp, *(x.real for x in leaves)), ends(xp, *(x.imag for x in leaves)))
        return low, high

    flat, tree = zip(*map(jax.tree.flatten, trees), strict=True)
    low, high = zip(*map(each, *flat), strict=True)
    return tree[0].unflatten(low), tree[0].unflatten(high)


def _of_rank(values: Array, place: int) -> Array:
    """Return the values of a rank, counted from 0, along the first axis, with derivatives.

    JAX computes derivatives outside the float64 mode of a program, where those of ``jnp.sort`` fail.
    """
    ranks = jnp.argsort(jnp.argsort(jax.lax.stop_gradient(values), axis=0), axis=0)
    return jnp.sum(values * (ranks == place).astype(values.dtype), axis=0)


def _median(values: Array) -> Array:
    middle = len(values) // 2
    return (_of_rank(values, len(values) - 1 - middle) + _of_rank(values, middle)) / 2


def estimate(
    found: list[Array],
    some: Array,
    spread: Any,
    like: Any,
    n: int,
    dtype: np.dtype,
    kind: str,
    limits: tuple[float, float] | None,
    tolerance: float | None,
    level: float,
    moved: Any,
) -> Estimate:
    """Return the mean or median of replicates, the standard error, and the rounding error.

    ``some``: columns of a few values; ``spread``: range of the observed values, shape (columns,); ``moved``:
    how far rounding moves points along each side, shape (dims,).
    """
    known = not any(isinstance(each, Tracer) for each in (*found, some))
    spread = np.asarray(spread) if known else spread
    reach: Any = spread if limits is None else np.full(spread.shape, limits[1] - limits[0])
    made_of = (_compiled_columns if known else _columns)(
        tuple(found), some, spread, reach, n, KINDS[kind] is QuantileEstimate
    )
    means, middle, error, magnitude, unseen = jax.tree.map(np.asarray, made_of) if known else made_of
    wide = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, _wide(leaf.dtype)), like)

    def values(columns: Any) -> Any:
        return of_columns(columns, wide, np.dtype(np.float64))

    def rounding(leaf: Any, magnitude: Array, shift: Array) -> Array:
        types = [dtype, *([leaf.dtype] if jnp.issubdtype(leaf.dtype, jnp.inexact) else [])]
        return magnitude * max(float(jnp.finfo(each).eps) for each in types) + shift

    made = KINDS[kind](
        values(middle),
        values(error),
        len(found),
        jax.tree.map(rounding, like, values(magnitude), values(spread * moved.sum().astype(spread.dtype))),
        values(means),
        n,
        values(unseen),
        limits,
        tolerance,
        level,
        values(_intervals.tail_index(np.asarray(some)) if known else np.zeros(spread.shape)),
        moved.max(),
    )
    if limits is not None:
        _check_means(means, made, limits)
    return made


def _columns(
    found: tuple[Array, ...], some: Array, spread: Array, reach: Array, n: int, of_ranks: bool
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
    error = jnp.sqrt(varied / len(found) + _COUNTED * jnp.square(unseen))
    return (
        means,
        _median(means) if of_ranks else mean,
        error,
        magnitude + spread / 2 + _LEAST,
        jnp.where(constant, jnp.inf, unseen),
    )


_compiled_columns = jax.jit(_columns, static_argnums=(4, 5))


def _wide(dtype: Any) -> np.dtype:
    return np.dtype(np.complex128 if jnp.issubdtype(dtype, jnp.complexfloating) else np.float64)

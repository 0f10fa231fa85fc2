"""What replicates say of an integral."""

import math
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import betting, checks, order_statistics
from qmcjax.core.columns import joined, of_columns


class Estimate(NamedTuple):
    """An integral from independent replicates, with its error.

    In the structure of the values, in float64; complex numbers have errors for real and imaginary part.
    """

    integral: Any
    """The mean of the replicates; for "median" and "quantile" intervals their median."""
    standard_error: Any
    """Of the mean; see :func:`integrate` for counts."""
    replicates: int
    """Number of replicates."""
    rounding: Any
    """Error by rounding, which the replicates do not show: see :func:`integrate`."""
    means: Any = None
    """Of each replicate: values with a first axis of length ``replicates``."""
    n: int = 0
    """Number of points of each replicate."""
    limits: tuple[float, float] | None = None
    """Of the function's values, for "betting" intervals."""

    def interval(self, level: float = 0.95) -> tuple[Any, Any]:
        """Return a confidence interval of the integral, widened by ``rounding``.

        Of the kind that :func:`integrate` was asked for. Alone, Student's t interval of the mean.

        Parameters
        ----------
        level : float
            Confidence level, in (0, 1). For "median" and "quantile" at most 1 - 2**(1 - replicates).

        Returns
        -------
        low, high, float64, in the structure of the values
        """
        level = _level(level)
        with jax.enable_x64(True):  # or traced values would become float32 here
            low, high = self._ends(level)
            low = jax.tree.map(operator.sub, low, self.rounding)
            return low, jax.tree.map(operator.add, high, self.rounding)

    def _ends(self, level: float) -> tuple[Any, Any]:
        from scipy.special import stdtrit

        quantile = float(stdtrit(self.replicates - 1, (1 + level) / 2))
        width = jax.tree.map(lambda error: quantile * error, self.standard_error)
        low, high = (jax.tree.map(each, self.integral, width) for each in (operator.sub, operator.add))
        return low, high


class QuantileEstimate(Estimate):
    """An estimate with intervals by order statistics."""

    __slots__ = ()

    def _ends(self, level: float) -> tuple[Any, Any]:
        if not order_statistics.rank(self.replicates, level):
            most = 1 - 2.0 ** (1 - self.replicates)
            raise ValueError(
                f"level must be at most {most:g} with {self.replicates} replicates, got {level!r}"
            )

        def ends(means: Any, xp: Any) -> tuple[Any, Any]:
            if xp is np:
                return order_statistics.interval(means, level)
            place = order_statistics.rank(self.replicates, level)
            return _of_rank(means, place - 1), _of_rank(means, self.replicates - place)

        return _apart(ends, self.means)


class BettingEstimate(Estimate):
    """An estimate with intervals by betting."""

    __slots__ = ()

    def _ends(self, level: float) -> tuple[Any, Any]:
        assert self.limits is not None
        least, most = self.limits

        def ends(means: Any, xp: Any) -> tuple[Any, Any]:
            unit = xp.clip((means - least) / (most - least), 0, 1)
            return tuple(least + (most - least) * end for end in betting.interval(unit, level, xp))  # pyright: ignore

        return _apart(ends, self.means)


KINDS: dict[str, type[Estimate]] = {
    "student": Estimate,
    "median": QuantileEstimate,
    "quantile": QuantileEstimate,
    "betting": BettingEstimate,
}
"""Classes of estimates by the kind of their intervals."""


def checked_limits(limits: Any, kind: str) -> tuple[float, float] | None:
    """Return bounds of values, which must be there for intervals by betting only."""
    if (limits is None) != (kind != "betting"):
        wanted = "two numbers" if kind == "betting" else "None"
        raise ValueError(f"limits must be {wanted} for interval={kind!r}, got {checks.shown(limits)}")
    if limits is None:
        return None
    known = checks.known_array("limits", limits, np.number, "two finite numbers, the lower one first")
    real = known.shape == (2,) and not np.iscomplexobj(known)
    if not real or not np.isfinite(known).all() or not known[0] < known[1]:
        raise ValueError(
            f"limits must be two finite numbers, the lower one first, got {checks.shown(limits)}"
        )
    return float(known[0]), float(known[1])


def _check_means(means: Array, made: Estimate, limits: tuple[float, float]) -> None:
    """Raise a ValueError if the mean of a replicate is outside of the bounds by more than rounding."""
    if isinstance(means, Tracer):
        return
    allowed = max(float(abs(np.asarray(leaf)).max(initial=0)) for leaf in jax.tree.leaves(made.rounding))
    if means.min() < limits[0] - allowed or means.max() > limits[1] + allowed:
        raise ValueError(
            f"limits must hold all values, got {limits}, and means in [{means.min()}, {means.max()}]"
        )


_FIRST = 1024
"""Points of a replicate after which an interval is first compared with a tolerance."""

_ERROR = 0.05
"""Probability that any of these intervals misses the integral."""


def doublings(tolerance: Any, n: int, replicates: int | None, kind: str) -> tuple[list[int], float]:
    """Return the numbers of points after which to compare an interval with a tolerance, and its level."""
    checks.positive("tolerance", tolerance)
    if isinstance(tolerance, Tracer) or np.ndim(tolerance):
        raise TypeError(f"tolerance must be a number, got {checks.shown(tolerance)}")
    if replicates is None:
        raise ValueError(f"tolerance must be None without replicates, got {checks.shown(tolerance)}")
    sizes = [min(n, _FIRST)]
    while 2 * sizes[-1] <= n and n > _FIRST:
        sizes.append(2 * sizes[-1])
    level = 1 - _ERROR / len(sizes)
    if KINDS[kind] is QuantileEstimate and not order_statistics.rank(replicates, level):
        least = math.ceil(1 - math.log2(1 - level))
        raise ValueError(f"replicates must be at least {least} for a tolerance, got {replicates}")
    return sizes, level


def half_width(made: Estimate, level: float) -> float:
    """Return half the width of the widest interval of a level."""
    low, high = map(jax.tree.leaves, made.interval(level))
    widths: list[Any] = [np.asarray(b - a) for a, b in zip(low, high, strict=True)]
    return max(float(np.maximum(w.real, w.imag).max(initial=0)) for w in widths) / 2


def _level(level: Any) -> float:
    if isinstance(level, bool) or not isinstance(level, float | int | np.floating):
        raise TypeError(f"level must be a number in (0, 1), got {checks.shown(level)}")
    if not 0 < level < 1:
        raise ValueError(f"level must be a number in (0, 1), got {level!r}")
    return float(level)


def _apart(ends: Callable[..., tuple[Any, Any]], means: Any) -> tuple[Any, Any]:
    """Return two trees of ends; those of real and imaginary parts on their own."""

    def each(leaf: Any) -> tuple[Any, Any]:
        traced = isinstance(leaf, Tracer)
        xp: Any = jnp if traced else np
        if not xp.iscomplexobj(leaf):
            return ends(leaf, xp=xp)
        real, imaginary = ends(leaf.real, xp=xp), ends(leaf.imag, xp=xp)
        low, high = map(joined, real, imaginary)
        return low, high

    leaves, tree = jax.tree.flatten(means)
    low, high = zip(*map(each, leaves), strict=True)
    return tree.unflatten(low), tree.unflatten(high)


def _of_rank(values: Array, place: int) -> Array:
    """Return the values of a rank along the first axis, from 0 on, with derivatives.

    JAX computes derivatives outside of the float64 mode of a program, where those of ``jnp.sort`` fail.
    """
    ranks = jnp.argsort(jnp.argsort(jax.lax.stop_gradient(values), axis=0), axis=0)
    return jnp.sum(values * (ranks == place).astype(values.dtype), axis=0)


def _median(values: Array) -> Array:
    middle = len(values) // 2
    return (_of_rank(values, len(values) - 1 - middle) + _of_rank(values, middle)) / 2


def estimate(
    found: list[Array],
    some: Array,
    like: Any,
    n: int,
    dtype: np.dtype,
    kind: str,
    limits: tuple[float, float] | None,
) -> Estimate:
    """Return the mean or median of replicates, the standard error, and the rounding error."""
    known = not any(isinstance(each, Tracer) for each in (*found, some))
    made_of = (_compiled_columns if known else _columns)(
        tuple(found), some, n, KINDS[kind] is QuantileEstimate
    )
    means, middle, error, magnitude = jax.tree.map(np.asarray, made_of) if known else made_of
    wide = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, _wide(leaf.dtype)), like)

    def values(columns: Any) -> Any:
        return of_columns(columns, wide, np.dtype(np.float64))

    def rounding(leaf: Any, magnitude: Array) -> Array:
        types = [dtype, *([leaf.dtype] if jnp.issubdtype(leaf.dtype, jnp.inexact) else [])]
        return magnitude * max(float(jnp.finfo(each).eps) for each in types)

    made = KINDS[kind](
        values(middle),
        values(error),
        len(found),
        jax.tree.map(rounding, like, values(magnitude)),
        values(means),
        n,
        limits,
    )
    if limits is not None:
        _check_means(means, made, limits)
    return made


def _columns(
    found: tuple[Array, ...], some: Array, n: int, of_ranks: bool
) -> tuple[Array, Array, Array, Array]:
    """Return the means of all replicates, their mean or median, its standard error, and its magnitude."""
    means = jnp.stack(found)
    mean, spread = means.mean(axis=0), jnp.ptp(some, axis=0)
    magnitude = jax.lax.stop_gradient(jnp.maximum(abs(some).mean(axis=0), abs(mean)))
    gaps = jnp.median(jnp.diff(jnp.sort(means, axis=0), axis=0), axis=0)
    equal = jax.lax.stop_gradient(gaps) <= 4 * np.finfo(np.float64).eps * magnitude
    unseen = jnp.where(equal, 3 * jnp.square(spread / (n * len(found))), 0)
    error = jnp.sqrt(jnp.var(means, axis=0, ddof=1) / len(found) + unseen)
    return means, _median(means) if of_ranks else mean, error, magnitude + spread / 2


_compiled_columns = jax.jit(_columns, static_argnums=(2, 3))


def _wide(dtype: Any) -> np.dtype:
    return np.dtype(np.complex128 if jnp.issubdtype(dtype, jnp.complexfloating) else np.float64)

"""What replicates say of an integral, and values of any structure as columns of numbers."""

import math
import operator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks


class Estimate(NamedTuple):
    """An integral from independent replicates, with its error.

    In the structure of the values, in float64; complex numbers have errors for real and imaginary part.
    """

    integral: Any
    """The mean of the replicates."""
    standard_error: Any
    """Of the mean; see :func:`integrate` for counts."""
    replicates: int
    """Number of replicates."""
    rounding: Any
    """Error by rounding, which the replicates do not show: see :func:`integrate`."""

    def interval(self, level: float = 0.95) -> tuple[Any, Any]:
        """Return a confidence interval: Student's t interval of the mean, widened by ``rounding``.

        Parameters
        ----------
        level : float
            Confidence level, in (0, 1), for replicates that are nearly normal.

        Returns
        -------
        low, high, float64, in the structure of the values
        """
        from scipy.special import stdtrit

        if isinstance(level, bool) or not isinstance(level, float | int | np.floating):
            raise TypeError(f"level must be a number in (0, 1), got {checks.shown(level)}")
        if not 0 < level < 1:
            raise ValueError(f"level must be a number in (0, 1), got {level!r}")
        quantile = float(stdtrit(self.replicates - 1, (1 + level) / 2))
        with jax.enable_x64(True):  # or traced values would become float32 here
            width = jax.tree.map(lambda s, r: quantile * s + r, self.standard_error, self.rounding)
            low, high = (jax.tree.map(each, self.integral, width) for each in (operator.sub, operator.add))
        return low, high


def columns(values: Any, dtype: np.dtype) -> Array:
    """Return all numbers of a row side by side, real and imaginary parts, in one floating type."""
    leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(values)]
    parts = [p for leaf in leaves for p in ((leaf.real, leaf.imag) if jnp.iscomplexobj(leaf) else (leaf,))]
    wide = any(part.dtype == jnp.float64 for part in parts)
    common = np.dtype(np.float64) if wide else dtype
    return jnp.concatenate([part.astype(common).reshape(part.shape[0], -1) for part in parts], axis=1)


def of_columns(column: Array, like: Any, dtype: np.dtype) -> Any:
    """Return the numbers of one row in the structure of the values."""
    first = 0

    def next_part(shape: tuple[int, ...]) -> Array:
        nonlocal first
        first, begin = first + math.prod(shape), first
        return column[begin:first].reshape(shape)

    def value(leaf: Any) -> Array:
        shape = leaf.shape[1:]
        if jnp.issubdtype(leaf.dtype, jnp.complexfloating):
            real, imaginary = next_part(shape), next_part(shape)
            return jax.lax.complex(real, imaginary).astype(leaf.dtype)
        return next_part(shape).astype(leaf.dtype if jnp.issubdtype(leaf.dtype, jnp.floating) else dtype)

    return jax.tree.map(value, like)


def estimate(found: list[Array], some: Array, like: Any, n: int, dtype: np.dtype) -> Estimate:
    """Return the mean of replicates, its standard error, and the rounding error."""
    wide = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, _wide(leaf.dtype)), like)
    means = jnp.stack(found)
    mean, spread = means.mean(axis=0), jnp.ptp(some, axis=0)
    magnitude = jax.lax.stop_gradient(jnp.maximum(abs(some).mean(axis=0), abs(mean)))

    def values(columns: Array) -> Any:
        made = of_columns(columns, wide, np.dtype(np.float64))
        return made if isinstance(columns, Tracer) else jax.tree.map(np.asarray, made)

    def rounding(leaf: Any, magnitude: Array) -> Array:
        types = [dtype, *([leaf.dtype] if jnp.issubdtype(leaf.dtype, jnp.inexact) else [])]
        return magnitude * max(float(jnp.finfo(each).eps) for each in types)

    gaps = jnp.median(jnp.diff(jnp.sort(means, axis=0), axis=0), axis=0)
    equal = jax.lax.stop_gradient(gaps) <= 4 * np.finfo(np.float64).eps * magnitude
    unseen = jnp.where(equal, 3 * jnp.square(spread / (n * len(found))), 0)
    return Estimate(
        values(mean),
        values(jnp.sqrt(jnp.var(means, axis=0, ddof=1) / len(found) + unseen)),
        len(found),
        jax.tree.map(rounding, like, values(magnitude + spread / 2)),
    )


def _wide(dtype: Any) -> np.dtype:
    return np.dtype(np.complex128 if jnp.issubdtype(dtype, jnp.complexfloating) else np.float64)

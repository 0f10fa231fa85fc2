"""Smooth measures of how far points keep apart, with gradients as cheap as the values.

Each measure combines sums over the rows of the matrix of pairs. As the matrix is symmetric, moving a point
changes the other rows as much as its own: the gradient is twice that through the point's own row. So one pass
over the rows, in batches, gives both value and gradient; reverse differentiation would keep the matrix.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.core import Tracer
from jax.scipy.special import logsumexp
from jax.typing import ArrayLike

__all__ = ["riesz_energy", "soft_min_distance"]

_PAIRS = 2**19
"""Pairs in one batch of rows, as long as there is more than one row."""


def riesz_energy(points: ArrayLike, exponent: float = 1.0, torus: bool = True) -> Array:
    """Return the Riesz energy of a point set, the sum of d_ij^-s over the pairs i < j.

    Parameters
    ----------
    points : float32 or float64 ArrayLike, shape (n, d)
        At least two points in [0, 1)^d. The precision of the points is that of the sum.
    exponent : float
        s, at least 0; 0 stands for the logarithmic energy, the sum of -log d_ij.
    torus : bool
        Whether the distance is that to the nearest periodic copy; otherwise it is Euclidean.

    Returns
    -------
    Array of the points' dtype, shape ()
        Differentiable in the points. Infinite for two points in the same place, and where the sum overflows:
        there the gradient is set to 0.

    Raises
    ------
    ValueError
        If the points are fewer than two, not float32 or float64, or, where they are known, not in
        [0, 1)^d; if they are float64 and JAX would make them float32; if the exponent is not a number
        of at least 0.

    Notes
    -----
    O(n^2 d) time and O(n d) memory, with or without the gradient. On the torus the distance has a kink
    where a point is half a period away; the gradient there is that of one side.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> print(riesz_energy(jnp.array([[0.0], [0.5], [0.75]])))
    10.0
    """
    array, exponent = _checked(points, exponent, 0.0)
    measure = _POWERS if exponent > 0 else _LOGARITHMS
    return _measured(array, jnp.asarray(exponent, array.dtype), measure, bool(torus))


def soft_min_distance(points: ArrayLike, exponent: float = 32.0, torus: bool = True) -> Array:
    """Return a smooth lower bound of the minimum distance, (sum of d_ij^-s over the pairs i < j)^(-1/s).

    Parameters
    ----------
    points : float32 or float64 ArrayLike, shape (n, d)
        At least two points in [0, 1)^d. The precision of the points is that of the sum.
    exponent : float
        s, positive. The larger, the closer to the minimum distance: it is at most (n (n - 1) / 2)^(1/s)
        times as large, and if k pairs are much closer than all others, about k^(1/s) times.
    torus : bool
        Whether the distance is that to the nearest periodic copy; otherwise it is Euclidean.

    Returns
    -------
    Array of the points' dtype, shape ()
        Differentiable in the points, for any exponent without overflow: large terms are summed relative to
        the largest. 0 for two points in the same place, where the gradient is set to 0.

    Raises
    ------
    ValueError
        As :func:`riesz_energy`, and if the exponent is 0.

    Notes
    -----
    O(n^2 d) time and O(n d) memory, with or without the gradient.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> print(soft_min_distance(jnp.array([[0.0], [0.5]]), exponent=2.0))
    0.5
    """
    array, exponent = _checked(points, exponent, float(np.finfo(np.float32).tiny))
    scale = jnp.asarray(exponent, array.dtype)
    return jnp.exp(-_measured(array, scale, _LOG_OF_POWERS, bool(torus)) / scale)


def _checked(points: ArrayLike, exponent: Any, least: float) -> tuple[Array, float]:
    """Return points and exponent, or raise a ValueError."""
    dtype = getattr(points, "dtype", None)
    if dtype == jnp.float64 and not jax.config.read("jax_enable_x64"):
        raise ValueError(
            "points are float64, which JAX makes float32 here: cast them, or call within jax.enable_x64(True)"
        )
    array = jnp.asarray(points)
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] < 1:
        raise ValueError(f"points must have shape (n, d) with n >= 2 and d >= 1, got {array.shape}")
    if array.dtype not in (jnp.float32, jnp.float64):
        raise ValueError(f"points must be float32 or float64, got {array.dtype}")
    if not isinstance(array, Tracer):
        known = np.asarray(array)
        outside = ~((known >= 0) & (known < 1))
        if outside.any():
            raise ValueError(f"points must be in [0, 1), got {known[outside][0]!r}")
    if isinstance(exponent, bool) or not isinstance(exponent, int | float | np.floating | np.integer):
        raise ValueError(f"exponent must be a number, got {exponent!r}")
    if not least <= exponent < np.inf:
        raise ValueError(f"exponent must be {'at least 0' if least == 0 else 'positive'}, got {exponent!r}")
    return array, float(exponent)


class _Measure(NamedTuple):
    row: Callable[[Array, Array], Array]
    """From the squared distances of a point to all, itself at infinity, and s, to a sum."""

    combine: Callable[[Array], Array]
    """From all these sums, in which each pair occurs twice, to the measure."""


def _half_sum(sums: Array) -> Array:
    return jnp.sum(sums) / 2


_POWERS = _Measure(lambda squares, s: jnp.sum(jnp.exp(-s / 2 * jnp.log(squares))), _half_sum)
_LOGARITHMS = _Measure(
    lambda squares, s: -jnp.sum(jnp.where(jnp.isinf(squares), 0, jnp.log(squares))) / 2, _half_sum
)
_LOG_OF_POWERS = _Measure(
    lambda squares, s: logsumexp(-s / 2 * jnp.log(squares)), lambda sums: logsumexp(sums) - np.log(2)
)


def _row(
    point: Array, index: Array, columns: Array, exponent: Array, measure: _Measure, torus: bool
) -> Array:
    difference = point[:, None] - columns
    if torus:
        difference = difference - jnp.round(difference)
    squares = jnp.sum(jnp.square(difference), axis=0)
    itself = jnp.arange(columns.shape[1], dtype=jnp.int32) == index
    return measure.row(jnp.where(itself, jnp.inf, squares), exponent)


def _rows(function: Callable[..., Any], points: Array, *rest: Any) -> Any:
    """Return what the function gives for each row of pairs."""
    n = len(points)
    rows = (points, jnp.arange(n, dtype=jnp.int32))
    return lax.map(lambda row: function(*row, points.T, *rest), rows, batch_size=max(1, min(n, _PAIRS // n)))


@partial(jax.custom_vjp, nondiff_argnums=(2, 3))
def _total(points: Array, exponent: Array, measure: _Measure, torus: bool) -> Array:
    return measure.combine(_rows(_row, points, exponent, measure, torus))


def _total_and_gradient(
    points: Array, exponent: Array, measure: _Measure, torus: bool
) -> tuple[Array, tuple[Array, Array]]:
    sums, own = _rows(jax.value_and_grad(_row), points, exponent, measure, torus)
    total, weights = jax.value_and_grad(measure.combine)(sums)
    gradient = jnp.where(jnp.isfinite(total), 2 * weights[:, None] * own, 0)
    return total, (gradient, exponent)


def _backward(
    measure: _Measure, torus: bool, kept: tuple[Array, Array], cotangent: Array
) -> tuple[Array, Array]:
    gradient, exponent = kept
    return cotangent * gradient, jnp.zeros_like(exponent)


_total.defvjp(_total_and_gradient, _backward)
_measured = jax.jit(_total, static_argnums=(2, 3))

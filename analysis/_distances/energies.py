"""Smooth measures of the distances between points, with gradients as cheap as the values.

Each measure combines sums over the rows of the matrix of pairs. Since the matrix is symmetric, moving a point
changes the other rows as much as its own: the gradient is twice that of the point's row. So one pass over the
rows, in batches, gives both value and gradient; reverse-mode differentiation would store the matrix.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.scipy.special import logsumexp
from jax.typing import ArrayLike

from analysis import _arguments
from qmcjax.core import checks

_PAIRS = 2**19
"""Pairs per batch of rows, if there is more than one row."""

_LEAST = float(np.finfo(np.float32).tiny)
"""Smaller exponents have no inverse in float32."""


def riesz_energy(points: ArrayLike, exponent: float = 1.0, torus: bool = True) -> Array:
    """Return the Riesz energy of a point set, the sum of d_ij^-s over the pairs i < j.

    Parameters
    ----------
    points : float32 or float64 ArrayLike, shape (n, d)
        At least two points in [0, 1)^d. The sum has the precision of the points, for any ``jax_enable_x64``.
    exponent : float
        s, at least 0; 0 gives the logarithmic energy, the sum of -log d_ij.
    torus : bool, whether the distance is that to the nearest periodic copy; otherwise it is Euclidean

    Returns
    -------
    Array of the points' dtype, shape ()
        Differentiable in the points. Infinite for two equal points, and if the sum overflows; the gradient is
        then set to 0.

    Notes
    -----
    O(n^2 d) time and O(n d) memory, with or without the gradient. On the torus the distance has a kink at
    half a period; the gradient there is one-sided.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> print(riesz_energy(jnp.array([[0.0], [0.5], [0.75]])))
    10.0
    """
    given, torus = _validate(points, torus)
    exponent = _arguments.real("exponent", exponent, "finite and at least 0", lambda s: 0 <= s < np.inf)
    with checks.precision(given.dtype):
        scale = jnp.asarray(exponent, given.dtype)
        return _measured(jnp.asarray(given), scale, _POWERS if exponent > 0 else _LOGARITHMS, torus)


def soft_min_distance(points: ArrayLike, exponent: float = 32.0, torus: bool = True) -> Array:
    """Return a smooth lower bound of the minimum distance, (sum of d_ij^-s over the pairs i < j)^(-1/s).

    Parameters
    ----------
    points, torus
        As in :func:`riesz_energy`.
    exponent : float
        s, positive. The larger, the closer to the minimum distance, which is at most (n (n - 1) / 2)^(1/s)
        times as large, and about k^(1/s) times if k pairs are much closer than all others.

    Returns
    -------
    Array of the points' dtype, shape ()
        Differentiable in the points, for any exponent without overflow: large terms are summed relative to
        the largest. 0 for two equal points, where the gradient is set to 0.

    Notes
    -----
    O(n^2 d) time and O(n d) memory, with or without the gradient.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> print(soft_min_distance(jnp.array([[0.0], [0.5]]), exponent=2.0))
    0.5
    """
    given, torus = _validate(points, torus)
    exponent = _arguments.real("exponent", exponent, "finite and positive", lambda s: _LEAST <= s < np.inf)
    with checks.precision(given.dtype):
        scale = jnp.asarray(exponent, given.dtype)
        return jnp.exp(-_measured(jnp.asarray(given), scale, _LOG_OF_POWERS, torus) / scale)


def _validate(points: Any, torus: Any) -> tuple[Any, bool]:
    given = _arguments.points(points, least=2, traced=True, dtypes=(np.float32, np.float64))
    return given, checks.flag("torus", torus)


class _Measure(NamedTuple):
    row: Callable[[Array, Array], tuple[Array, Array]]
    """Maps squared distances of a point to all (infinity to itself) and s to a sum and its derivatives."""
    combine: Callable[[Array], Array]
    """Maps all these sums, which count each pair twice, to the measure."""


def _power_row(squares: Array, s: Array) -> tuple[Array, Array]:
    powers = jnp.exp(-s / 2 * jnp.log(squares))
    return jnp.sum(powers), -s / 2 * (powers / squares)


def _logarithm_row(squares: Array, s: Array) -> tuple[Array, Array]:
    del s
    return -jnp.sum(jnp.where(jnp.isinf(squares), 0, jnp.log(squares))) / 2, -1 / (2 * squares)


def _log_of_powers_row(squares: Array, s: Array) -> tuple[Array, Array]:
    logarithms = -s / 2 * jnp.log(squares)
    total = logsumexp(logarithms)
    return total, -s / 2 * (jnp.exp(logarithms - total) / squares)


def _half_sum(sums: Array) -> Array:
    return jnp.sum(sums) / 2


_POWERS = _Measure(_power_row, _half_sum)
_LOGARITHMS = _Measure(_logarithm_row, _half_sum)
_LOG_OF_POWERS = _Measure(_log_of_powers_row, lambda sums: logsumexp(sums) - math.log(2))


def _row(
    point: Array, index: Array, columns: Array, exponent: Array, measure: _Measure, torus: bool
) -> tuple[Array, Array]:
    """Return a sum over a row of pairs, and its gradient with respect to the row's own point."""
    difference = point[:, None] - columns
    if torus:
        difference = difference - jnp.round(difference)
    squares = jnp.sum(jnp.square(difference), axis=0)
    itself = jnp.arange(columns.shape[1], dtype=jnp.int32) == index
    total, derivatives = measure.row(jnp.where(itself, jnp.inf, squares), exponent)
    return total, 2 * jnp.matmul(difference, derivatives, precision=lax.Precision.HIGHEST)


def _rows(points: Array, exponent: Array, measure: _Measure, torus: bool, gradient: bool) -> Any:
    """Return the sums of all rows, with their gradients if wanted."""
    n = len(points)

    def row(at: tuple[Array, Array]) -> Any:
        found = _row(*at, points.T, exponent, measure, torus)
        return found if gradient else found[0]

    rows = (points, jnp.arange(n, dtype=jnp.int32))
    return lax.map(row, rows, batch_size=max(1, min(n, _PAIRS // n)))


@partial(jax.custom_vjp, nondiff_argnums=(2, 3))
def _total(points: Array, exponent: Array, measure: _Measure, torus: bool) -> Array:
    return measure.combine(_rows(points, exponent, measure, torus, False))


def _total_and_gradient(
    points: Array, exponent: Array, measure: _Measure, torus: bool
) -> tuple[Array, tuple[Array, Array]]:
    sums, own = _rows(points, exponent, measure, torus, True)
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

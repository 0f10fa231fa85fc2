"""A smooth upper bound of the star discrepancy."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import logsumexp
from jax.typing import ArrayLike

from analysis import _arguments
from qmcjax.core import checks

_BOXES = 2**24
"""Maximum number of boxes times points."""


def soft_star_discrepancy(points: ArrayLike, temperature: float = 0.01) -> Array:
    """Return a smooth upper bound of the star discrepancy, by a soft maximum over boxes and soft counts.

    Parameters
    ----------
    points : float32 or float64 ArrayLike, shape (n, d) or (n,)
        Points in [0, 1)^d, (n + 1)^d n at most 2^24; a vector is a set in one dimension. Boxes are summed in
        the precision of the points, whatever the global flag.
    temperature : float
        T, positive. The larger, the smoother: more boxes have a derivative.

    Returns
    -------
    Array of the points' dtype, shape ()
        Twice differentiable in the points. At least `star_discrepancy`, to rounding errors, and at most
        T (d + log(2 (n + 1)^d)) larger.

    Notes
    -----
    Boxes end at all combinations of the points' coordinates and 1, however these are ordered. A closed box
    counts a point up to T behind an end in part, an open one a point up to T before it, by a polynomial of
    degree 5 in between: so neither count errs to the side that makes the discrepancy small, and a box of the
    star discrepancy has its value. The soft differences D_q are at most those of boxes whose ends are moved
    by T. The soft maximum is T log(sum exp(D_q / T)) over all 2 (n + 1)^d open and closed boxes q.

    O(n^(d + 1)) time and O(n^d) memory.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> print(round(float(soft_star_discrepancy(jnp.array([[0.5, 0.5]]), 1e-3)), 6))
    0.75
    """
    given = _arguments.points(points, vector=True, traced=True, dtypes=(np.float32, np.float64))
    n, dims = given.shape
    if (n + 1) ** dims * n > _BOXES:
        raise ValueError(
            f"points must be so few that (n + 1)^d n is at most {_BOXES}, got n={n} and d={dims}"
        )
    temperature = _arguments.positive("temperature", temperature)
    with checks.precision(given.dtype):
        return _measure(jnp.asarray(given), jnp.asarray(temperature, given.dtype))


@jax.jit
def _measure(points: Array, temperature: Array) -> Array:
    n, dims = points.shape
    ends = jnp.concatenate([points, jnp.ones((1, dims), points.dtype)])
    volume = _over_boxes(list(ends.T))
    behind = (ends[:, None] - points[None]) / temperature
    differences = []
    for sign, shift in ((1, 0), (-1, 1)):
        inside = _step(behind + shift)
        share = _counts([inside[..., j] for j in range(dims)]) / n
        differences.append(sign * (volume - share))
    return temperature * logsumexp(jnp.stack(differences) / temperature)


def _step(x: Array) -> Array:
    """Return 0 up to 0, 1 from 1, and the polynomial of degree 5 with flat ends in between."""
    x = jnp.clip(x, 0, 1)
    return x**3 * (10 + x * (6 * x - 15))


def _over_boxes(factors: list[Array]) -> Array:
    """Return the products of one factor per dimension, for all combinations."""
    product = factors[0]
    for factor in factors[1:]:
        product = product[..., None] * factor.reshape((1,) * product.ndim + (-1,))
    return product


def _counts(inside: list[Array]) -> Array:
    """Return how many points are in the boxes of all combinations: shares along each axis, (n + 1, n)."""
    letters = "abcdefghijklmnopqrstuvwxy"[: len(inside)]
    wanted = ",".join(f"{letter}z" for letter in letters)
    return jnp.einsum(f"{wanted}->{letters}", *inside)

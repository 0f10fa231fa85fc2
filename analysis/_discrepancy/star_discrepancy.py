"""The star discrepancy of point sets, exact, and a smooth upper bound."""

from __future__ import annotations

from functools import reduce
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.scipy.special import logsumexp
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._discrepancy.critical_grid import LocalDiscrepancy, attained_by_box, critical_grid
from analysis._discrepancy.plane import plane_star_discrepancy
from analysis._discrepancy.regions import refine
from analysis._host import call_back
from qmcjax.core import checks

_REGIONS = 2**22
"""Regions that are examined before the computation gives up."""

_COMPARISONS = 2**35
"""The same limit for large sets: regions times points times dimensions."""


def star_discrepancy(points: ArrayLike) -> float:
    """Return the largest difference between a box's volume and its share of the points.

    The supremum is over the boxes anchored at the origin, [0, q) for q in [0, 1]^d. A closed box is the
    limit of such boxes and counts as one.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d) or (n,)
        At least one point in [0, 1]^d; a vector is a set in one dimension. Computed in float64, in
        which float32 points are exact.

    Returns
    -------
    float
        Exact up to rounding errors: at most 2^-51 in one and two dimensions, (d + 2) 2^-51 in more.
        If JAX traces the points (``jit``, ``grad``, ``vmap``), an Array, differentiable: the derivative is
        that of the volume of one worst box. `soft_star_discrepancy` smooths over boxes.

    Raises
    ------
    ValueError
        Also if the computation is infeasible; use `star_discrepancy_bounds` then.

    Notes
    -----
    One dimension takes O(n log n) steps. Two dimensions take O(n) memory and O(n^1.5) steps, or up to O(n^2)
    if many boxes come close to the largest difference: about 3 s for 2^17 points, 80 s for 2^20.

    From three dimensions on, regions of boxes are bounded and halved until the largest difference is certain;
    [1]_ surveys other algorithms. No useful bound on the number of regions is known: it grows with the
    dimension and with the quality of the points. The search gives up after 2^22 regions, or 2^35 / (n d) if
    that is less. It is feasible for the first n Sobol' points with n = 16384 in 3 dimensions, 4096 in 4,
    2048 in 5, 512 in 6, 128 in 8 and 64 in 12, and for larger sets of less well distributed points.

    References
    ----------
    .. [1] C. Doerr, M. Gnewuch, M. Wahlstroem, "Calculation of discrepancy measures and applications",
       2014.

    Examples
    --------
    >>> star_discrepancy([[0.5, 0.5]])
    0.75
    """
    given = _arguments.points(points, vector=True, traced=True, closed=True)
    if isinstance(given, Tracer):
        dims = given.shape[1]
        return call_back(
            star_discrepancy, lambda known: attained_by_box(known, worst_box(known)), given, (), dims
        )
    return float(worst_box(given))


def worst_box(points: NDArray[Any]) -> LocalDiscrepancy:
    """Return the star discrepancy and a box where it is attained."""
    array = points.astype(np.float64, copy=False)
    n, dims = array.shape
    if dims == 1:
        return _line_star_discrepancy(array[:, 0])
    if dims == 2:
        return plane_star_discrepancy(array)
    grid = critical_grid(array)
    regions = max(1, min(_REGIONS, _COMPARISONS // (n * dims)))
    lower, upper = refine(grid, 0.0, regions)
    if lower < upper:
        raise ValueError(
            f"points: the star discrepancy of n={n} points in d={dims} dimensions is infeasible, it is only "
            f"known to be in [{lower:.6g}, {upper:.6g}] after {regions} regions; use star_discrepancy_bounds"
        )
    return cast(LocalDiscrepancy, lower)


def _line_star_discrepancy(points: NDArray[np.float64]) -> LocalDiscrepancy:
    """Return the maximum over open intervals that end at a point or 1, and closed ones that end at a point.

    Of equal points, those in the wrong order give smaller values.
    """
    n = len(points)
    ordered = np.sort(points)
    share = np.arange(n + 1) / n
    return max(
        LocalDiscrepancy(values.max(), ordered[[values.argmax()]], is_open)
        for values, is_open in ((ordered - share[:-1], True), (share[1:] - ordered, False))
    )


_BOXES = 2**24
"""Maximum number of boxes times points."""


def soft_star_discrepancy(points: ArrayLike, temperature: float = 0.01) -> Array:
    """Return a smooth upper bound of the star discrepancy, by a soft maximum over boxes and soft counts.

    Parameters
    ----------
    points : float32 or float64 ArrayLike, shape (n, d) or (n,)
        Points in [0, 1]^d, (n + 1)^d n at most 2^24; a vector is a set in one dimension. Boxes are summed in
        the precision of the points, for any ``jax_enable_x64``.
    temperature : float
        T, positive. The larger, the smoother: more boxes contribute to the derivative.

    Returns
    -------
    Array of the points' dtype, shape ()
        Twice differentiable in the points. At least `star_discrepancy`, to rounding errors, and at most
        T (d + log(2 (n + 1)^d)) larger.

    Notes
    -----
    Boxes end at all combinations of the points' coordinates and 1, in any order. A closed box partly counts a
    point up to T beyond an end, an open one a point up to T before it, with weights by a polynomial of degree
    5. So neither count decreases the discrepancy, and a worst box keeps at least its value. The soft
    differences D_q are at most those of boxes with ends moved by T. The soft maximum is
    T log(sum exp(D_q / T)) over all 2 (n + 1)^d open and closed boxes q.

    O(n^(d + 1)) time and O(n^d) memory.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> print(round(float(soft_star_discrepancy(jnp.array([[0.5, 0.5]]), 1e-3)), 6))
    0.75
    """
    dtypes = (np.float32, np.float64)
    given = _arguments.points(points, vector=True, traced=True, closed=True, dtypes=dtypes)
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
    volume = reduce(jnp.multiply.outer, ends.T)
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


def _counts(inside: list[Array]) -> Array:
    """Return the soft counts of points in all boxes, from the shares along each axis, (n + 1, n)."""
    letters = "abcdefghijklmnopqrstuvwxy"[: len(inside)]
    wanted = ",".join(f"{letter}z" for letter in letters)
    return jnp.einsum(f"{wanted}->{letters}", *inside)

"""The star discrepancy of point sets, exact."""

from typing import Any, cast

import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._callbacks import call_back
from analysis._loops import COMPILED
from analysis._star.critical_grid import LocalDiscrepancy, attained_by_box, critical_grid
from analysis._star.plane import plane_star_discrepancy
from analysis._star.plane_rows import many_star_discrepancy
from analysis._star.regions import refine
from analysis._star.space import space_star_discrepancy

_REGIONS = 2**22
"""Regions that are examined before the computation gives up."""

_COMPARISONS = 2**35
"""The same limit for large sets: regions times points times dimensions."""

_TILED = range(256, 2**16 + 1)
"""Numbers of points in space for which tiles are faster, and fit the memory."""

_MANY = 2**17
"""Number of points in the plane from which on compiled loops are faster, including their compilation."""


def star_discrepancy(points: ArrayLike) -> float:
    """Return the largest difference between a box's volume and its share of the points.

    The supremum is over the boxes anchored at the origin, [0, q) for q in [0, 1]^d. A closed box is the
    limit of such boxes and counts as one.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d) or (n,)
        At least one point in [0, 1)^d; a vector is a set in one dimension. Computed in float64, in
        which float32 points are exact.

    Returns
    -------
    float
        Exact up to rounding errors: at most 2^-51 in one and two dimensions, (d + 2) 2^-51 in more.
        If JAX traces the points (``jit``, ``grad``, ``vmap``), an Array, differentiable: the derivative is
        that of the volume of a worst box, of one of them at ties. `soft_star_discrepancy` smooths over boxes.

    Raises
    ------
    ValueError
        Also if the computation is infeasible: then `star_discrepancy_bounds` brackets the result.

    Notes
    -----
    One dimension takes O(n log n) steps. Two take O(n) memory and O(n^1.5) steps, or up to O(n^2) if
    many boxes come close to the largest difference; from 2^17 points on, all cores are used if Numba is
    installed, in three times the memory of float64 points. Three take O(n^1.5) memory and O(n^2.5) steps in
    the same case, for up to 2^16 points.

    From three dimensions on, regions of boxes are bounded and halved until the largest difference is
    certain; [1]_ surveys other algorithms. No useful bound on the number of regions is known: it grows
    with the dimension, and with the quality of the points. A search of more than 2^22 regions, or
    2^35 / (n d) if that is less, gives up. Feasible are the first n Sobol' points for n = 4096 in 4
    dimensions, 2048 in 5, 512 in 6, 128 in 8 and 64 in 12, and larger sets of less well distributed points.

    References
    ----------
    .. [1] C. Doerr, M. Gnewuch, M. Wahlstroem, "Calculation of discrepancy measures and applications",
       2014.

    Examples
    --------
    >>> star_discrepancy([[0.5, 0.5]])
    0.75
    """
    given = _arguments.points(points, vector=True, traced=True)
    if isinstance(given, Tracer):
        dims = given.shape[1]
        return call_back(
            star_discrepancy, lambda known: attained_by_box(known, worst_box(known)), given, (), dims
        )
    array = given.astype(np.float64, copy=False)
    many = array.shape[1] == 2 and len(array) >= _MANY and COMPILED
    return many_star_discrepancy(array) if many else float(worst_box(array))


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
    lower, upper = 0.0, 1.0
    if dims == 3 and n in _TILED:
        # Badly distributed points need no tiles.
        lower, upper = refine(grid, lower, n // 16)
        if lower < upper:
            lower, upper = space_star_discrepancy(array, lower)
    if lower < upper:
        lower, upper = refine(grid, lower, regions)
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

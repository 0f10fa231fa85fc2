"""Certified bounds of the star discrepancy in any dimension."""

import jax
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._discrepancy.critical_grid import attained_by_box, critical_grid, rounding
from analysis._discrepancy.regions import refine, threshold_accepting
from analysis._discrepancy.star_discrepancy import worst_box
from analysis._host import Attained, Floats, call_back
from qmcjax.core import checks

_COMPARISONS = 2**29
"""Regions times points times dimensions, unless a number of regions is given."""


def star_discrepancy_bounds(
    points: ArrayLike, key: Array | int = 0, regions: int | None = None
) -> tuple[float, float]:
    """Return a lower and an upper bound of the star discrepancy, proved for every input.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d) or (n,)
        At least one point in [0, 1]^d, as for `star_discrepancy`.
    key : jax.random.key, or int in [0, 2**32)
        Seed of the search for the lower bound. The best over several keys is a lower bound, too.
    regions : int, optional
        In [1, 2**32): maximum number of regions of boxes to examine for the upper bound. By default 2^29 /
        (n d), at most 2^18 and at least 1.

    Returns
    -------
    lower, upper : float
        They differ only by rounding errors, (d + 2) 2^-50, if the regions suffice, and always in one and two
        dimensions. If JAX traces the points (``jit``, ``grad``, ``vmap``), Arrays: the derivative of the
        lower one is that of its box; that of the upper one is the same if the regions suffice, otherwise 0.

    Notes
    -----
    **Lower bound.** It is the volume of one box minus its share of the points, or the opposite, less
    the rounding error of that number. The star discrepancy is the supremum over all boxes, and thus not
    smaller. Threshold accepting [1]_ or the search for the upper bound finds the box.

    **Upper bound.** Let [l, h] be a region: all boxes between the boxes l and h. For a box q in it the
    volume is V(q) <= V(h), the share N(q)/n >= N(l)/n, hence V(q) - N(q)/n <= V(h) - N(l)/n and, the
    same way, N(q)/n - V(q) <= N(h)/n - V(l). The supremum over all boxes is at most the largest of
    these bounds over regions that contain every box: a bracketing cover [2]_. Here the cover
    is adapted to the points, the regions with the largest bounds being halved first; it consists of
    corners of the critical grid, where the supremum is attained; and the bounds are tighter.
    The steps from l to q, one dimension j at a time, add slabs to the box,

        V(q) - V(l) = sum_j  prod_(k<j) l_k  (q_j - l_j)  prod_(k>j) q_k.

    Open boxes: replacing q_k by h_k on the right bounds V(q) from above by a sum of functions of one
    coordinate each. N(q) is at least N(l) plus, for each j, the points that are outside of l only in
    dimension j and below q_j there, another sum of such functions. So the maximum of the difference
    of both sums, taken exactly in each coordinate, is an upper bound. Closed boxes: replacing q_k
    by l_k bounds V(q) from below, and N(q) is at most N(l) plus, for each j, the points inside of h that are
    outside of l first in dimension j, and there not beyond q_j. Regions whose bounds are no
    larger than the lower bound are done with. A bound on the rounding errors is added, and no star
    discrepancy exceeds 1.

    In many dimensions the upper bound decays slowly with the number of regions: above about ten dimensions it
    is loose, and may be 1, while the lower bound is still close to the star discrepancy.

    References
    ----------
    .. [1] M. Gnewuch, M. Wahlstroem, C. Winzen, "A new randomized algorithm to approximate the star
       discrepancy based on threshold accepting", SIAM J. Numer. Anal. 50, 2012.
    .. [2] E. Thiemard, "An algorithm to compute bounds for the star discrepancy", J. Complexity 17, 2001.

    Examples
    --------
    >>> lower, upper = star_discrepancy_bounds([[0.5, 0.5, 0.5]])
    >>> print(round(lower, 9), round(upper, 9))
    0.875 0.875
    """
    given = _arguments.points(points, vector=True, traced=True, closed=True)
    if regions is None:
        regions = max(1, min(2**18, _COMPARISONS // given.size))
    regions = checks.integer("regions", regions, 1, checks.INDEX_LIMIT - 1)
    if isinstance(key, Tracer):
        raise TypeError(f"key must be known and not traced by JAX, got {key}")
    with jax.ensure_compile_time_eval():
        seed = np.asarray(jax.random.key_data(checks.prng_key("key", key)))
    if isinstance(given, Tracer):
        bounds = call_back(
            lambda known: np.array(_bounds(known, seed, regions)),
            lambda known: _attained(known, seed, regions),
            given,
            (2,),
            given.shape[1],
        )
        return bounds[0], bounds[1]
    return _bounds(given, seed, regions)


def _bounds(points: Floats, seed: NDArray[np.uint32], regions: int) -> tuple[float, float]:
    lower, upper = _search(points, seed, regions)
    margin = rounding(points.shape[1])
    return max(0.0, lower - margin), min(1.0, upper + margin)


def _attained(points: Floats, seed: NDArray[np.uint32], regions: int) -> Attained:
    lower, upper = _search(points, seed, regions)
    margin = rounding(points.shape[1])
    _, index, slopes = attained_by_box(points, lower)
    values = np.array([max(0.0, lower - margin), min(1.0, upper + margin)])
    return values, np.stack([index] * 2), np.stack([slopes, slopes * (lower == upper)])


def _search(points: Floats, seed: NDArray[np.uint32], regions: int) -> tuple[float, float]:
    """Return the bounds to rounding errors, the lower one with its box if it has one."""
    array = points.astype(np.float64, copy=False)
    if array.shape[1] <= 2:
        lower = worst_box(array)
        return lower, lower
    grid = critical_grid(array)
    return refine(grid, threshold_accepting(grid, np.random.default_rng(seed)), regions)

"""Certified bounds of the star discrepancy in any dimension."""

from typing import cast

import jax
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._discrepancy.critical_grid import attained_by_box, critical_grid, rounding
from analysis._discrepancy.regions import refine, threshold_accepting
from analysis._discrepancy.star_discrepancy import star_discrepancy, worst_box
from analysis._host import Attained, Floats, call_back
from qmcjax.core import checks

_CELLS = 2**24
"""Upper limit of the number of cells."""

_BLOCK = 2**16
"""Points that are counted together."""


def cell_bounds(points: NDArray[np.float64]) -> tuple[float, float]:
    """Return bounds by counts in cells, to rounding errors of a few 2^-53: one pass over the points.

    Let e be edges of cells on every axis and C(i) the number of points that are below e_i in all coordinates.
    A box that ends at q, with e_i < q <= e_(i+1) if it is open and e_i <= q < e_(i+1) if closed, has at least
    the volume V(e_i) and at most V(e_(i+1)), and holds at least C(i) and at most C(i + 1) points: the
    simplest bracketing cover [E. Thiemard, "An algorithm to compute bounds for the star discrepancy", 2001].
    """
    n, dims = points.shape
    side = _prime(int(_CELLS ** (1 / dims)))
    edges, below = np.arange(side + 1) / side, np.nextafter(1, 0)
    count = np.zeros((side + 1,) * dims, np.int32 if n < 2**31 else np.int64)
    cells = count.ravel()
    for start in range(0, n, _BLOCK):
        # Compared with the edges: a product with their number may be rounded across one.
        # A point at 1 counts as just below: this moves the local discrepancy of a box by a rounding error.
        block = np.minimum(points[start : start + _BLOCK].T, below)
        index = np.searchsorted(edges, block, side="right")
        np.add.at(cells, np.ravel_multi_index(tuple(index), count.shape), 1)
    for axis in range(dims):
        np.cumsum(count, axis=axis, out=count)

    lower = upper = 0.0
    area, next_area = np.ones(1), np.ones(1)
    for _ in range(dims - 1):
        area, next_area = np.multiply.outer(area, edges), np.multiply.outer(next_area, edges[1:])
    area = area.reshape(count.shape[1:])
    next_area = next_area.reshape((side,) * (dims - 1))
    first, second = (slice(None, -1),) * (dims - 1), (slice(1, None),) * (dims - 1)
    for i in range(side):
        share, next_share = count[i] / n, count[i + 1] / n
        lower = max(lower, float(np.abs(edges[i + 1] * area - next_share).max()))
        upper = max(
            upper,
            float((edges[i + 1] * next_area - share[first]).max()),
            float((next_share[second] - edges[i] * area[first]).max()),
        )
    return lower, upper


def _prime(most: int) -> int:
    """Return the largest prime up to a number: in powers of their base nets fill cells evenly."""
    return next(k for k in range(most, 1, -1) if all(k % j for j in range(2, int(k**0.5) + 1)))


_COMPARISONS = 2**29
"""Regions times points times dimensions, unless a number of regions is given."""

_MANY = 2**18
"""Number of points in space above which walks on the critical grid take minutes."""


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
        (n d), at most 2^18 and at least 1. No effect for more than 2^18 points in three dimensions.

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

    **Many points.** More than 2^18 points in three dimensions are counted once in 251^3 cells: boxes that end
    at their edges give a lower bound, and the cells themselves are a cover, with an upper bound that is up to
    3/251 larger. This takes O(n) time.

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
    dims = points.shape[1]
    margin = rounding(dims)
    _, index, slopes = attained_by_box(points, worst_box(points) if dims <= 2 else lower)
    values = np.array([max(0.0, lower - margin), min(1.0, upper + margin)])
    return values, np.stack([index] * 2), np.stack([slopes, slopes * (lower == upper)])


def _search(points: Floats, seed: NDArray[np.uint32], regions: int) -> tuple[float, float]:
    """Return the bounds to rounding errors, the lower one with its box if it has one."""
    array = points.astype(np.float64, copy=False)
    n, dims = array.shape
    if dims <= 2:
        lower = star_discrepancy(array)
        return cast(float, lower), cast(float, lower)
    if dims == 3 and n > _MANY:
        return cell_bounds(array)
    grid = critical_grid(array)
    return refine(grid, threshold_accepting(grid, np.random.default_rng(seed)), regions)

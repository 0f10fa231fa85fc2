"""The minimum distance of a point set, optionally tiled.

Many points in up to three dimensions are padded with copies of those near the sides of the tile, to avoid
pairs that wrap around, and sorted. All others are measured by a k-d tree on a set that unfolds the tiling: on
the torus the points themselves with the tile's side as period; for shifted rows of tiles, the points and
their copies in the row above.
"""

import math
from typing import Any

import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from analysis import _arguments
from analysis._distances.closest_pair import closest_pair
from analysis._host import Attained, call_back
from qmcjax.core import checks

_MARGIN = 1 + 2.0**-40
"""Radius of the search for exact minima: more than the tree's rounding errors."""


_MANY = 64
"""Number of points above which they are sorted: two of so many are within a third of a side."""

_INTEGERS = 2.0**53
"""Smaller sums of squares of integers are exact in float64."""


def min_distance(points: ArrayLike, torus: bool = True, shear: float = 0.0) -> float:
    """Return the smallest distance of two points, Eq. 5.5 of [1]_.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d)
        At least two points in [0, 1)^d. Computed in float64, in which float32 points are exact.
    torus : bool, whether the unit cube is repeated periodically; otherwise it stands alone
    shear : float
        Only for two-dimensional tilings: each row of tiles is shifted by ``shear`` in x relative to the row
        below, so the copies of a point are at integer multiples of (1, 0) and (shear, 1) from it. Its integer
        part has no effect and is removed exactly. 0.25 gives the tiling of the permutation nets for even m,
        Fig. 5.18 of [1]_.

    Returns
    -------
    float
        The minimum is over pairs i < j: distances of a point to its own copies do not count. Distances below
        1e-154 may become 0, since they are squared. The error is a few units in the last place for 64
        points or more in at most three dimensions without a shear; otherwise at most d 2^-51, absolute.
        If JAX traces the points (``jit``, ``grad``, ``vmap``), an Array, differentiable: the derivative is
        that of one of the closest pairs; for two equal points it is set to 0.

    Notes
    -----
    In up to three dimensions O(n log n) time and O(n) memory, even for clustered points: 24 bytes per point
    and 8 per coordinate, besides the points. In more dimensions, the time of a k-d tree.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.1.2 and 5.3.1.

    Examples
    --------
    >>> print(round(min_distance([[0.0, 0.0], [0.75, 0.0]]), 9))
    0.25
    """
    array, torus, shear = validate_tiling(points, torus, shear)
    if isinstance(array, Tracer):
        return call_back(
            lambda known: min_distance(known, torus, shear),
            lambda known: _attained(validate_tiling(known, torus, shear)[0], torus, shear),
            array,
            (),
            2,
        )
    found = _sorted_closest_pair(array, 1, torus, shear)
    if found is not None:
        return math.sqrt(found[0])
    if _has_duplicates(array):
        return 0.0
    unfolded, periods = unfold(array, 1, torus, shear)
    return _nearest(tree(unfolded, periods), len(array))


def _attained(points: NDArray[np.float64], torus: bool, shear: float) -> Attained:
    """Return the minimum distance, a closest pair and the derivatives with respect to its points."""
    found = _sorted_closest_pair(points, 1, torus, shear) if shear == 0 else None
    if found[0] == 0 if found else _has_duplicates(points):
        return 0.0, np.zeros(2, np.int64), np.zeros((2, points.shape[1]))
    if found:
        distance = math.sqrt(found[0])
        # Copies lie exactly one period before their points.
        pair = np.array([np.flatnonzero((points == p + (p < 0)).all(axis=1))[0] for p in found[1]])
    else:
        unfolded, periods = unfold(points, 1, torus, shear)
        distances, index = tree(unfolded, periods).query(points, k=2)
        first = int(np.asarray(distances)[:, 1].argmin())
        distance = float(np.asarray(distances)[first, 1])
        pair = np.array([first, np.asarray(index)[first, 1] % len(points)])
    away = directions(points[pair[:1]], points[pair[1:]], torus, shear)[0]
    return distance, pair, np.stack([away, -away])


def directions(
    ends: NDArray[np.float64], starts: NDArray[np.float64], torus: bool, shear: float
) -> NDArray[np.float64]:
    """Return unit vectors to points, shape (m, d), from the nearest copies of others; 0 from equal ones."""
    difference = ends - starts
    if torus:
        rows = np.rint(difference[:, 1:2]) + np.arange(-1, 2) if shear else np.zeros((1, 1))
        along = difference[:, :1] - shear * rows
        along = along - np.rint(along)
        if shear:
            across = difference[:, 1:2] - rows
            nearest = np.hypot(along, across).argmin(axis=1)[:, None]
            difference = np.hstack([np.take_along_axis(part, nearest, 1) for part in (along, across)])
        else:
            difference = difference - np.rint(difference)
    length = np.linalg.norm(difference, axis=1, keepdims=True)
    return difference / np.where(length > 0, length, 1)


def squared_min_distance(points: ArrayLike, side: int, torus: bool = True, shear: int = 0) -> int:
    """Return the exact square of the smallest distance of two points on an integer grid.

    Parameters
    ----------
    points : integer ArrayLike, shape (n, d)
        At least two points in {0, ..., side - 1}^d.
    side : int, in [1, 2**32]: with 2**32 the points may be 32-bit fractions
    torus : bool, whether the cube of this side is repeated periodically
    shear : int
        Only for two-dimensional tilings: the shift of each row of tiles relative to the row below, in
        [-side, side]. ``2**(m - 2)`` for the permutation nets with even m, Fig. 5.18 of [1]_.

    Returns
    -------
    int, the numerator under the root in Table 5.1 of [1]_

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1.

    Examples
    --------
    >>> squared_min_distance([[0, 0], [3, 1]], side=4)
    2
    """
    if isinstance(points, Tracer):
        raise TypeError(f"points must be known integers: min_distance measures traced floats, got {points}")
    given = _arguments.array("points", points, "an array of integers")
    if given.dtype.kind == "f":
        raise TypeError(f"points must be integers, got {given.dtype}: min_distance measures floats")
    side = checks.integer("side", side, 1, 2**32)
    outside = ~((given >= 0) & (given < side))
    if outside.any():
        raise ValueError(f"points must be in [0, {side}), got {given[outside][0]!r}")
    array = _arguments.validate_shape("points", given, least=2).astype(np.int64)
    torus = checks.flag("torus", torus)
    shear = checks.integer("shear", shear, -side, side)
    _validate_shear(array.shape[1], torus, shear)
    found = _sorted_closest_pair(array.astype(np.float64), side, torus, shear)
    if found is not None and found[0] < _INTEGERS:
        return int(found[0])
    if _has_duplicates(array):
        return 0
    unfolded, periods = unfold(array, side, torus, shear)
    grown = tree(unfolded, periods)
    pairs = grown.query_pairs(_nearest(grown, len(array)) * _MARGIN, output_type="ndarray")
    delta = np.abs(unfolded[pairs[:, 0]] - unfolded[pairs[:, 1]])
    delta = np.minimum(delta, periods - delta)
    if delta.shape[1] * int(delta.max()) ** 2 >= 2**63:
        delta = delta.astype(object)
    return int((delta * delta).sum(axis=1).min())


def validate_tiling(points: Any, torus: Any, shear: Any) -> tuple[Any, bool, float]:
    """Return points as float64 or traced, torus and shear in [-1/2, 1/2]; raise unless they fit together."""
    array = _arguments.points(points, least=2, traced=True)
    array = array if isinstance(array, Tracer) else array.astype(np.float64, copy=False)
    torus = checks.flag("torus", torus)
    shear = _arguments.real("shear", shear, "a finite number", math.isfinite)
    _validate_shear(array.shape[1], torus, shear)
    return array, torus, math.remainder(shear, 1.0)  # exact


def packing_distance(n: int, dims: int) -> float:
    """Return the largest minimum distance of n points per unit volume, in one, two or three dimensions.

    These are equal spacing, the hexagonal packing of discs (Thue) and the face-centred cubic packing of balls
    (Hales).
    """
    return (1 / n, math.sqrt(2 / (math.sqrt(3) * n)), math.cbrt(math.sqrt(2) / n))[dims - 1]


def _sorted_closest_pair(
    points: NDArray[np.float64], side: int, torus: bool, shear: float
) -> tuple[float, NDArray[np.float64]] | None:
    """Return the square of the minimum distance and two points or copies; None if sorting does not apply.

    A copy is translated by minus one period. A pair that wraps around is found as the copy of the point
    near the far side, and the other point or a copy of it: one-sided copies suffice, and their coordinates
    are exact.
    """
    n, dims = points.shape
    if n < _MANY or dims > 3:
        return None
    bound = packing_distance(n, dims)
    if not torus:
        bound /= 1 - bound  # the balls of diameter b lie in a cube of side 1 + b, which can be repeated
    bound *= side
    parts = [points.T]
    if torus:
        for axis in reversed(range(dims)):
            for part in parts[:]:
                copies = part[:, part[axis] >= side - bound]
                copies[axis] -= side
                if axis == 1:
                    copies[0] = (copies[0] - shear) % side
                parts.append(copies)
    columns = np.empty((dims, sum(part.shape[1] for part in parts)))
    np.concatenate(parts, axis=1, out=columns)
    return closest_pair(columns, bound)


def _validate_shear(dims: int, torus: bool, shear: float) -> None:
    if shear != 0 and (dims != 2 or not torus):
        raise ValueError(
            f"shear must be 0 unless points are two-dimensional and torus is true, "
            f"got {shear!r} with d={dims} and torus={torus!r}"
        )


def _has_duplicates(points: NDArray) -> bool:
    ordered = points[np.lexsort(points.T)]
    return bool((ordered[1:] == ordered[:-1]).all(axis=1).any())


def unfold(points: NDArray, side: int, torus: bool, shear: float) -> tuple[NDArray, NDArray]:
    """Return a set that starts with the points, and one period per axis, which together measure the tiling.

    A period of twice the extent of the set never wraps. Copies in the row above suffice, since the
    pairs with the row below are the same up to translation. A point's distance to its own copy is at
    least ``side`` and thus not the minimum: two different points are at most ``side / sqrt(2)`` apart.
    """
    dims = points.shape[1]
    if shear == 0:
        return points, np.full(dims, side if torus else 2 * side, points.dtype)
    x = (points[:, 0] + shear) % side
    # The remainder of a tiny negative float is rounded to the side.
    above = np.stack([np.where(x < side, x, 0), points[:, 1] + side], axis=1)
    return np.concatenate([points, above]), np.array([side, 4 * side], points.dtype)


def tree(points: NDArray, periods: NDArray) -> KDTree:
    """Return a k-d tree of distinct points on a torus."""
    # Splitting at midpoints builds faster than at medians; it terminates, since the points are distinct.
    return KDTree(points, boxsize=periods, balanced_tree=False, compact_nodes=False)


def _nearest(grown: KDTree, n: int) -> float:
    """Return the smallest distance of the first n points to another point of the tree."""
    distances, _ = grown.query(grown.data[:n], k=2)
    return float(np.min(np.asarray(distances)[:, 1]))

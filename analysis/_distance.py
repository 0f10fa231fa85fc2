"""The minimum distance of a point set, whose copies may tile space.

A tiling is measured on a set that unfolds it: on the torus the points themselves with the tile's
side as period; where rows of tiles are shifted, the points and their copies in the row above. A k-d
tree finds the closest pairs, whatever the order and the clusters of the points.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from qmcjax import checks

__all__ = ["min_distance", "squared_min_distance"]

_MARGIN = 1 + 2.0**-40
"""Radius of the search for exact minima: more than the tree's rounding errors."""


def min_distance(points: ArrayLike, torus: bool = True, shear: float = 0.0) -> float:
    """Return the smallest distance of two points, Eq. 5.5 of [1]_.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d)
        At least two points in [0, 1)^d. Computed in float64, in which float32 points are exact.
    torus : bool
        Whether the unit cube is repeated periodically; otherwise it stands alone.
    shear : float
        Two-dimensional tilings only: each row of tiles is shifted by ``shear`` in x against the row
        below, so the copies of a point lie at integer multiples of (1, 0) and (shear, 1) from it.
        With 0.25 this is the tiling of the permutation nets for even m, Fig. 5.18 of [1]_.

    Returns
    -------
    float
        Distances of a point to its own copies do not count: the minimum is over pairs i < j.
        Squares are taken on the way: what is below 1e-154 may come out as 0.

    Raises
    ------
    ValueError
        If the points are fewer than two, not floats, or outside [0, 1)^d, or the shear does not apply.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.1.2 and 5.3.1.

    Examples
    --------
    >>> print(round(min_distance([[0.0, 0.0], [0.75, 0.0]]), 9))
    0.25
    """
    given = np.asarray(points)
    if not np.issubdtype(given.dtype, np.floating):
        raise ValueError(
            f"points must be floats, got {given.dtype}: squared_min_distance measures integer coordinates"
        )
    array = _checked(given, 1).astype(np.float64)
    if not isinstance(shear, int | float | np.floating) or not math.isfinite(shear):
        raise ValueError(f"shear must be a finite number, got {shear!r}")
    _check_tiling(array.shape[1], torus, float(shear))
    if _has_duplicates(array):
        return 0.0
    unfolded, periods = _unfold(array, 1, torus, float(shear))
    return _nearest(_tree(unfolded, periods), len(array))


def squared_min_distance(points: ArrayLike, side: int, torus: bool = True, shear: int = 0) -> int:
    """Return the exact square of the smallest distance of two points on an integer grid.

    Parameters
    ----------
    points : integer ArrayLike, shape (n, d)
        At least two points in {0, ..., side - 1}^d.
    side : int
        In [1, 2**32]: with 2**32 the points may be 32-bit fractions.
    torus : bool
        Whether the cube of this side is repeated periodically.
    shear : int
        Two-dimensional tilings only: the shift of each row of tiles against the row below, in
        [-side, side]. ``2**(m - 2)`` for the permutation nets with even m, Fig. 5.18 of [1]_.

    Returns
    -------
    int
        The numerator under the root in Table 5.1 of [1]_.

    Raises
    ------
    ValueError
        If the points are fewer than two, not integers, or off the grid, or the shear does not apply.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1.

    Examples
    --------
    >>> squared_min_distance([[0, 0], [3, 1]], side=4)
    2
    """
    given = np.asarray(points)
    if not np.issubdtype(given.dtype, np.integer):
        raise ValueError(f"points must be integers, got {given.dtype}: min_distance measures floats")
    side = checks.integer("side", side, 1, 2**32)
    array = _checked(given, side).astype(np.int64)
    shear = checks.integer("shear", shear, -side, side)
    _check_tiling(array.shape[1], torus, shear)
    if _has_duplicates(array):
        return 0
    unfolded, periods = _unfold(array, side, torus, shear)
    tree = _tree(unfolded, periods)
    pairs = tree.query_pairs(_nearest(tree, len(array)) * _MARGIN, output_type="ndarray")
    delta = np.abs(unfolded[pairs[:, 0]] - unfolded[pairs[:, 1]])
    delta = np.minimum(delta, periods - delta)
    if delta.shape[1] * int(delta.max()) ** 2 >= 2**63:
        delta = delta.astype(object)
    return int((delta * delta).sum(axis=1).min())


def _checked(points: NDArray, side: int) -> NDArray:
    """Return the points, or raise a ValueError unless they are two or more in [0, side)^d."""
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] < 1:
        raise ValueError(f"points must have shape (n, d) with n >= 2 and d >= 1, got {points.shape}")
    outside = ~((points >= 0) & (points < side))
    if outside.any():
        raise ValueError(f"points must be in [0, {side}), got {points[outside][0]!r}")
    return points


def _check_tiling(dims: int, torus: bool, shear: float) -> None:
    if shear != 0 and (dims != 2 or not torus):
        raise ValueError(
            f"shear must be 0 unless points are two-dimensional and torus is true, "
            f"got {shear!r} with d={dims} and torus={torus!r}"
        )


def _has_duplicates(points: NDArray) -> bool:
    ordered = points[np.lexsort(points.T)]
    return bool((ordered[1:] == ordered[:-1]).all(axis=1).any())


def _unfold(points: NDArray, side: int, torus: bool, shear: float) -> tuple[NDArray, NDArray]:
    """Return a set, the points first, and one period per axis that together measure the tiling.

    A period of twice the extent of the set never wraps. Copies in the row above suffice, since the
    pairs with the row below are the same up to translation. A point's distance to its own copy is at
    least ``side`` and thus not the minimum: two different points are at most ``side / sqrt(2)`` apart.
    """
    dims = points.shape[1]
    if shear == 0:
        return points, np.full(dims, side if torus else 2 * side, points.dtype)
    above = np.stack([(points[:, 0] + shear) % side, points[:, 1] + side], axis=1)
    return np.concatenate([points, above]), np.array([side, 4 * side], points.dtype)


def _tree(points: NDArray, periods: NDArray) -> KDTree:
    # Splitting at midpoints builds faster than at medians; the points are distinct, so it ends.
    return KDTree(points, boxsize=periods, balanced_tree=False, compact_nodes=False)


def _nearest(tree: KDTree, n: int) -> float:
    """Return the smallest distance of the first n points to another point of the tree."""
    distances, _ = tree.query(tree.data[:n], k=2)
    return float(np.min(np.asarray(distances)[:, 1]))

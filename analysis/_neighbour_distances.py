"""The distances of points to their nearest neighbours."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis._distance import checked_tiling, packing_distance, tree, unfold


@dataclass(frozen=True)
class NearestStatistics:
    """Statistics of the distances of n points to their nearest neighbours.

    References
    ----------
    .. [1] A. Lagae, P. Dutre, "A comparison of methods for generating Poisson disk distributions", 2008.
    .. [2] P. J. Clark, F. C. Evans, "Distance to nearest neighbor as a measure of spatial relationships in
       populations", 1954.
    """

    minimum: float
    """The minimum distance of the set."""
    mean: float
    """The mean distance of a point to its nearest neighbour."""
    deviation: float
    """The root of the mean square difference from the mean."""
    maximum: float
    """The largest distance of a point to its nearest neighbour."""
    relative_minimum: float | None
    """The minimum relative to that of the densest packing of n points per unit volume (Lagae and Dutre): at
    most 1 on the torus. None above three dimensions."""
    clark_evans: float
    """The mean relative to that of a Poisson process with n points per unit volume (Clark and Evans): 1 for
    random points, less for clustered, more for evenly spaced ones. Without a torus the boundary raises it."""


def nearest_distances(points: ArrayLike, torus: bool = True, shear: float = 0.0) -> NDArray[np.float64]:
    """Return the distance of each point to the nearest other point.

    Parameters
    ----------
    points, torus, shear
        As in :func:`min_distance`.

    Returns
    -------
    float64 array, shape (n,)
        In the order of the points. A point's own copies do not count, but another point in the same place
        does. The absolute error is at most d 2^-51: where a pair wraps around, coordinates are rounded once
        more.

    Examples
    --------
    >>> print(nearest_distances([[0.0, 0.0], [0.75, 0.0], [0.5, 0.5]]))
    [0.25       0.25       0.55901699]
    """
    array, torus, shear = checked_tiling(points, torus, shear)
    distinct, place, count = np.unique(array, axis=0, return_inverse=True, return_counts=True)
    nearest = np.zeros(len(distinct))
    if len(distinct) > 1:
        # Where rows are shifted, the points see the row above, their copies in it the row below.
        unfolded, periods = unfold(distinct, 1, torus, shear)
        distances, _ = tree(unfolded, periods).query(unfolded, k=2, workers=-1)
        nearest = np.asarray(distances)[:, 1].reshape(-1, len(distinct)).min(axis=0)
    return np.where(count > 1, 0.0, nearest)[place.ravel()]


def nearest_statistics(points: ArrayLike, torus: bool = True, shear: float = 0.0) -> NearestStatistics:
    """Return statistics of the distances of points to their nearest neighbours.

    Parameters
    ----------
    points, torus, shear
        As in :func:`min_distance`.

    Examples
    --------
    >>> nearest_statistics([[0.0, 0.0], [0.5, 0.5]]).mean
    0.7071067811865476
    """
    distances = nearest_distances(points, torus, shear)
    n, dims = np.shape(points)
    minimum, mean = float(distances.min()), float(distances.mean())
    # The probability of a ball without a point is exp(-n V): the mean is Gamma(1 + 1/d) times the radius with
    # n V = 1.
    ball = math.pi ** (dims / 2) / math.gamma(dims / 2 + 1)
    return NearestStatistics(
        minimum=minimum,
        mean=mean,
        deviation=float(distances.std()),
        maximum=float(distances.max()),
        relative_minimum=minimum / packing_distance(n, dims) if dims <= 3 else None,
        clark_evans=mean / (math.gamma(1 + 1 / dims) * (1 / (n * ball)) ** (1 / dims)),
    )

"""The distances of points to their nearest neighbours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._distances.distance import directions, packing_distance, tree, unfold, validate_tiling
from analysis._host import Attained, call_back


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class NearestStatistics:
    """Statistics of the distances of n points to their nearest neighbours: floats, or Arrays if JAX traces.

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
    """The standard deviation of this distance."""
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
        In the order of the points. A point's own copies do not count, but another point at the same position
        does. The absolute error is at most d 2^-51: if a pair wraps around, coordinates are rounded once
        more. If JAX traces the points (``jit``, ``grad``, ``vmap``), an Array, differentiable: the derivative
        is that of one nearest neighbour; for a distance of 0 it is set to 0.

    Examples
    --------
    >>> print(nearest_distances([[0.0, 0.0], [0.75, 0.0], [0.5, 0.5]]))
    [0.25       0.25       0.55901699]
    """
    array, torus, shear = validate_tiling(points, torus, shear)
    if isinstance(array, Tracer):
        return call_back(
            lambda known: nearest_distances(known, torus, shear),
            lambda known: _attained(validate_tiling(known, torus, shear)[0], torus, shear),
            array,
            array.shape[:1],
            2,
        )
    return _nearest(array, torus, shear)[0]


def _nearest(
    points: NDArray[np.float64], torus: bool, shear: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distance of each point to the nearest other one, and its number; itself if alone."""
    distinct, first, place, count = np.unique(
        points, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    nearest, index = np.zeros(len(distinct)), np.arange(len(distinct))
    if len(distinct) > 1:
        # Where rows are shifted, the points see the row above, their copies in it the row below.
        unfolded, periods = unfold(distinct, 1, torus, shear)
        distances, neighbours = tree(unfolded, periods).query(unfolded, k=2, workers=-1)
        either = np.asarray(distances)[:, 1].reshape(-1, len(distinct))
        row = either.argmin(axis=0)
        nearest = either[row, index]
        index = np.asarray(neighbours)[:, 1].reshape(-1, len(distinct))[row, index] % len(distinct)
    place = place.ravel()
    return np.where(count > 1, 0.0, nearest)[place], first[index][place]


def _attained(points: NDArray[np.float64], torus: bool, shear: float) -> Attained:
    nearest, index = _nearest(points, torus, shear)
    away = directions(points, points[index], torus, shear) * (nearest > 0)[:, None]
    return nearest, np.stack([np.arange(len(points)), index], axis=1), np.stack([away, -away], axis=1)


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
    traced = isinstance(distances, Tracer)
    number: Any = jnp.asarray if traced else float
    deviation = _arguments.root(distances.var()) if traced else distances.std()
    minimum, mean = number(distances.min()), number(distances.mean())
    # The probability of a ball without a point is exp(-n V): the mean is Gamma(1 + 1/d) times the radius with
    # n V = 1.
    ball = math.pi ** (dims / 2) / math.gamma(dims / 2 + 1)
    return NearestStatistics(
        minimum=minimum,
        mean=mean,
        deviation=number(deviation),
        maximum=number(distances.max()),
        relative_minimum=minimum / packing_distance(n, dims) if dims <= 3 else None,
        clark_evans=mean / (math.gamma(1 + 1 / dims) * (1 / (n * ball)) ** (1 / dims)),
    )

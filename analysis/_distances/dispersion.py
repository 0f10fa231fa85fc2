"""The dispersion of a point set: the radius of the largest ball without a point.

A largest empty ball has points on all sides of its centre: the centre is a vertex of the Voronoi diagram of
the points, that is, the centre of the circumsphere of a Delaunay simplex. On the torus the points are
repeated by translation. In the cube they are reflected in its faces: within the cube, reflected points are
never closer than the originals, and the diagram of all points has vertices in the corners of the cube and
where its boundary crosses the Voronoi diagram.

Copies within an upper bound of the dispersion suffice: no point on the sphere of a largest empty ball and no
nearest point is farther away.

Almost flat simplices of cospherical points have inaccurate centres. So distances are measured from the
centres to the nearest point. None can exceed the dispersion, wherever the centre is.
"""

import math

import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls
from scipy.spatial import Delaunay, KDTree

from analysis import _arguments
from analysis._host import Attained, call_back
from qmcjax.core import checks

_ROUNDING = 2.0**-36
"""Relative effect of rounding errors on a radius."""

_ALIKE = 4096
"""Number of centres measured first; it doubles each time."""

Floats = NDArray[np.float64]


def dispersion(points: ArrayLike, torus: bool = True) -> float:
    """Return the largest distance of a point in the unit cube to the nearest of the given points.

    It is also known as the covering radius.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d)
        At least one point in [0, 1)^d, d at most 3. Computed in float64, in which float32 points are exact.
    torus : bool, whether the unit cube is repeated periodically; otherwise it stands alone

    Returns
    -------
    float
        Euclidean; exact up to rounding errors, which never make it larger by more than 2^-50.
        If JAX traces the points (``jit``, ``grad``, ``vmap``), an Array, differentiable: the derivative is
        that of one largest empty ball, with respect to the points on its sphere.

    Raises
    ------
    ValueError
        In more than three dimensions. There the largest distance of many random positions to the nearest
        point, by ``scipy.spatial.KDTree``, is a lower bound.

    Notes
    -----
    The time is that of a Delaunay triangulation, O(n log n) for points spread over the cube, with about 2
    simplices per point in two dimensions and 7 in three: some 0.7 and 4.5 kB per point, so memory grows
    beyond 1 GB from 2^20 points in two dimensions, and from 2^18 in three.

    References
    ----------
    .. [1] H. Niederreiter, "Random Number Generation and Quasi-Monte Carlo Methods", 1992, Sect. 6.1, for
       the dispersion, and the Voronoi diagram in its computation.

    Examples
    --------
    >>> print(round(dispersion([[0.5, 0.5]], torus=False), 9))
    0.707106781
    """
    given = _arguments.points(points, most_dims=3, traced=True)
    torus = checks.flag("torus", torus)
    if isinstance(given, Tracer):
        return call_back(
            lambda known: dispersion(known, torus),
            lambda known: _attained(known.astype(np.float64), torus),
            given,
            (),
            given.shape[1] + 1,
        )
    return _ball(given.astype(np.float64, copy=False), torus)[0]


def _attained(points: Floats, torus: bool) -> Attained:
    """Return the dispersion, points on the sphere of a largest empty ball, and the derivatives.

    At its centre c the largest radius R is stationary in c: the directions u_k from c to points on the sphere
    have weights w_k >= 0 of sum 1 with sum w_k u_k = 0, and dR = sum w_k u_k . dp_k. A copy moves with its
    point, a reflected one in the opposite direction along the reflected axes.
    """
    radius, centre = _ball(points, torus)
    dims = points.shape[1]
    near = radius * (1 + _ROUNDING) + _ROUNDING
    index, signs, ends = _images(points, centre - near, centre + near, torus)
    distance = np.linalg.norm(ends - centre, axis=1)
    touched = distance <= near
    index, signs = index[touched], signs[touched]
    directions = (ends - centre)[touched] / distance[touched, None]
    weights, _ = nnls(np.vstack([directions.T, np.ones(len(index))]), np.append(np.zeros(dims), 1.0))
    most = np.argsort(-weights, kind="stable")[: dims + 1]
    slopes, which = np.zeros((dims + 1, dims)), np.zeros(dims + 1, np.int64)
    which[: len(most)] = index[most]
    slopes[: len(most)] = (weights[:, None] * directions * signs)[most]
    return radius, which, slopes


def _ball(array: Floats, torus: bool) -> tuple[float, Floats]:
    """Return radius and centre of a largest empty ball."""
    dims = array.shape[1]
    if dims == 1:
        return _line_ball(np.unique(array), torus)
    margin = _upper_bound(array, torus)
    copies = _images(np.unique(array, axis=0), -margin, 1 + margin, torus)[2]
    copies = copies if torus else np.unique(copies, axis=0)
    centres, radii = _circumspheres(copies, Delaunay(copies).simplices)
    inside = ((centres >= -_ROUNDING) & (centres <= 1 + _ROUNDING)).all(axis=1)
    inside &= radii <= margin * (1 + _ROUNDING)
    centres, radii = np.clip(centres[inside], 0, 1), radii[inside]
    order = np.argsort(-radii, kind="stable")
    centres, radii = centres[order], radii[order]
    tree = KDTree(copies, balanced_tree=False, compact_nodes=False)
    best, centre, start, count = 0.0, np.zeros(dims), 0, _ALIKE
    while start < len(radii) and radii[start] * (1 - _ROUNDING) > best:
        distances = np.asarray(tree.query(centres[start : start + count])[0])
        k = int(distances.argmax())
        if distances[k] > best:
            best, centre = float(distances[k]), centres[start + k]
        start, count = start + count, 2 * count
    return best, centre


def _line_ball(ordered: Floats, torus: bool) -> tuple[float, Floats]:
    first, last = ordered[0], ordered[-1]
    ends = [(first + (1 - last)) / 2] if torus else [first, 1 - last]
    radii = np.concatenate([ends, np.diff(ordered) / 2])
    centres = np.concatenate([[first - ends[0]] if torus else [0, 1], (ordered[1:] + ordered[:-1]) / 2])
    k = int(radii.argmax())
    return float(radii[k]), centres[[k]] % 1 if torus else centres[[k]]


def _upper_bound(points: Floats, torus: bool) -> float:
    """Return the diagonal of two boxes along each axis, for the finest grid without a large hole.

    In such a grid each box or one of its neighbours has a point.
    """
    n, dims = points.shape
    side = math.ceil((2 * n) ** (1 / dims))
    while side > 2:
        full = np.zeros((side,) * dims, np.bool_)
        full[tuple((points.T * side).astype(np.int64))] = True
        for axis in range(dims):
            line = np.moveaxis(full, axis, 0)
            before, first = line[:-1].copy(), line[0].copy()
            line[:-1] |= line[1:]
            line[1:] |= before
            if torus:
                line[-1] |= first
                line[0] |= before[-1]
        if full.all():
            break
        side = side * 7 // 8
    return min(2 * math.sqrt(dims) / side, math.sqrt(dims) / (2 if torus else 1))


def _images(
    points: Floats, low: Floats | float, high: Floats | float, torus: bool
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Return the points, copies and reflected points in a box: numbers of points, directions, coordinates.

    A direction is -1 along the reflected axes, 1 along others.
    """
    index, signs = np.arange(len(points)), np.ones_like(points)
    low, high = (np.broadcast_to(end, points.shape[1:]) for end in (low, high))
    for axis in range(points.shape[1]):
        parts = []
        for sign in (0, -1, 1):
            moved, flipped = points.copy(), signs.copy()
            if sign and not torus:
                moved[:, axis], flipped[:, axis] = (1 + sign) - points[:, axis], -flipped[:, axis]
            else:
                moved[:, axis] += sign
            kept = (moved[:, axis] >= low[axis]) & (moved[:, axis] <= high[axis])
            parts.append((index[kept], flipped[kept], moved[kept]))
        index, signs, points = (np.concatenate(part) for part in zip(*parts, strict=True))
    return index, signs, points


def _circumspheres(points: Floats, simplices: NDArray[np.int32]) -> tuple[Floats, Floats]:
    """Return the centres and radii of the spheres through simplices, by Cramer's rule.

    With edges e_k from the first corner, the centre c relative to it solves 2 e_k . c = |e_k|^2.
    """
    first = points[simplices[:, 0]]
    edges = [points[simplices[:, k]] - first for k in range(1, simplices.shape[1])]
    squares = [np.square(edge).sum(axis=1, keepdims=True) for edge in edges]
    if len(edges) == 2:
        (a, b), (aa, bb) = edges, squares
        numerator = np.array([[1, -1]]) * (aa * b[:, ::-1] - bb * a[:, ::-1])
        determinant = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    else:
        (a, b, c), (aa, bb, cc) = edges, squares
        numerator = aa * np.cross(b, c) + bb * np.cross(c, a) + cc * np.cross(a, b)
        determinant = (a * np.cross(b, c)).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        relative = numerator / (2 * determinant)[:, None]
        return first + relative, np.sqrt(np.square(relative).sum(axis=1))

"""Lloyd relaxation on the torus: each point moves to the centroid of its Voronoi cell."""

import itertools

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""Of shape (n, d); and moments of their cells."""


def relaxed(points: Points, iterations: int) -> Points:
    """Return the points after some iterations, in [0, 1)."""
    for _ in range(iterations):
        points = centroids(points)
        points -= np.floor(points)
        # The remainder of a tiny negative number is exactly 1.
        points[points == 1] = 0
    return points


def centroids(points: Points) -> Points:
    """Return the centroid of each point's Voronoi cell on the torus.

    Copies of the points in a margin around the unit cube are added. The margin must be twice as wide as the
    largest circumscribed sphere that touches one of the points; it is widened until it is.
    """
    n, d = points.shape
    margin = 3 * n ** (-1 / d)
    while True:
        moments, reach = _moments(_with_margin(points, margin), n)
        if 2 * reach <= margin:
            return points + moments[:, 1:] / moments[:, :1]
        margin *= 1.5


def _with_margin(points: Points, margin: float) -> Points:
    """Return the points, followed by their copies up to ``margin`` from the unit cube."""
    for axis in range(points.shape[1]):
        step = np.zeros(points.shape[1])
        step[axis] = 1
        copies = [points]
        for tile in range(1, int(np.ceil(margin)) + 1):
            copies.append((points + tile * step)[points[:, axis] + tile < 1 + margin])
            copies.append((points - tile * step)[points[:, axis] - tile >= -margin])
        points = np.concatenate(copies)
    return points


def _moments(points: Points, n: int) -> tuple[Points, float]:
    """Return volume and first moments of the cells of the first n points, and the reach of these cells.

    A cell is the signed sum of simplices with corners at the circumcentres of nested faces of a Delaunay
    simplex: the point itself, the midpoint of an edge, ..., the circumcentre of the simplex. Moments are
    about the point.
    """
    from scipy.spatial import Delaunay

    d = points.shape[1]
    simplices = Delaunay(points).simplices
    simplices = simplices[(simplices < n).any(axis=1)]
    corners = points[simplices]
    edges = corners[:, 1:] - corners[:, :1]
    orientation = np.linalg.det(edges)
    solid = np.abs(orientation) > 1e-9 * np.linalg.norm(edges, axis=2).prod(axis=1)
    simplices, corners, orientation = simplices[solid], corners[solid], np.sign(orientation[solid])
    centres = {
        face: _circumcentres(corners[:, face])
        for size in range(1, d + 2)
        for face in itertools.combinations(range(d + 1), size)
    }
    moments = np.zeros((n, 1 + d))
    for flag in itertools.permutations(range(d + 1)):
        chain = [centres[tuple(sorted(flag[:size]))] - corners[:, flag[0]] for size in range(2, d + 2)]
        parity = round(np.linalg.det(np.eye(d + 1)[list(flag)]))
        volume = np.linalg.det(np.stack(chain, axis=1)) * orientation * parity
        first = np.stack(chain).sum(axis=0) * (volume / (d + 1))[:, None]
        point = simplices[:, flag[0]]
        own = point < n
        for j, values in enumerate([volume, *first.T]):
            moments[:, j] += np.bincount(point[own], values[own], minlength=n)
    whole = centres[tuple(range(d + 1))]
    return moments, float(np.linalg.norm(whole - corners[:, 0], axis=1).max())


def _circumcentres(corners: Points) -> Points:
    """Return the points in the affine hull of (..., k, d) corners equidistant from all."""
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.transpose(0, 2, 1)
    weights = np.linalg.solve(gram, np.diagonal(gram, axis1=1, axis2=2)[..., None] / 2)
    return corners[:, 0] + (weights * edges).sum(axis=1)

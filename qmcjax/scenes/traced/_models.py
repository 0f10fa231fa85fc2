"""Procedural models: outlines joined to meshes, rods, pieces of furniture."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]


def loft(rings: ArrayLike, start: ArrayLike, end: ArrayLike) -> Points:
    """Join successive closed outlines to a mesh, and close the ends by fans.

    ``rings``: float ArrayLike, shape (k, n, 3): k outlines of n vertices; counterclockwise for a viewer on
    the side of the next outline. ``start``, ``end``: float ArrayLike, shape (3,): tips of the fans. Returns
    float64 ndarray, shape (2 n k, 3, 3): triangles with outward normals.
    """
    rings = np.asarray(rings, np.float64)
    following = np.roll(rings, -1, axis=1)
    a, b, c, d = rings[:-1], following[:-1], following[1:], rings[1:]
    sides = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)
    first = np.stack([following[0], rings[0], np.broadcast_to(start, rings[0].shape)], axis=1)
    last = np.stack([rings[-1], following[-1], np.broadcast_to(end, rings[0].shape)], axis=1)
    return np.concatenate([sides, first, last])


def hull(stations: ArrayLike, count: int, roundness: float) -> Points:
    """Return outlines perpendicular to the x-axis for :func:`loft`, shape (k, count, 3).

    ``stations``: float ArrayLike, shape (k, 4): x, increasing; the height y of the centre; half the extent in
    y and in z. ``count``: vertices of each outline. ``roundness``: 1 is an ellipse, values towards 0 a
    rectangle: coordinates are those of the circle to this power.
    """
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    across, up = (np.sign(f(angle)) * np.abs(f(angle)) ** roundness for f in (np.cos, np.sin))
    x, y, tall, wide = np.asarray(stations, np.float64).T[:, :, None]
    # Seen against the x-axis z runs to the left.
    return np.stack([x + 0 * across, y + tall * up, -wide * across], axis=-1)


def circle(count: int, radius: float, height: float, turn: float = 0.0) -> Points:
    """Return points of a horizontal circle about the y-axis, shape (count, 3); the first is turned from x."""
    angle = 2 * np.pi * (np.arange(count) / count + turn)
    return np.stack([radius * np.cos(angle), np.full(count, float(height)), radius * np.sin(angle)], axis=-1)


def table(centre: ArrayLike, size: ArrayLike, thickness: float) -> tuple[Points, Points]:
    """Return the boxes of a table on y = 0, low and high, shape (5, 3) each.

    ``centre``: float ArrayLike, shape (2,): x and z. ``size``: float ArrayLike, shape (3,): along x, y and z.
    ``thickness``: of the top and the legs.
    """
    (x, z), (wide, tall, deep) = np.asarray(centre), np.asarray(size)
    top = [[x - wide / 2, tall - thickness, z - deep / 2], [x + wide / 2, tall, z + deep / 2]]
    legs = [
        _post(x + i * (wide / 2 - thickness), z + k * (deep / 2 - thickness), thickness, 0, tall - thickness)
        for i in (-1, 1)
        for k in (-1, 1)
    ]
    low, high = np.moveaxis(np.array([top, *legs], np.float64), 1, 0)
    return low, high


def chair(centre: ArrayLike, back: ArrayLike) -> tuple[Points, Points]:
    """Return the boxes of a chair on y = 0, low and high, shape (8, 3) each.

    ``centre``: float ArrayLike, shape (2,): x and z. ``back``: int ArrayLike, shape (2,): the direction in x
    and z, a unit vector along an axis, of its back rest.
    """
    (x, z), forth = np.asarray(centre, np.float64), np.asarray(back)
    aside, half, thin = forth[::-1], 0.21, 0.04
    ahead = 0.19 * forth
    seat = [[x - half, 0.43, z - half], [x + half, 0.47, z + half]]
    posts, legs = [], []
    for side in (-1, 1):
        px, pz = np.array([x, z]) + ahead + 0.19 * side * aside
        posts.append(_post(px, pz, thin, 0, 0.95))
        px, pz = np.array([x, z]) - ahead + 0.19 * side * aside
        legs.append(_post(px, pz, thin, 0, 0.43))
    reach = np.abs(0.17 * aside) + np.abs(0.01 * forth)
    slats = [
        [
            [x + ahead[0] - reach[0], y, z + ahead[1] - reach[1]],
            [x + ahead[0] + reach[0], y + 0.08, z + ahead[1] + reach[1]],
        ]
        for y in (0.57, 0.70, 0.83)
    ]
    low, high = np.moveaxis(np.array([seat, *posts, *legs, *slats], np.float64), 1, 0)
    return low, high


def _post(x: float, z: float, thick: float, bottom: float, top: float) -> list[list[float]]:
    return [[x - thick / 2, bottom, z - thick / 2], [x + thick / 2, top, z + thick / 2]]

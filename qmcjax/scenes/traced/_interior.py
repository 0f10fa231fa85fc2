"""A room with a table and chairs, lit through a window."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax import tracing
from qmcjax.scenes.traced._base import Traced

Points = NDArray[np.float64]

LOW, HIGH = np.array([-2.2, 0.0, -3.0]), np.array([2.2, 2.6, 2.6])
"""Corners of the room."""

WINDOW = ((0.85, 2.25), (-2.0, -0.2))
"""In the left wall: its extent along y and z."""


def interior(bounces: int = 6, *, roulette: int | None = None) -> Traced:
    """Return a dining room lit mostly by reflected light.

    The only light is outside a window. It directly lights a part of the table and the floor, and the rest by
    diffuse reflection. The scene is still.

    Parameters
    ----------
    bounces : int, optional
        Directions of a path after the first, in [0, 64].
    roulette : int, optional
        First bounce with Russian roulette, see :func:`qmcjax.tracing.path_tracing`; none by default.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert curve", 2022, Fig. 5.
    .. [2] A. G. M. Ahmed, P. Wonka, "Screen-space blue-noise diffusion of Monte Carlo sampling error via
       hierarchical ordering of pixels", 2020, Fig. 1 and 10 (c).

    Examples
    --------
    >>> interior(bounces=2).needs[:4]
    ('x', 'y', 'light_u', 'light_v')
    """
    light = tracing.rectangle_light((-4.2, 2.2, -2.6), (0.9, 1.6, 0.0), (0.0, 0.0, 3.2), (42.0, 42.0, 43.0))
    camera = tracing.camera((0.9, 1.55, 2.5), (-0.25, 0.85, -0.9), fov=54.0, shutter=0.0)
    world = tracing.world([*_room(), *_furniture()], [light])
    return Traced("interior", tracing.path_tracing(world, camera, bounces, roulette=roulette))


def _room() -> list[tracing.Object]:
    (x0, y0, z0), (x1, y1, z1) = LOW, HIGH
    (bottom, top), (far, near) = WINDOW
    wide, tall, deep = HIGH - LOW
    # Corner and edges: ceiling, back, front, right; then below, above, behind and in front of the window.
    walls = [
        ([x0, y1, z0], [wide, 0, 0], [0, 0, deep]),
        ([x0, y0, z0], [wide, 0, 0], [0, tall, 0]),
        ([x0, y0, z1], [wide, 0, 0], [0, tall, 0]),
        ([x1, y0, z0], [0, 0, deep], [0, tall, 0]),
        ([x0, y0, z0], [0, 0, deep], [0, bottom, 0]),
        ([x0, top, z0], [0, 0, deep], [0, y1 - top, 0]),
        ([x0, bottom, z0], [0, 0, far - z0], [0, top - bottom, 0]),
        ([x0, bottom, near], [0, 0, z1 - near], [0, top - bottom, 0]),
    ]
    planks = tracing.stripes((0.45, 0.28, 0.15), (0.38, 0.22, 0.11), scale=22.0)
    frame = [[x0 - 0.05, bottom, 0.5 * (far + near) - 0.03], [x0 - 0.05, 0.5 * (bottom + top) - 0.03, far]]
    bars = [[x0, top, 0.5 * (far + near) + 0.03], [x0, 0.5 * (bottom + top) + 0.03, near]]
    sky = tracing.rectangle(
        [x0 - 4.0, -3.0, -9.0], [0, 0, 14.0], [0, 8.0, 0], material=tracing.emitter((0.4, 0.55, 0.8))
    )
    return [
        sky,
        tracing.rectangle(*zip(*walls, strict=True), material=tracing.diffuse((0.78, 0.77, 0.74))),
        tracing.rectangle([x0, y0, z1], [wide, 0, 0], [0, 0, -deep], material=tracing.diffuse(planks)),
        tracing.box(frame, bars, material=tracing.diffuse(0.6)),
        tracing.box(
            [-0.9, 1.1, z0],
            [0.5, 2.0, z0 + 0.04],
            material=tracing.diffuse(tracing.checker((0.65, 0.2, 0.1), (0.1, 0.25, 0.4), scale=3.0)),
        ),
    ]


def _furniture() -> list[tracing.Object]:
    pieces = [
        _table([-0.3, -1.0], [1.7, 0.74, 0.95], 0.06),
        _chair([-0.75, -0.4], [0, 1]),
        _chair([0.2, -0.35], [0, 1]),
        _chair([-0.75, -1.65], [0, -1]),
        _chair([0.15, -1.65], [0, -1]),
        _chair([0.85, -1.0], [1, 0]),
    ]
    low, high = (np.concatenate(part) for part in zip(*pieces, strict=True))
    return [
        tracing.box(low, high, material=tracing.diffuse((0.5, 0.33, 0.18))),
        tracing.sphere(
            [[-0.45, 0.85, -1.05], [-0.27, 0.82, -0.9]],
            [0.11, 0.08],
            material=tracing.diffuse((0.75, 0.3, 0.06)),
        ),
        tracing.cylinder(
            [0.1, 0.74, -1.1], [0.0, 0.22, 0.0], 0.08, material=tracing.diffuse((0.15, 0.35, 0.5))
        ),
    ]


def _table(centre: ArrayLike, size: ArrayLike, thickness: float) -> tuple[Points, Points]:
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


def _chair(centre: ArrayLike, back: ArrayLike) -> tuple[Points, Points]:
    """Return the boxes of a chair on y = 0, low and high, shape (8, 3) each.

    ``centre``: float ArrayLike, shape (2,): x and z. ``back``: int ArrayLike, shape (2,): direction of the
    back rest in x and z, a unit vector along an axis.
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

"""Rooms: a box with a moving mirror sphere and a jumping ball; a table and chairs, lit through a window."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax import tracing
from qmcjax.core import checks
from qmcjax.core.parameters import positive, require
from qmcjax.scenes.traced._base import Traced, is_analytic, seen_in_time
from qmcjax.tracing import motion

WHITE, RED, GREEN = (0.73, 0.73, 0.73), (0.63, 0.065, 0.05), (0.14, 0.45, 0.091)

BALL, MIRROR = 0.28, 0.38
"""Radii."""


def cornell_box(
    shutter: Any = (0.0, 1.0),
    *,
    ball: bool = True,
    mirror: bool = True,
    blocks: bool = False,
    light: Any = None,
    bounces: int | None = None,
    visibility: str = "sampled",
) -> Traced:
    """Return a Cornell box with a moving mirror sphere and a bouncing ball whose path has a kink.

    The box is 2 wide, 2 high and 2 deep; the floor is at y = 0, the open side faces the camera. All motion is
    between times 0 and 1.

    Parameters
    ----------
    shutter : (float, float) or float, optional
        When it opens and closes, in [0, 1]; or the time of a still image, which has no time coordinate.
    ball, mirror : bool, optional, whether the ball and the mirror sphere exist
    blocks : bool, optional, whether the two blocks of the original exist
    light : float, optional
        The side of a square light below the ceiling, above 0 and below 2; by default a point light.
    bounces : int, optional
        Number of reflections, see :func:`qmcjax.tracing.path_tracing`; by default only direct light, also in
        the mirror sphere.
    visibility : str, optional
        "sampled": by a time coordinate; "analytic": exactly, see :func:`qmcjax.tracing.analytic_visibility`.
        The paths are then linear segments, at most 0.0018 from the curves.

    Notes
    -----
    The centre of the ball moves on a quadratic B-spline with a double knot where it touches the floor.
    Without ``ball`` and ``mirror`` nothing moves: set ``shutter`` to one number.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.2.1.

    Examples
    --------
    >>> cornell_box().needs[:3]
    ('x', 'y', 'time')
    """
    size = None if light is None else positive("light", light)
    if size is not None:
        require("light", size, lambda side: side < 2, "below 2")
    analytic = is_analytic(visibility)
    gliding, jumping = (
        motion.affine(None, _straight(path, segments) if analytic else path)
        for path, segments in ((_gliding(), 4), (_jumping(), 16))
    )
    objects = [_walls(), *_sides()]
    if checks.flag("mirror", mirror):
        objects.append(tracing.sphere([0.0, 0.0, 0.0], MIRROR, motion=gliding, material=tracing.mirror(0.9)))
    if checks.flag("ball", ball):
        material = tracing.glossy(0.6, 0.25, (0.75, 0.5, 0.08))
        objects.append(tracing.sphere([0.0, 0.0, 0.0], BALL, motion=jumping, material=material))
    if checks.flag("blocks", blocks):
        white = tracing.diffuse(WHITE)
        objects.append(
            tracing.box(
                [[-0.7, 0.0, -0.7], [0.1, 0.0, -0.1]], [[-0.1, 1.2, -0.1], [0.7, 0.6, 0.5]], material=white
            )
        )
    world = tracing.world(objects, _lights(size))
    camera = tracing.camera((0.0, 1.0, 4.4), (0.0, 1.0, 0.0), fov=32.4, shutter=shutter)
    if bounces is None:
        estimator: Any = tracing.direct_light(world, camera, mirrors=1 if mirror else 0)
    else:
        estimator = tracing.path_tracing(world, camera, bounces)
    return Traced("cornell_box", seen_in_time(estimator, analytic))


def _walls() -> tracing.Object:
    corners = [[-1.0, 0.0, 1.0], [-1.0, 2.0, -1.0], [-1.0, 0.0, -1.0]]
    edges_u = [[2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    edges_v = [[0.0, 0.0, -2.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0]]
    return tracing.rectangle(corners, edges_u, edges_v, material=tracing.diffuse(WHITE))


def _sides() -> list[tracing.Object]:
    return [
        tracing.rectangle([x, 0.0, -x], [0.0, 0.0, 2 * x], [0.0, 2.0, 0.0], material=tracing.diffuse(color))
        for x, color in ((-1.0, RED), (1.0, GREEN))
    ]


def _lights(size: float | None) -> list[Any]:
    if size is None:
        return [tracing.point_light((0.3, 1.75, 1.7), (12.0, 11.6, 10.6))]
    # Equal power for all sizes; the normal points down.
    radiance = np.array([9.0, 8.0, 6.5]) * 0.25 / size**2
    corner = (-0.5 * size, 1.999, -0.5 * size)
    return [tracing.rectangle_light(corner, (size, 0.0, 0.0), (0.0, 0.0, size), radiance)]


def _straight(path: motion.Nurbs, segments: int) -> motion.LinearSegments:
    """Return a path as linear segments that touch the floor where the path does."""
    return motion.approximated(path, 0.0, 1.0, segments, path.corners)


def _jumping() -> motion.Nurbs:
    """Return the path of the ball's centre: down to the floor and immediately up again."""
    control = [
        [-0.62, 0.9, 0.1],
        [-0.45, 0.86, 0.14],
        [-0.33, BALL, 0.18],
        [-0.21, 0.66, 0.22],
        [-0.05, 0.7, 0.26],
    ]
    return motion.nurbs(control, None, [0, 0, 0, 0.55, 0.55, 1, 1, 1], 2)


def _gliding() -> motion.Nurbs:
    """Return the path of the mirror sphere's centre over the floor."""
    control = [[0.36, MIRROR, -0.45], [0.46, MIRROR, -0.42], [0.52, MIRROR, -0.3]]
    return motion.nurbs(control, None, [0, 0, 0, 1, 1, 1], 2)


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

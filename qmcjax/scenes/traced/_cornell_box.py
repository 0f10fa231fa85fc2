"""A box with a moving mirror sphere and a jumping ball."""

from typing import Any

import numpy as np

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

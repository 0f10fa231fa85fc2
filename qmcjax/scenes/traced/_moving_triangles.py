"""Triangles with linearly moving vertices, over a checkerboard."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax import tracing
from qmcjax.core import checks
from qmcjax.scenes.traced._base import Traced, is_analytic, seen_in_time

COLOURS = ((0.85, 0.2, 0.12), (0.1, 0.32, 0.75), (0.95, 0.68, 0.08), (0.1, 0.55, 0.3))
EYE = (0.0, 5.0, 4.0)


def moving_triangles(count: Any = 12, shutter: Any = (0.0, 1.0), *, visibility: str = "sampled") -> Traced:
    """Return triangles that fly and turn over a checkerboard; each vertex moves on a straight line.

    Sizes and positions do not depend on the number of triangles: twice as many overlap twice as often, and
    more triangles include those of fewer. The light is at the camera, so objects hide their shadows.

    Parameters
    ----------
    count : int, optional, number of triangles, in [1, 4096]
    shutter : (float, float) or float, optional, see :func:`cornell_box`
    visibility : str, optional
        "sampled": by a time coordinate; "analytic": exactly, see :func:`qmcjax.tracing.analytic_visibility`.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.2.1.

    Examples
    --------
    >>> moving_triangles().needs
    ('x', 'y', 'time')
    >>> moving_triangles(visibility="analytic").needs
    ('x', 'y', 'shading')
    """
    analytic = is_analytic(visibility)
    opened, closed = _flights(checks.integer("count", count, 1, 4096))
    kinds = len(COLOURS)
    objects = [
        tracing.triangles(opened[k::kinds], closed[k::kinds], material=tracing.diffuse(color))
        for k, color in enumerate(COLOURS)
        if k < len(opened)
    ]
    board = tracing.checker((0.8, 0.8, 0.78), (0.12, 0.12, 0.14), scale=0.5)
    objects.append(tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse(board)))
    world = tracing.world(objects, [tracing.point_light(EYE, (140.0, 140.0, 140.0))])
    camera = tracing.camera(EYE, (0.0, 0.4, 0.0), fov=38.0, shutter=shutter)
    return Traced("moving_triangles", seen_in_time(tracing.direct_light(world, camera), analytic))


def _flights(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return vertices when the shutter opens and closes, (count, 3, 3)."""
    rng = np.random.default_rng(2008)
    # One row of numbers per triangle: more triangles leave the previous ones as they are.
    number = rng.uniform(-1, 1, (count, 13))
    centre = number[:, 0:3] * [1.7, 0.7, 1.5] + [0.0, 1.1, 0.0]
    flight = number[:, 3:6] * [0.7, 0.2, 0.7]
    size = 0.4 + 0.12 * number[:, 6]
    turns = number[:, 7], number[:, 7] + 0.25 * number[:, 8]
    tilt = number[:, 9:11], number[:, 9:11] + 0.4 * number[:, 11:13]
    ends = [
        centre[:, None] + sign * flight[:, None] + size[:, None, None] * _corners(np.pi * turn, lean)
        for sign, turn, lean in zip((-0.5, 0.5), turns, tilt, strict=True)
    ]
    return ends[0], ends[1]


def _corners(turn: NDArray[np.float64], lean: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return corners of equilateral triangles, flat and turned, and then sheared upwards."""
    angle = turn[:, None] + 2 * np.pi * np.arange(3) / 3
    x, z = np.cos(angle), np.sin(angle)
    return np.stack([x, lean[:, :1] * x + lean[:, 1:] * z, z], axis=-1)

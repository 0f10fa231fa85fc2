"""Rods that hide three coloured lights."""

from typing import Any

import numpy as np

from qmcjax import tracing
from qmcjax.core.parameters import numbers, require
from qmcjax.scenes.traced._base import Traced
from qmcjax.scenes.traced._models import circle

RODS = 10
COLOURS = ((1.0, 0.16, 0.1), (0.12, 1.0, 0.2), (0.15, 0.25, 1.0))


def occluder(size: Any = 0.45) -> Traced:
    """Return a basket of rods lit by three coloured area lights.

    Straight rods of two families on a hyperboloid cast three overlapping soft shadows; the floor is white
    where all lights are visible. The scene is still.

    Parameters
    ----------
    size : float, optional
        Side of the square lights, in [0.001, 2]. Their power is the same for all sizes.

    References
    ----------
    .. [1] A. G. M. Ahmed, P. Wonka, "Screen-space blue-noise diffusion of Monte Carlo sampling error via
       hierarchical ordering of pixels", 2020, Fig. 9.

    Examples
    --------
    >>> occluder().needs
    ('x', 'y', 'light', 'light_u', 'light_v')
    """
    size = numbers("size", size)
    require("size", size, lambda s: (s >= 0.001) & (s <= 2), "in [0.001, 2]")
    floor = tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse(0.75))
    basket = tracing.group(_basket(), material=tracing.diffuse((0.7, 0.66, 0.6)))
    lights = [_light(angle, size, colour) for angle, colour in zip((0.07, 0.4, 0.74), COLOURS, strict=True)]
    camera = tracing.camera((0.0, 4.4, 5.6), (0.0, 0.3, 0.15), fov=38.0, shutter=0.0)
    return Traced("occluder", tracing.direct_light(tracing.world([floor, basket], lights), camera))


def _basket() -> list[tracing.Object]:
    """Return rods between two circles, turned one way and the other, the circles, and balls at the joints."""
    low = circle(RODS, 0.95, 0.05)
    high = circle(RODS, 0.8, 1.5, 0.5 / RODS)
    starts = np.concatenate([low, low, low, high])
    ends = np.concatenate(
        [
            np.roll(high, -3, axis=0),
            np.roll(high, 4, axis=0),
            np.roll(low, -1, axis=0),
            np.roll(high, -1, axis=0),
        ]
    )
    return [
        tracing.cylinder(starts, ends - starts, 0.045, closed=False),
        tracing.sphere(np.concatenate([low, high]), 0.065),
    ]


def _light(angle: float, size: Any, colour: tuple[float, ...]) -> Any:
    """Return a square light that faces the middle of the basket."""
    centre = np.array([3.2 * np.cos(2 * np.pi * angle), 4.2, 3.2 * np.sin(2 * np.pi * angle)])
    normal = -centre / np.linalg.norm(centre)
    u = np.cross([0.0, 1.0, 0.0], normal)
    u = u / np.linalg.norm(u)
    v = np.cross(normal, u)
    return tracing.rectangle_light(
        centre - 0.5 * size * (u + v), size * u, size * v, np.multiply(46.0, colour) / size**2
    )

"""Scenes with one effect each: a caustic, depth of field, soft shadows, moving vertices."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax import tracing
from qmcjax.core import checks
from qmcjax.core.parameters import numbers, positive, require
from qmcjax.scenes.traced._base import Traced, is_analytic, seen_in_time


def caustic(radius: Any = 0.05, roughness: Any = 0.15, *, bounces: int = 3, light_bounces: int = 1) -> Traced:
    """Return a lamp over a floor: a bulb in a metal ring that reflects its light into a caustic.

    The bulb is off the axis of the ring, with a lid above and a disc below, so most light reaches the floor
    by reflection in the ring. Camera paths rarely enter the lamp, light paths start there: bidirectional path
    tracing connects them. The scene is still.

    Parameters
    ----------
    radius : float, optional
        Radius of the bulb, a sphere; positive. Its power does not depend on the radius.
    roughness : float, optional
        Of the ring, see :func:`qmcjax.tracing.glossy`. None is a mirror: paths cannot be connected there, and
        only camera paths that hit the bulb find its caustics.
    bounces : int, optional
        Reflections of a path, see :func:`qmcjax.tracing.path_tracing`.
    light_bounces : int, optional
        See :func:`qmcjax.tracing.bidirectional`; 0 is path tracing.

    References
    ----------
    .. [1] A. G. M. Ahmed, P. Wonka, "Screen-space blue-noise diffusion of Monte Carlo sampling error via
       hierarchical ordering of pixels", 2020, Fig. 10 (d).

    Examples
    --------
    >>> caustic(bounces=1).needs[-4:]
    ('emit_u', 'emit_v', 'emit_way_u', 'emit_way_v')
    """
    radius = positive("radius", radius)
    metal = (0.95, 0.72, 0.38)
    ring = tracing.mirror(metal) if roughness is None else tracing.glossy(metal, roughness)
    up, dark = [0.0, 1.0, 0.0], tracing.diffuse(0.2)
    objects = [
        tracing.plane([0.0, 0.0, 0.0], up, material=tracing.diffuse((0.7, 0.68, 0.65))),
        tracing.cylinder([0.0, 0.4, 0.0], [0.0, 0.75, 0.0], 0.5, closed=False, material=ring),
        tracing.disc([0.0, 0.75, 0.0], up, 0.5, material=dark),
        tracing.disc([0.25, 0.55, 0.0], up, 0.12, material=dark),
    ]
    bulb = tracing.sphere_light((0.25, 0.62, 0.0), radius, 1.4 / radius**2)
    camera = tracing.camera((0.0, 2.2, 2.9), (-0.1, 0.25, 0.1), fov=40.0, shutter=0.0)
    world = tracing.world(objects, [bulb])
    return Traced("caustic", tracing.bidirectional(world, camera, bounces, light_bounces))


def defocus(aperture: Any = 0.25, focus: Any = 4.0, *, blades: int | None = None) -> Traced:
    """Return a row of balls in front of a thin lens, with small lights far behind the plane of focus.

    Parameters
    ----------
    aperture : float, optional
        The radius of the lens, positive; None is a pinhole, without lens coordinates.
    focus : float, optional
        The distance of the plane of focus, positive, ignored for a pinhole; the middle ball is at 4.
    blades : int, optional
        Number of sides of a polygonal aperture, at least 3; by default the aperture is round.

    References
    ----------
    .. [1] A. G. M. Ahmed, P. Wonka, "Screen-space blue-noise diffusion of Monte Carlo sampling error via
       hierarchical ordering of pixels", 2020, Fig. 10 (b).

    Examples
    --------
    >>> defocus().needs
    ('x', 'y', 'lens_u', 'lens_v', 'light_u', 'light_v')
    """
    focus = positive("focus", focus)
    objects = [*_surroundings(), *_balls(), *_bulbs()]
    lamp = tracing.rectangle_light((-1.2, 3.5, 0.8), (2.4, 0.0, 0.0), (0.0, 0.0, 1.4), (11.0, 10.6, 10.0))
    camera = tracing.camera(
        (0.0, 0.95, 4.0),
        (0.0, 0.62, 0.0),
        fov=34.0,
        shutter=0.0,
        aperture=aperture,
        focus=None if aperture is None else focus,
        blades=blades,
    )
    return Traced("defocus", tracing.direct_light(tracing.world(objects, [lamp]), camera))


def _surroundings() -> list[tracing.Object]:
    squares = tracing.checker((0.5, 0.42, 0.34), (0.22, 0.16, 0.12), scale=2.0)
    return [
        tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse(squares)),
        tracing.plane([0.0, 0.0, -5.6], [0.0, 0.0, 1.0], material=tracing.diffuse((0.25, 0.3, 0.42))),
    ]


def _balls() -> list[tracing.Object]:
    """Return balls on a diagonal into the image, with the middle one in focus."""
    colours = [(0.7, 0.1, 0.08), (0.75, 0.45, 0.08), (0.1, 0.45, 0.25), (0.08, 0.25, 0.6), (0.4, 0.12, 0.5)]
    places = [[-0.75, 0.3, 1.5], [-0.42, 0.3, 0.75], [0.0, 0.3, 0.0], [0.55, 0.3, -0.9], [1.3, 0.3, -2.1]]
    return [
        tracing.sphere(place, 0.3, material=tracing.glossy(0.3, 0.2, colour))
        for place, colour in zip(places, colours, strict=True)
    ]


def _bulbs() -> list[tracing.Object]:
    """Return three garlands of small lights far behind the balls."""
    part = np.arange(9) / 8
    garlands = [
        np.stack([-3.6 + 7.2 * part, height - 1.1 * part * (1 - part), np.full(9, depth)], axis=-1)
        for height, depth in ((2.6, -5.0), (2.0, -4.2), (1.4, -3.4))
    ]
    radiance = ((14.0, 9.0, 3.5), (14.0, 4.5, 3.0), (3.5, 8.0, 14.0))
    return [
        tracing.sphere(centres, 0.06, material=tracing.emitter(colour))
        for centres, colour in zip(garlands, radiance, strict=True)
    ]


RODS = 10
LIGHTS = ((1.0, 0.16, 0.1), (0.12, 1.0, 0.2), (0.15, 0.25, 1.0))


def occluder(size: Any = 0.45) -> Traced:
    """Return a basket of rods lit by three coloured area lights.

    Two families of straight rods on a hyperboloid cast three overlapping soft shadows; the floor is white
    where all lights are visible. The scene is still.

    Parameters
    ----------
    size : float, optional
        Side of the square lights, in [0.001, 2]. Their power does not depend on the size.

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
    lights = [_light(angle, size, colour) for angle, colour in zip((0.07, 0.4, 0.74), LIGHTS, strict=True)]
    camera = tracing.camera((0.0, 4.4, 5.6), (0.0, 0.3, 0.15), fov=38.0, shutter=0.0)
    return Traced("occluder", tracing.direct_light(tracing.world([floor, basket], lights), camera))


def _basket() -> list[tracing.Object]:
    """Return rods between two circles, slanted both ways, the circles, and balls at the joints."""
    low = _circle(RODS, 0.95, 0.05)
    high = _circle(RODS, 0.8, 1.5, 0.5 / RODS)
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


def _circle(count: int, radius: float, height: float, turn: float = 0.0) -> NDArray[np.float64]:
    """Return points of a horizontal circle about the y-axis, shape (count, 3); the first is turned from x."""
    angle = 2 * np.pi * (np.arange(count) / count + turn)
    return np.stack([radius * np.cos(angle), np.full(count, float(height)), radius * np.sin(angle)], axis=-1)


def _light(angle: float, size: Any, colour: tuple[float, ...]) -> Any:
    """Return a square light that faces the centre of the basket."""
    centre = np.array([3.2 * np.cos(2 * np.pi * angle), 4.2, 3.2 * np.sin(2 * np.pi * angle)])
    normal = -centre / np.linalg.norm(centre)
    u = np.cross([0.0, 1.0, 0.0], normal)
    u = u / np.linalg.norm(u)
    v = np.cross(normal, u)
    return tracing.rectangle_light(
        centre - 0.5 * size * (u + v), size * u, size * v, np.multiply(46.0, colour) / size**2
    )


TRIANGLES = ((0.85, 0.2, 0.12), (0.1, 0.32, 0.75), (0.95, 0.68, 0.08), (0.1, 0.55, 0.3))
ABOVE = (0.0, 5.0, 4.0)


def moving_triangles(count: Any = 12, shutter: Any = (0.0, 1.0), *, visibility: str = "sampled") -> Traced:
    """Return triangles that fly and turn over a checkerboard; each vertex moves on a straight line.

    Sizes and positions do not depend on the number of triangles: twice as many overlap twice as often, and
    adding triangles does not change the others. The light is at the camera, so objects hide their shadows.

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
    kinds = len(TRIANGLES)
    objects = [
        tracing.triangles(opened[k::kinds], closed[k::kinds], material=tracing.diffuse(color))
        for k, color in enumerate(TRIANGLES)
        if k < len(opened)
    ]
    board = tracing.checker((0.8, 0.8, 0.78), (0.12, 0.12, 0.14), scale=0.5)
    objects.append(tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse(board)))
    world = tracing.world(objects, [tracing.point_light(ABOVE, (140.0, 140.0, 140.0))])
    camera = tracing.camera(ABOVE, (0.0, 0.4, 0.0), fov=38.0, shutter=shutter)
    return Traced("moving_triangles", seen_in_time(tracing.direct_light(world, camera), analytic))


def _flights(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return vertices when the shutter opens and closes, (count, 3, 3)."""
    rng = np.random.default_rng(2008)
    # One row of random numbers per triangle: more triangles do not change the previous ones.
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
    """Return corners of equilateral triangles, rotated in the plane, then sheared upwards."""
    angle = turn[:, None] + 2 * np.pi * np.arange(3) / 3
    x, z = np.cos(angle), np.sin(angle)
    return np.stack([x, lean[:, :1] * x + lean[:, 1:] * z, z], axis=-1)

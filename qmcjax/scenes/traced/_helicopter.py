"""A helicopter with two rotors on one mast, above a moving pattern."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from qmcjax import tracing
from qmcjax.core.parameters import numbers, require
from qmcjax.scenes.traced._base import Traced, is_analytic, seen_in_time
from qmcjax.scenes.traced._vehicles import Carried, Drift, Spin, hull, loft
from qmcjax.tracing import motion

STATIONS = [
    [-4.2, 0.50, 0.10, 0.08],
    [-3.4, 0.47, 0.15, 0.13],
    [-2.3, 0.36, 0.24, 0.22],
    [-1.5, 0.22, 0.44, 0.38],
    [-0.8, 0.12, 0.60, 0.48],
    [0.2, 0.06, 0.66, 0.52],
    [1.1, 0.00, 0.56, 0.46],
    [1.8, -0.08, 0.40, 0.36],
    [2.4, -0.18, 0.22, 0.22],
]
"""Of the hull: x, y of the centre, half the height, half the width."""

LOWER, UPPER = 1.15, 1.7
"""Heights of the rotors."""

PODS = (
    ([-0.75, 0.55, -0.42], [-0.75, 0.55, 0.42], [-0.65, -0.22, -1.2], [-0.65, -0.22, 1.2]),
    ([1.5, 0, 0], [1.5, 0, 0], [1.2, 0, 0], [1.2, 0, 0]),
    (0.22, 0.22, 0.15, 0.15),
)
MAST = ([0.0, 0.5, 0.0], [0.0, UPPER - 0.4, 0.0], 0.07)
"""Cylinders: base, axis, radius."""

CANOPY = ([[1.05, 0.36, 0.0], [1.65, 0.16, 0.0]], [0.42, 0.36])
HUB = 0.16

ROUTE = [[-0.3, 2.55, 0.05], [-0.1, 2.55, 0.0], [0.15, 2.65, -0.05]]

GREEN, DARK = (0.3, 0.36, 0.2), (0.03, 0.03, 0.035)


FLIGHT, SPIN = 4, 36
"""Linear segments of the flight, and of each turn of a rotor."""

MOST = 100
"""Maximum number of turns replaced by linear segments."""

SIDES = 24
"""Sides of the prisms that replace cylinders if visibility is exact in time."""


def helicopter(shutter: Any = (0.0, 1.0), *, turns: Any = 2.25, visibility: str = "sampled") -> Traced:
    """Return a flying helicopter with two counter-rotating rotors on one mast.

    The ground is still, but the checkerboard on it moves nonlinearly in time. The only illumination is direct
    light from a point light.

    Parameters
    ----------
    shutter : (float, float) or float, optional, see :func:`cornell_box`
    turns : float, optional
        Turns of each rotor between the times 0 and 1; from -100 to 100 with "analytic".
    visibility : str, optional
        "sampled": by a time coordinate; "analytic": exactly, see :func:`qmcjax.tracing.analytic_visibility`.
        All points then move on linear segments, 36 per turn of a rotor, at most 0.02 from the curves, and
        prisms of 24 sides replace cylinders.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.2.2.

    Examples
    --------
    >>> helicopter(0.25).needs[:2]
    ('x', 'y')
    """
    turns = numbers("turns", turns)
    # The nose turns down and to the left, at increasing speed.
    attitude = Spin(np.array([0.0, 0.8, -0.6]), np.array(0.03), np.array(0.008))
    route = motion.nurbs(ROUTE, None, [0, 0, 0, 1, 1, 1], 2)
    flight = motion.affine(attitude, route)
    analytic = is_analytic(visibility)
    if analytic:
        require("turns", turns, lambda t: abs(t) <= MOST, f"at most {MOST} either way")
        objects = _straight_parts(flight, turns)
    else:
        objects = _parts(flight, turns)
    sun = tracing.point_light((-5.0, 32.0, 8.0), np.multiply(4300.0, (1.0, 0.95, 0.85)))
    camera = tracing.camera((5.5, 7.2, 8.6), (-0.3, 2.2, 0.0), fov=42.0, shutter=shutter)
    estimator = tracing.direct_light(tracing.world([*objects, _ground()], [sun]), camera)
    return Traced("helicopter", seen_in_time(estimator, analytic))


def _materials() -> tuple[Any, Any, Any]:
    return tracing.diffuse(GREEN), tracing.glossy(0.5, 0.15, (0.02, 0.03, 0.05)), tracing.diffuse(DARK)


def _parts(flight: motion.Affine, turns: Any) -> list[tracing.Object]:
    green, glass, dark = _materials()
    hub = tracing.sphere([0.0, 0.0, 0.0], HUB)
    return [
        tracing.group(
            [*_hull(), tracing.cylinder(*PODS), tracing.cylinder(*MAST)], motion=flight, material=green
        ),
        tracing.group([tracing.sphere(*CANOPY)], motion=flight, material=glass),
        *(
            tracing.group([_blades(signed), hub], motion=Carried(flight, spin), material=dark)
            for _, signed, spin in _rotors(turns)
        ),
    ]


def _straight_parts(flight: motion.Affine, turns: Any) -> list[tracing.Object]:
    """Return the parts on linear segments: spheres do not rotate, and cylinders become prisms."""
    green, glass, dark = _materials()
    times = np.linspace(0, 1, FLIGHT + 1)
    often = np.linspace(0, 1, max(FLIGHT, math.ceil(SPIN * abs(float(turns)))) + 1)
    rods = np.concatenate([_prism(*rod) for rod in (*zip(*PODS, strict=True), MAST)])
    balls = [
        *((centre, radius, glass) for centre, radius in zip(*CANOPY, strict=True)),
        *(([0.0, height, 0.0], HUB, dark) for height in (LOWER, UPPER)),
    ]
    return [
        tracing.group(
            [*_hull(), tracing.triangles(rods)], motion=motion.straightened(flight, times), material=green
        ),
        *(_ball(flight, times, *ball) for ball in balls),
        *(
            tracing.group(
                [_blades(signed)], motion=motion.straightened(Carried(flight, spin), often), material=dark
            )
            for _, signed, spin in _rotors(turns)
        ),
    ]


def _ball(flight: motion.Affine, times: Any, centre: Any, radius: float, material: Any) -> tracing.Object:
    """Return a sphere that moves along with the flight."""
    matrix, translation = flight(jnp.asarray(times))
    path = np.asarray(matrix, np.float64) @ np.array(centre) + np.asarray(translation, np.float64)
    slide = motion.affine(None, motion.linear_segments(times, path))
    return tracing.sphere([0.0, 0.0, 0.0], radius, motion=slide, material=material)


def _prism(base: Any, axis: Any, radius: float) -> Any:
    """Return the triangles of a prism in a cylinder along x, y or z, shape (4 SIDES, 3, 3)."""
    base, axis = np.asarray(base, np.float64), np.asarray(axis, np.float64)
    along = axis / np.linalg.norm(axis)
    side = np.roll(along, 1)
    angle = 2 * np.pi * np.arange(SIDES)[:, None] / SIDES
    ring = radius * (np.cos(angle) * side + np.sin(angle) * np.cross(along, side))
    return loft(np.stack([base + ring, base + axis + ring]), base, base + axis)


def _rotors(turns: Any) -> list[tuple[float, Any, motion.Affine]]:
    """Return height, signed turns, and the motion on the mast of both rotors."""
    return [
        (
            height,
            signed,
            motion.affine(Spin(np.array([0.0, 1.0, 0.0]), np.array(start), signed), [0.0, height, 0.0]),
        )
        for height, signed, start in ((LOWER, turns, 0.05), (UPPER, -turns, 0.0))
    ]


def _blades(turns: Any) -> tracing.Object:
    """Return four blades, each a rectangle pitched about its length."""
    angle = 2 * np.pi * np.arange(4) / 4
    along = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=-1)
    across = np.stack([np.sin(angle), 0 * angle + 0.12 * np.sign(turns), np.cos(angle)], axis=-1)
    return tracing.rectangle(0.2 * along - 0.31 * across, 3.1 * along, 0.62 * across)


def _hull() -> list[tracing.Object]:
    skin = loft(hull(STATIONS, 10, 0.8), [-4.3, 0.5, 0.0], [2.6, -0.24, 0.0])
    fins = [
        ([-4.0, 0.5, -1.0], [0.55, 0, 0], [0, 0, 2.0]),
        ([-4.15, 0.2, -1.0], [0.55, 0, 0], [-0.12, 0.85, 0]),
        ([-4.15, 0.2, 1.0], [0.55, 0, 0], [-0.12, 0.85, 0]),
        ([-4.25, 0.5, 0.0], [0.8, 0, 0], [-0.4, 1.0, 0]),
        ([-0.5, -0.1, -1.45], [0.75, 0, 0], [0, 0, 2.9]),
    ]
    return [tracing.triangles(skin), tracing.rectangle(*zip(*fins, strict=True))]


def _ground() -> tracing.Object:
    drift = motion.nurbs([[0, 0], [0.1, 0], [0.9, 0.0], [0.6, 0.5]], None, [0, 0, 0, 0, 1, 1, 1, 1], 3)
    pattern = tracing.checker((0.8, 0.76, 0.66), (0.24, 0.3, 0.42), scale=1.0, motion=Drift(drift))
    return tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse(pattern))

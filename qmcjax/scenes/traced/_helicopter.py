"""A helicopter with two rotors on one mast, above a pattern that moves."""

from typing import Any

import numpy as np

from qmcjax import tracing
from qmcjax.core.parameters import numbers
from qmcjax.scenes.traced._base import Traced
from qmcjax.scenes.traced._models import hull, loft
from qmcjax.scenes.traced._motions import Carried, Drift, Spin
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


def helicopter(shutter: Any = (0.0, 1.0), *, turns: Any = 2.25) -> Traced:
    """Return a flying helicopter whose two rotors turn about one mast, in opposite directions.

    The ground is still, but the checkerboard on it moves, not linearly in time. Only the direct light of a
    point light counts.

    Parameters
    ----------
    shutter : (float, float) or float, optional
        When it opens and closes, in [0, 1], or the time of a still picture, which needs no coordinate for
        time.
    turns : float, optional
        Of each rotor between the times 0 and 1.

    Returns
    -------
    Traced

    Raises
    ------
    TypeError
        If an argument has another type.
    ValueError
        If ``turns`` is not finite, or ``shutter`` out of range.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.2.2.

    Examples
    --------
    >>> helicopter(0.25).needs[:2]
    ('x', 'y')
    """
    turns = numbers("turns", turns)
    flight = motion.affine(_attitude(), _route())
    dark = tracing.diffuse((0.03, 0.03, 0.035))
    objects = [
        tracing.group(_hull(), motion=flight, material=tracing.diffuse((0.3, 0.36, 0.2))),
        tracing.group(_canopy(), motion=flight, material=tracing.glossy(0.5, 0.15, (0.02, 0.03, 0.05))),
        _rotor(flight, LOWER, turns, 0.05, dark),
        _rotor(flight, UPPER, -turns, 0.0, dark),
        _ground(),
    ]
    sun = tracing.point_light((-5.0, 32.0, 8.0), np.multiply(4300.0, (1.0, 0.95, 0.85)))
    camera = tracing.camera((5.5, 7.2, 8.6), (-0.3, 2.2, 0.0), fov=42.0, shutter=shutter)
    return Traced("helicopter", tracing.direct_light(tracing.world(objects, [sun]), camera))


def _attitude() -> Spin:
    """Return the rotations: the nose is down and to the left, more and more so."""
    return Spin(np.array([0.0, 0.8, -0.6]), np.array(0.03), np.array(0.008))


def _route() -> motion.Nurbs:
    control = [[-0.3, 2.55, 0.05], [-0.1, 2.55, 0.0], [0.15, 2.65, -0.05]]
    return motion.nurbs(control, None, [0, 0, 0, 1, 1, 1], 2)


def _hull() -> list[tracing.Object]:
    skin = loft(hull(STATIONS, 10, 0.8), [-4.3, 0.5, 0.0], [2.6, -0.24, 0.0])
    corners = [
        [-4.0, 0.5, -1.0],
        [-4.15, 0.2, -1.0],
        [-4.15, 0.2, 1.0],
        [-4.25, 0.5, 0.0],
        [-0.5, -0.1, -1.45],
    ]
    edges_u = [[0.55, 0, 0], [0.55, 0, 0], [0.55, 0, 0], [0.8, 0, 0], [0.75, 0, 0]]
    edges_v = [[0, 0, 2.0], [-0.12, 0.85, 0], [-0.12, 0.85, 0], [-0.4, 1.0, 0], [0, 0, 2.9]]
    pods = [[-0.75, 0.55, -0.42], [-0.75, 0.55, 0.42], [-0.65, -0.22, -1.2], [-0.65, -0.22, 1.2]]
    lengths = [[1.5, 0, 0], [1.5, 0, 0], [1.2, 0, 0], [1.2, 0, 0]]
    return [
        tracing.triangles(skin),
        tracing.rectangle(corners, edges_u, edges_v),
        tracing.cylinder(pods, lengths, [0.22, 0.22, 0.15, 0.15]),
        tracing.cylinder([0.0, 0.5, 0.0], [0.0, UPPER - 0.4, 0.0], 0.07),
    ]


def _canopy() -> list[tracing.Object]:
    return [tracing.sphere([[1.05, 0.36, 0.0], [1.65, 0.16, 0.0]], [0.42, 0.36])]


def _rotor(flight: Any, height: float, turns: Any, start: float, material: Any) -> tracing.Object:
    """Return four blades, each a rectangle that is pitched about its length."""
    angle = 2 * np.pi * np.arange(4) / 4
    along = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=-1)
    across = np.stack([np.sin(angle), 0 * angle + 0.12 * np.sign(turns), np.cos(angle)], axis=-1)
    blades = tracing.rectangle(0.2 * along - 0.31 * across, 3.1 * along, 0.62 * across)
    spin = motion.affine(Spin(np.array([0.0, 1.0, 0.0]), np.array(start), turns), [0.0, height, 0.0])
    hub = tracing.sphere([0.0, 0.0, 0.0], 0.16)
    return tracing.group([blades, hub], motion=Carried(flight, spin), material=material)


def _ground() -> tracing.Object:
    drift = motion.nurbs([[0, 0], [0.1, 0], [0.9, 0.0], [0.6, 0.5]], None, [0, 0, 0, 0, 1, 1, 1, 1], 3)
    pattern = tracing.checker((0.8, 0.76, 0.66), (0.24, 0.3, 0.42), scale=1.0, motion=Drift(drift))
    return tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse(pattern))

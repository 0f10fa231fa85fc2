"""Small bright objects in front of and behind the plane of focus."""

from typing import Any

import numpy as np

from qmcjax import tracing
from qmcjax.core.parameters import positive
from qmcjax.scenes.traced._base import Traced


def defocus(aperture: Any = 0.25, focus: Any = 4.0, *, blades: int | None = None) -> Traced:
    """Return a row of balls before a thin lens, with small lights far behind the plane of focus.

    Parameters
    ----------
    aperture : float, optional
        The radius of the lens, positive; None is a pinhole, without lens coordinates.
    focus : float, optional
        The distance of the plane of focus, positive, ignored for a pinhole; the ball in the middle is at 4.
    blades : int, optional
        Number of sides of a regular polygon as the aperture, at least 3; round by default.

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
    """Return balls on a diagonal into the depth, with the middle one in focus."""
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

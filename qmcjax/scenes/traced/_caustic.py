"""Light that the metal shade of a lamp reflects to the floor."""

from typing import Any

from qmcjax import tracing
from qmcjax.core.parameters import positive
from qmcjax.scenes.traced._base import Traced


def caustic(radius: Any = 0.05, roughness: Any = 0.15, *, bounces: int = 3, light_bounces: int = 1) -> Traced:
    """Return a lamp over a floor: a bulb in a metal ring that reflects its light into a caustic.

    The bulb is off the axis of the ring, with a lid above and a disc below, so most light on the floor is
    reflected by the ring. Camera paths hardly find the inside of the lamp, light paths always do: they are
    connected. The scene is still.

    Parameters
    ----------
    radius : float, optional
        Radius of the bulb, a sphere. Its power is the same for all radii. Positive.
    roughness : float, optional
        Of the ring, see :func:`qmcjax.tracing.glossy`. None is a mirror: paths are not connected there,
        and its caustics are found by camera paths that hit the bulb.
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

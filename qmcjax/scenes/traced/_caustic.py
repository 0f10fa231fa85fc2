"""Light that a ring of metal focuses on the floor."""

from typing import Any

from qmcjax import tracing
from qmcjax.scenes.traced._base import Traced, positive


def caustic(radius: Any = 0.8, roughness: Any = None, *, bounces: int = 3) -> Traced:
    """Return a ring on a floor, whose inside reflects the light of a sphere into a caustic.

    The caustic of a circle is a nephroid, the curve of light in a cup. Paths begin at the camera: they find
    the light when their reflection in the ring hits it. The scene is still.

    Parameters
    ----------
    radius : float, optional
        Of the light. Its power is the same for all; the smaller it is, the sharper and noisier the caustic.
    roughness : float, optional
        Of the ring, as :func:`qmcjax.tracing.glossy` takes it; by default the ring is a mirror.
    bounces : int, optional
        Reflections of a path, as :func:`qmcjax.tracing.path_tracing` takes them.

    Returns
    -------
    Traced

    Raises
    ------
    TypeError
        If an argument has another type.
    ValueError
        If ``radius`` is not positive, or another argument out of range.

    References
    ----------
    .. [1] A. G. M. Ahmed, P. Wonka, "Screen-space blue-noise diffusion of Monte Carlo sampling error via
       hierarchical ordering of pixels", 2020, Fig. 10 (d).

    Examples
    --------
    >>> caustic(bounces=1).needs[:4]
    ('x', 'y', 'light_u', 'light_v')
    """
    radius = positive("radius", radius)
    metal = (0.95, 0.72, 0.38)
    ring = tracing.mirror(metal) if roughness is None else tracing.glossy(metal, roughness)
    objects = [
        tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse((0.7, 0.68, 0.65))),
        tracing.cylinder([0.0, 0.0, 0.0], [0.0, 0.5, 0.0], 1.0, closed=False, material=ring),
    ]
    light = tracing.sphere_light((-4.2, 3.0, -1.6), radius, 21.0 / radius**2)
    camera = tracing.camera((0.3, 4.0, 3.4), (0.05, 0.1, 0.0), fov=36.0, shutter=0.0)
    return Traced("caustic", tracing.path_tracing(tracing.world(objects, [light]), camera, bounces))

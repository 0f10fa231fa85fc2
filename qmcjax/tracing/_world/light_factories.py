"""Lights from checked numbers."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import numbers
from qmcjax.tracing._world import factories
from qmcjax.tracing._world.lights import Environment, PointLight, RectangleLight, SphereLight
from qmcjax.tracing._world.textures import color


def point_light(position: ArrayLike, intensity: ArrayLike) -> PointLight:
    """Make a light that is a point.

    Parameters
    ----------
    position : float ArrayLike, shape (3,)
    intensity : float ArrayLike, shape () or (3,)
        Radiant intensity, not negative: at distance d a surface across gets intensity / d^2.

    Returns
    -------
    PointLight
    """
    return PointLight(numbers("position", position, (3,)), _radiance("intensity", intensity))


def sphere_light(center: ArrayLike, radius: ArrayLike, radiance: ArrayLike) -> SphereLight:
    """Make a sphere that shines outwards, and reflects nothing.

    Points of it are sampled evenly in the cone of directions in which it is seen. Seen from inside it is
    black; a sphere with an :func:`emitter` as its material shines to both sides.

    Parameters
    ----------
    center : float ArrayLike, shape (3,)
    radius : float
        Positive.
    radiance : float ArrayLike, shape () or (3,)
        The same in all directions, not negative.

    Returns
    -------
    SphereLight
    """
    center, radius = numbers("center", center, (3,)), numbers("radius", radius)
    factories.sphere(center, radius)
    return SphereLight(center, radius, _radiance("radiance", radiance))


def rectangle_light(
    corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, radiance: ArrayLike
) -> RectangleLight:
    """Make a rectangle, or parallelogram, that shines from one side, and reflects nothing.

    Points of it are sampled evenly by area.

    Parameters
    ----------
    corner, edge_u, edge_v : float ArrayLike, shape (3,)
        A corner, and the edges from there. It shines to the side of ``edge_u`` x ``edge_v``.
    radiance : float ArrayLike, shape () or (3,)
        The same in all directions of that side, not negative.

    Returns
    -------
    RectangleLight
    """
    corner, edge_u, edge_v = (
        numbers(name, value, (3,))
        for name, value in (("corner", corner), ("edge_u", edge_u), ("edge_v", edge_v))
    )
    factories.rectangle(corner, edge_u, edge_v)
    return RectangleLight(corner, edge_u, edge_v, _radiance("radiance", radiance))


def environment(radiance: ArrayLike) -> Environment:
    """Make light that comes from infinity, the same from everywhere.

    Directions of it are sampled in proportion to the cosine at the surface.

    Parameters
    ----------
    radiance : float ArrayLike, shape () or (3,)
        Not negative.

    Returns
    -------
    Environment
    """
    return Environment(_radiance("radiance", radiance))


def _radiance(name: str, value: Any) -> Any:
    if callable(value):
        raise TypeError(f"{name} must be a colour, got {checks.shown(value)}")
    return color(name, value)

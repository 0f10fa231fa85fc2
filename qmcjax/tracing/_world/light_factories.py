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
    """Make a point light.

    Parameters
    ----------
    position : float ArrayLike, shape (3,)
    intensity : float ArrayLike, shape () or (3,)
        Radiant intensity, not negative: a surface at distance d facing the light gets irradiance intensity /
        d^2.
    """
    return PointLight(numbers("position", position, (3,)), _radiance("intensity", intensity))


def sphere_light(center: ArrayLike, radius: ArrayLike, radiance: ArrayLike) -> SphereLight:
    """Make a spherical light that emits outward and reflects nothing.

    Points on it are sampled uniformly in its cone of directions. It is black from inside; a sphere with an
    :func:`emitter` as its material emits to both sides.

    Parameters
    ----------
    center : float ArrayLike, shape (3,)
    radius : float
        Positive.
    radiance : float ArrayLike, shape () or (3,)
        Not negative; the same in all directions.
    """
    center, radius = numbers("center", center, (3,)), numbers("radius", radius)
    factories.sphere(center, radius)
    return SphereLight(center, radius, _radiance("radiance", radiance))


def rectangle_light(
    corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, radiance: ArrayLike
) -> RectangleLight:
    """Make a rectangular light, or parallelogram, that emits from one side and reflects nothing.

    Points on it are sampled uniformly by area.

    Parameters
    ----------
    corner, edge_u, edge_v : float ArrayLike, shape (3,)
        A corner, and the edges from it. It emits to the side of ``edge_u`` x ``edge_v``.
    radiance : float ArrayLike, shape () or (3,)
        Not negative; the same in all directions of that side.
    """
    corner, edge_u, edge_v = (
        numbers(name, value, (3,))
        for name, value in (("corner", corner), ("edge_u", edge_u), ("edge_v", edge_v))
    )
    factories.rectangle(corner, edge_u, edge_v)
    return RectangleLight(corner, edge_u, edge_v, _radiance("radiance", radiance))


def environment(radiance: ArrayLike) -> Environment:
    """Make a constant environment light at infinity.

    Directions are sampled in proportion to the cosine at the surface.

    Parameters
    ----------
    radiance : float ArrayLike, shape () or (3,)
        Not negative.
    """
    return Environment(_radiance("radiance", radiance))


def _radiance(name: str, value: Any) -> Any:
    if callable(value):
        raise TypeError(f"{name} must be a colour, got {checks.shown(value)}")
    return color(name, value)

"""Lights: emission, sampling of points on them, and densities."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.maps import cone
from qmcjax.core.parameters import numbers
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.object import Object, row
from qmcjax.tracing._shapes.primitives import Rectangle, Sphere
from qmcjax.tracing._shapes.vectors import (
    Vector,
    along,
    around,
    cross,
    dot,
    each,
    hemisphere,
    length,
    minus,
    plus,
    scaled,
    times,
    unit,
)
from qmcjax.tracing._world import factories
from qmcjax.tracing._world.materials import validate_color


class Sample(NamedTuple):
    """Samples of light that may reach points, components of shape (n,)."""

    direction: Vector
    """Incoming direction: unit vectors towards the light."""
    distance: Array
    """Inf for environments."""
    arriving: Vector
    """Radiance over density; for point lights the irradiance of a surface that faces them."""
    density: Array
    """Per solid angle; inf for point lights."""
    slope: Array
    """The cosine at the light, which determines the error of the distance; 1 if that is exact."""


class Start(NamedTuple):
    """Emitted rays, components of shape (n,)."""

    point: Vector
    direction: Vector
    """Unit vectors."""
    radiance: Vector
    """Intensity for point lights."""


class Light(ABC):
    """Lights of one kind: arrays with the light as first axis."""

    radiance: Any
    coordinates: ClassVar[int] = 2
    """Number of coordinates that choose a point on the light."""
    smooth: ClassVar[tuple[str, ...]] = ("radiance",)

    def object(self) -> Object | None:
        """Return the object that rays hit."""
        return None

    @abstractmethod
    def sample(self, number: Array, point: Vector, normal: Vector, u: Any, v: Any) -> Sample:
        """Return a sample of one light for each point."""

    def density(self, number: Array, point: Vector, normal: Vector, incoming: Vector, hit: Vector) -> Array:
        """Return the density of directions that hit the light; 0 for lights without extent."""
        return jnp.zeros_like(point[0])

    def emitted(self, number: Array) -> Vector:
        """Return the radiance of points that rays hit, on the side of the normal."""
        return row(self.radiance, number)


class Source(Light):
    """A light with a position, where paths may start."""

    @abstractmethod
    def start(self, number: Array, u: Any, v: Any, way_u: Any, way_v: Any) -> Start:
        """Return points on one light per row, and directions, uniform in area times projected angle."""

    @abstractmethod
    def extent(self) -> Array:
        """Return area times projected solid angle; for point lights the solid angle."""


@frozen_pytree
class PointLight(Source):
    """See :func:`point_light`."""

    position: Any
    intensity: Any
    coordinates: ClassVar[int] = 0
    smooth: ClassVar[tuple[str, ...]] = ("intensity",)

    def sample(self, number: Array, point: Vector, normal: Vector, u: Any, v: Any) -> Sample:
        direction = minus(row(self.position, number), point)
        squared = dot(direction, direction)
        # A light at the point itself contributes nothing.
        inverse = jnp.where(squared > 0, 1 / jnp.where(squared > 0, squared, 1), 0)
        one = jnp.ones_like(squared)
        intensity = row(self.intensity, number)
        return Sample(unit(direction), jnp.sqrt(squared), times(inverse, intensity), one * np.inf, one)

    def emitted(self, number: Array) -> Vector:
        return each(jnp.zeros_like, row(self.intensity, number))

    def start(self, number: Array, u: Any, v: Any, way_u: Any, way_v: Any) -> Start:
        direction = cone(way_u, way_v, 2)
        return Start(row(self.position, number), unit(direction), row(self.intensity, number))

    def extent(self) -> Array:
        return jnp.full(self.position.shape[:-1], 4 * np.pi, self.position.dtype)


@frozen_pytree
class RectangleLight(Source):
    """See :func:`rectangle_light`."""

    corner: Any
    edge_u: Any
    edge_v: Any
    radiance: Any

    def object(self) -> Object:
        corner, edge_u, edge_v = (part[None] for part in (self.corner, self.edge_u, self.edge_v))
        return Object((Rectangle(corner, edge_u, edge_v),), None, None)

    def _across(self, number: Any) -> tuple[Vector, Array]:
        """Return unnormalized normals, and areas."""
        scale, (edge_u, edge_v) = scaled(row(self.edge_u, number), row(self.edge_v, number))
        across = cross(edge_u, edge_v)
        return across, length(across) / (scale * scale)

    def sample(self, number: Array, point: Vector, normal: Vector, u: Any, v: Any) -> Sample:
        edge_u, edge_v = row(self.edge_u, number), row(self.edge_v, number)
        place = plus(row(self.corner, number), plus(times(u, edge_u), times(v, edge_v)))
        across, area = self._across(number)
        direction = minus(place, point)
        squared = dot(direction, direction)
        squared = jnp.where(squared > 0, squared, jnp.inf)
        cosine = jnp.maximum(-dot(unit(direction), across) / length(across), 0)
        seen = cosine > 0
        factor = jnp.where(seen, cosine * area / squared, 0)
        density = jnp.where(seen, squared / (jnp.where(seen, cosine, 1) * area), 0)
        return Sample(
            unit(direction), length(direction), times(factor, row(self.radiance, number)), density, cosine
        )

    def density(self, number: Array, point: Vector, normal: Vector, incoming: Vector, hit: Vector) -> Array:
        across = cross(row(self.edge_u, number), row(self.edge_v, number))
        cosine = -dot(incoming, across)
        between = minus(hit, point)
        seen = cosine > 0
        return jnp.where(seen, dot(between, between) / jnp.where(seen, cosine, 1), 0)

    def start(self, number: Array, u: Any, v: Any, way_u: Any, way_v: Any) -> Start:
        edge_u, edge_v = row(self.edge_u, number), row(self.edge_v, number)
        point = plus(row(self.corner, number), plus(times(u, edge_u), times(v, edge_v)))
        local, _ = hemisphere(way_u, way_v)
        direction = around(local, unit(self._across(number)[0]))
        return Start(point, unit(direction), row(self.radiance, number))

    def extent(self) -> Array:
        return np.pi * self._across(...)[1]


@frozen_pytree
class SphereLight(Source):
    """See :func:`sphere_light`."""

    center: Any
    radius: Any
    radiance: Any

    def object(self) -> Object:
        return Object((Sphere(self.center[None], self.radius[None]),), None, None)

    def _cone(self, number: Array, point: Vector) -> tuple[Vector, Array, Array, Array]:
        """Return vectors to the centres, squared distances, and cones as one minus cosine; 0 from inside."""
        between = minus(row(self.center, number), point)
        squared = dot(between, between)
        sine = self.radius[number] * self.radius[number] / jnp.where(squared > 0, squared, 1)
        outside = sine < 1
        sine = jnp.where(outside, sine, 0.5)
        return between, squared, jnp.where(outside, sine / (1 + jnp.sqrt(1 - sine)), 0), outside

    def sample(self, number: Array, point: Vector, normal: Vector, u: Any, v: Any) -> Sample:
        between, squared, lost, outside = self._cone(number, point)
        axis = unit(between)
        local = cone(u, v, lost)
        direction = unit(around(local, axis))
        # Squared distance of the ray from the centre; then the first of its two crossings.
        aside = squared * (local[0] * local[0] + local[1] * local[1])
        chord = self.radius[number] * self.radius[number] - aside
        chord = jnp.sqrt(jnp.maximum(chord, jnp.finfo(chord.dtype).tiny))
        distance = jnp.sqrt(squared) * local[2] - chord
        angle = 2 * np.pi * lost
        arriving = times(jnp.where(outside, angle, 0), row(self.radiance, number))
        density = jnp.where(outside, 1 / jnp.where(outside, angle, 1), 0)
        return Sample(direction, distance, arriving, density, chord / self.radius[number])

    def density(self, number: Array, point: Vector, normal: Vector, incoming: Vector, hit: Vector) -> Array:
        _, _, lost, outside = self._cone(number, point)
        return jnp.where(outside, 1 / (2 * np.pi * jnp.where(outside, lost, 1)), 0)

    def start(self, number: Array, u: Any, v: Any, way_u: Any, way_v: Any) -> Start:
        normal = unit(cone(u, v, 2))
        local, _ = hemisphere(way_u, way_v)
        point = along(row(self.center, number), self.radius[number], normal)
        return Start(point, unit(around(local, normal)), row(self.radiance, number))

    def extent(self) -> Array:
        return 4 * np.pi**2 * self.radius * self.radius


@frozen_pytree
class Environment(Light):
    """See :func:`environment`."""

    radiance: Any

    def sample(self, number: Array, point: Vector, normal: Vector, u: Any, v: Any) -> Sample:
        local, cosine = hemisphere(u, v)
        direction = unit(around(local, normal))
        one = jnp.ones_like(cosine)
        arriving = times(np.pi / cosine, row(self.radiance, number))
        return Sample(direction, one * np.inf, arriving, cosine / np.pi, one)

    def density(self, number: Array, point: Vector, normal: Vector, incoming: Vector, hit: Vector) -> Array:
        return jnp.maximum(dot(normal, incoming), 0) / np.pi


def as_light(name: str, value: Any) -> Light:
    """Return a light, or raise a TypeError that names the argument."""
    if not isinstance(value, Light):
        raise TypeError(f"{name} must be lights (point_light, ...), got {checks.shown(value)}")
    return value


def point_light(position: ArrayLike, intensity: ArrayLike) -> PointLight:
    """Make a point light.

    Parameters
    ----------
    position : float ArrayLike, shape (3,)
    intensity : float ArrayLike, shape () or (3,)
        Radiant intensity, not negative: a surface at distance d facing the light receives irradiance
        intensity / d^2.
    """
    return PointLight(numbers("position", position, (3,)), _radiance("intensity", intensity))


def sphere_light(center: ArrayLike, radius: ArrayLike, radiance: ArrayLike) -> SphereLight:
    """Make a spherical light that emits outward and does not reflect.

    It is sampled uniformly over its cone of directions. It is black from inside; a sphere with an
    :func:`emitter` as material emits to both sides.

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
    """Make a rectangular light, or parallelogram, that emits from one side and does not reflect.

    It is sampled uniformly by area.

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
    return validate_color(name, value)

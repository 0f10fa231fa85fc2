"""Round shapes: spheres and the sides of cylinders."""

from typing import Any

import jax.numpy as jnp
from jax import Array

from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.shape_batches import Rays, Shape, ahead, first, roots, rounding, row
from qmcjax.tracing._shapes.vectors import (
    Vector,
    along,
    dot,
    largest,
    length,
    minus,
    tangents,
    times,
    turn,
    unit,
)


@frozen_pytree
class Sphere(Shape):
    """Spheres. The pole of their coordinates is z; v runs from the south to the north pole."""

    center: Any
    """(n, 3)."""
    radius: Any
    """(n,)."""

    def distance(self, number: Any, prepared: Rays) -> Array:
        center, radius = row(self.center, number), self.radius[number]
        slack = prepared.slack + rounding(largest(center) + radius)
        start = minus(prepared.origin, center)
        near, far = _crossings(start, prepared.direction, prepared.squared, radius, slack)
        return first(near, far, prepared, slack)

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        from_center = minus(point, row(self.center, number))
        return _round(from_center, self.radius[number])

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        x, y, z = times(1 / self.radius[number], minus(point, row(self.center, number)))
        return turn(x, y), turn(-z, jnp.sqrt(jnp.maximum(x * x + y * y, jnp.finfo(z.dtype).tiny))) * 2

    def bounds(self, time: float) -> tuple[Array, Array]:
        return self.center - self.radius[:, None], self.center + self.radius[:, None]


@frozen_pytree
class Cylinder(Shape):
    """Sides of cylinders, open at both ends. v runs along the axis."""

    base: Any
    """(n, 3): the centre of one end."""
    axis: Any
    """(n, 3): from the base to the centre of the other end."""
    radius: Any
    """(n,)."""

    def distance(self, number: Any, prepared: Rays) -> Array:
        base, axis, radius = row(self.base, number), row(self.axis, number), self.radius[number]
        tall, up = length(axis), unit(axis)
        slack = prepared.slack + rounding(largest(base) + radius + tall)
        start = minus(prepared.origin, base)
        height, climb = dot(start, up), dot(prepared.direction, up)
        across = along(prepared.direction, -climb, up)
        squared = dot(across, across)
        crossings = _crossings(along(start, -height, up), across, squared, radius, slack)
        hits = []
        for distance in crossings:
            at = height + distance * climb
            # Enlarged by rounding, so that rays do not slip between the side and a disc at its end.
            there = (at >= -slack) & (at <= tall + slack) & (squared > 0)
            hits.append(jnp.where(there & ahead(distance, prepared, slack), distance, jnp.inf))
        return jnp.minimum(*hits)

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        start, up = minus(point, row(self.base, number)), unit(row(self.axis, number))
        return _round(along(start, -dot(start, up), up), self.radius[number])

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        start, axis = minus(point, row(self.base, number)), row(self.axis, number)
        one, other = tangents(unit(axis))
        return turn(dot(start, one), dot(start, other)), jnp.clip(dot(start, axis) / dot(axis, axis), 0, 1)

    def bounds(self, time: float) -> tuple[Array, Array]:
        tall = jnp.sum(self.axis * self.axis, axis=1, keepdims=True)
        reach = self.radius[:, None] * jnp.sqrt(jnp.maximum(1 - self.axis * self.axis / tall, 0))
        ends = self.base, self.base + self.axis
        return jnp.minimum(*ends) - reach, jnp.maximum(*ends) + reach


def _crossings(
    start: Vector, direction: Vector, squared: Any, radius: Any, slack: Any
) -> tuple[Array, Array]:
    """Return where lines cross a sphere, or circle, around 0; NaN if they do not."""
    b, c = dot(start, direction), dot(start, start) - radius * radius
    foot = along(start, -b / jnp.where(squared > 0, squared, 1), direction)
    on = abs(c) <= slack * (2 * radius + slack)
    return roots(b, c, squared, radius * radius - dot(foot, foot), on)


def _round(outwards: Vector, radius: Any) -> tuple[Array, Vector]:
    return 0.5 * (dot(outwards, outwards) - radius * radius), outwards

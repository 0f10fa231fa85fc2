"""Shapes with closed forms: planes, rectangles, discs, boxes, spheres and the sides of cylinders."""

from typing import Any

import jax.numpy as jnp
from jax import Array

from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.object import Rays, Shape, ahead, first, plane, roots, rounding, row
from qmcjax.tracing._shapes.vectors import (
    Vector,
    along,
    components,
    cross,
    dot,
    duals,
    each,
    largest,
    length,
    minus,
    scaled,
    shares,
    stacked,
    tangents,
    times,
    turn,
    unit,
)


@frozen_pytree
class Plane(Shape):
    """Infinite planes. u and v are lengths along two orthogonal directions from the point."""

    point: Any
    """(n, 3)."""
    axis: Any
    """(n, 3): of any length."""

    def distance(self, number: Any, prepared: Rays) -> Array:
        point = row(self.point, number)
        slack = prepared.slack + rounding(largest(point))
        return plane(point, _axis(self.axis[number]), prepared, slack)

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        return _height(point, row(self.point, number), _axis(self.axis[number]))

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        start, (one, other) = minus(point, row(self.point, number)), tangents(unit(_axis(self.axis[number])))
        return dot(start, one), dot(start, other)

    def bounds(self, time: float) -> tuple[Array, Array]:
        return jnp.full_like(self.point, -jnp.inf), jnp.full_like(self.point, jnp.inf)


@frozen_pytree
class Rectangle(Shape):
    """Rectangles, or parallelograms, with normals along ``edge_u`` x ``edge_v``."""

    corner: Any
    """(n, 3)."""
    edge_u: Any
    """(n, 3): from the corner to the next one, where u = 1."""
    edge_v: Any
    """(n, 3)."""

    def _scaled(self, number: Any) -> tuple[Vector, Vector, Array, Vector, Vector]:
        """Return corners, normals, powers of two, and edges times these."""
        scale, (u, v) = scaled(row(self.edge_u, number), row(self.edge_v, number))
        return row(self.corner, number), cross(u, v), scale, u, v

    def distance(self, number: Any, prepared: Rays) -> Array:
        corner, normal, scale, u, v = self._scaled(number)
        size = length(row(self.edge_u, number)) + length(row(self.edge_v, number))
        slack = prepared.slack + rounding(largest(corner) + size)
        distance = plane(corner, normal, prepared, slack)
        start = times(scale, minus(along(prepared.origin, distance, prepared.direction), corner))
        inside = True
        for part, dual in zip(shares(start, u, v), duals(u, v), strict=True):
            # Enlarged by rounding: rays do not slip between rectangles that share an edge.
            wider = scale * slack * length(dual)
            inside &= (part >= -wider) & (part <= 1 + wider)
        return jnp.where(inside, distance, jnp.inf)

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        corner, normal, *_ = self._scaled(number)
        return _height(point, corner, normal)

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        corner, _, scale, u, v = self._scaled(number)
        one, other = shares(times(scale, minus(point, corner)), u, v)
        return jnp.clip(one, 0, 1), jnp.clip(other, 0, 1)

    def bounds(self, time: float) -> tuple[Array, Array]:
        ends = (jnp.minimum(edge, 0) for edge in (self.edge_u, self.edge_v))
        others = (jnp.maximum(edge, 0) for edge in (self.edge_u, self.edge_v))
        return self.corner + sum(ends), self.corner + sum(others)


@frozen_pytree
class Disc(Shape):
    """Discs. u is the angle in turns, v the distance from the centre."""

    center: Any
    """(n, 3)."""
    axis: Any
    """(n, 3): of any length."""
    radius: Any
    """(n,)."""

    def distance(self, number: Any, prepared: Rays) -> Array:
        center, radius = row(self.center, number), self.radius[number]
        slack = prepared.slack + rounding(largest(center) + radius)
        distance = plane(center, _axis(self.axis[number]), prepared, slack)
        start = minus(along(prepared.origin, distance, prepared.direction), center)
        return jnp.where(dot(start, start) <= (radius + slack) * (radius + slack), distance, jnp.inf)

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        return _height(point, row(self.center, number), _axis(self.axis[number]))

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        start = times(1 / self.radius[number], minus(point, row(self.center, number)))
        x, y = (dot(start, tangent) for tangent in tangents(unit(_axis(self.axis[number]))))
        tiny = jnp.finfo(x.dtype).tiny
        return turn(x, y), jnp.minimum(jnp.sqrt(jnp.maximum(x * x + y * y, tiny)), 1)

    def bounds(self, time: float) -> tuple[Array, Array]:
        axis = stacked(_axis(self.axis))
        squared = jnp.sum(axis * axis, axis=1, keepdims=True)
        across = jnp.sqrt(jnp.maximum(1 - axis * axis / squared, 0))
        return self.center - self.radius[:, None] * across, self.center + self.radius[:, None] * across


@frozen_pytree
class Box(Shape):
    """Boxes with faces along the axes of coordinates. u and v run along the two axes after the face's."""

    low: Any
    """(n, 3)."""
    high: Any
    """(n, 3)."""

    def prepare(self, rays: Rays) -> tuple[Rays, Vector]:
        # Not -inf for -0: see _lower.
        return rays, each(lambda d: jnp.where(d == 0, jnp.inf, 1 / d), rays.direction)

    def distance(self, number: Any, prepared: tuple[Rays, Vector]) -> Array:
        rays, inverse = prepared
        low, high = row(self.low, number), row(self.high, number)
        slack = rays.slack + rounding(largest(low) + largest(high))

        def seen(corner: Vector) -> Vector:
            return each(lambda a: jnp.where(abs(a) <= slack, 0, a), minus(corner, rays.origin))

        one, other = (each(jnp.multiply, seen(corner), inverse) for corner in (low, high))
        near, far = each(_lower, one, other), each(_higher, other, one)
        enter = _higher(_higher(near[0], near[1]), near[2])
        leave = _lower(_lower(far[0], far[1]), far[2])
        return jnp.where(enter <= leave, first(enter, leave, rays, slack), jnp.inf)

    def _face(self, number: Any, point: Vector) -> tuple[Vector, Vector, Vector]:
        """Return how far points are outside the faces of their half, the nearest face, and its side."""
        low, high = row(self.low, number), row(self.high, number)
        above = each(lambda p, a, b: 2 * p >= a + b, point, low, high)
        out = each(lambda up, p, a, b: jnp.where(up, p - b, a - p), above, point, low, high)
        x = (out[0] >= out[1]) & (out[0] >= out[2])
        y = ~x & (out[1] >= out[2])
        side = each(lambda up, o: jnp.where(up, 1, -1).astype(o.dtype), above, out)
        return out, (x, y, ~x & ~y), side

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        out, face, side = self._face(number, point)
        value = jnp.where(face[0], out[0], jnp.where(face[1], out[1], out[2]))
        return value, each(lambda there, s: jnp.where(there, s, 0), face, side)

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        low, high = row(self.low, number), row(self.high, number)
        x, y, z = each(lambda p, a, b: jnp.clip((p - a) / (b - a), 0, 1), point, low, high)
        _, face, _ = self._face(number, point)
        return (
            jnp.where(face[0], y, jnp.where(face[1], z, x)),
            jnp.where(face[0], z, jnp.where(face[1], x, y)),
        )

    def bounds(self, time: float) -> tuple[Array, Array]:
        return self.low, self.high


def _lower(a: Array, b: Array) -> Array:
    """Return the smaller number, b if one of them is NaN: a single instruction.

    NaN arises for a ray along a face. At the lower face, the ray enters at inf, as b says; at the upper face,
    it leaves at -inf, as b says in :func:`_higher`. Both are misses, also where the other end becomes NaN:
    comparisons with NaN are false.
    """
    return jnp.where(a < b, a, b)


def _higher(a: Array, b: Array) -> Array:
    """Return the larger number, b if one of them is NaN."""
    return jnp.where(a > b, a, b)


def _axis(axis: Array) -> Vector:
    """Return normals of any length, scaled to a length between 1 and 4."""
    return scaled(components(axis))[1][0]


def _height(point: Vector, base: Vector, normal: Vector) -> tuple[Array, Vector]:
    """Return the height above a plane, in units of its normal's length, and its gradient."""
    return dot(minus(point, base), normal), normal


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
            # Enlarged by rounding: rays do not slip between the side and a disc at its end.
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

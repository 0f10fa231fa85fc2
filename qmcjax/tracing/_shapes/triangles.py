"""Triangles, still or with vertices that move: no ray slips between two that share an edge or a vertex."""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.shape_batches import Rays, Shape, rounding
from qmcjax.tracing._shapes.vectors import (
    Vector,
    components,
    cross,
    dot,
    largest,
    length,
    minus,
    plus,
    scaled,
    times,
)


class _Sheared(NamedTuple):
    """Linear maps from the directions of rays to (0, 0, 1)."""

    rays: Rays
    x: Vector
    y: Vector
    z: Vector


@frozen_pytree
class Triangles(Shape):
    """Triangles with normals along (b - a) x (c - a). u and v are the weights of b and c."""

    vertices: Any
    """(n, 3, 3): triangle, vertex a, b or c, coordinate; when the shutter opens."""
    close: Any
    """(n, 3, 3): when it closes; None for still triangles. Vertices move on straight lines between."""
    tree: Any = None
    """A tree over many triangles; None where a loop over all of them is as fast."""

    @property
    def moving(self) -> bool:
        return self.close is not None

    def at(self, time: Any) -> "Triangles":
        if self.close is None:
            return self
        return Triangles((1 - time) * self.vertices + time * self.close, None, self.tree)

    def alone(self) -> "Triangles":
        return Triangles(self.vertices, self.close)

    def _corners(self, number: Any, time: Any) -> list[Vector]:
        corners = [components(self.vertices[number, j]) for j in range(3)]
        if self.close is None:
            return corners
        ends = [components(self.close[number, j]) for j in range(3)]
        return [plus(times(1 - time, a), times(time, b)) for a, b in zip(corners, ends, strict=True)]

    def prepare(self, rays: Rays) -> _Sheared:
        return _Sheared(rays, *sheared(rays.direction))

    def distance(self, number: Any, prepared: _Sheared) -> Array:
        """Return distances by three signed areas in the plane perpendicular to the ray.

        For a shared edge, the sign of its area follows from a comparison of the same two rounded products.
        Rounding keeps their order, but may make them equal; then the ray hits both triangles. So every hit of
        the mesh with the sheared vertices in exact arithmetic is a hit here [1]_.

        References
        ----------
        .. [1] S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", 2013.
        """
        rays = prepared.rays
        corners = self._corners(number, rays.time)
        size = largest(corners[0]) + largest(corners[1]) + largest(corners[2])
        slack = rays.slack + rounding(size)
        a, b, c = (minus(corner, rays.origin) for corner in corners)
        off = ~_on(a, minus(corners[1], corners[0]), minus(corners[2], corners[0]), slack)
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (
            (dot(prepared.x, v), dot(prepared.y, v), dot(prepared.z, v)) for v in (a, b, c)
        )
        # Not the signs of differences: one that becomes a fused multiply-add can be above 0 for the triangles
        # on both sides of the edge.
        pairs = (cx * by, cy * bx), (ax * cy, ay * cx), (bx * ay, by * ax)
        left, right = True, True
        for one, other in pairs:
            left, right = left & (one >= other), right & (one <= other)
        u, v, w = (one - other for one, other in pairs)
        total = u + v + w
        distance = (u * az + v * bz + w * cz) / jnp.where(total == 0, 1, total)
        # For a triangle seen edge-on the areas are rounding; the distance remains that of a vertex.
        distance = jnp.maximum(distance, jnp.minimum(jnp.minimum(az, bz), cz))
        distance = jnp.minimum(distance, jnp.maximum(jnp.maximum(az, bz), cz))
        return jnp.where((left | right) & off & (total != 0) & (distance > 0), distance, jnp.inf)

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        a, b, c = self._corners(number, time)
        normal = cross(*scaled(minus(b, a), minus(c, a))[1])
        return dot(minus(point, a), normal), normal

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        a, b, c = self._corners(number, time)
        scale, (one, other) = scaled(minus(b, a), minus(c, a))
        start = times(scale, minus(point, a))
        normal = cross(one, other)
        squared = dot(normal, normal)
        squared = jnp.where(squared > 0, squared, 1)
        u, v = dot(cross(start, other), normal) / squared, dot(cross(one, start), normal) / squared
        return jnp.clip(u, 0, 1), jnp.clip(v, 0, 1)

    def bounds(self, time: float) -> tuple[Array, Array]:
        corners = self.vertices
        if self.close is not None:
            corners = (1 - time) * corners + time * self.close
        return corners.min(axis=1), corners.max(axis=1)


def sheared(direction: Vector) -> tuple[Vector, Vector, Vector]:
    """Return maps of space, by rows, from directions to (0, 0, 1).

    They keep one or two coordinates, along the largest component of the direction: coefficients of zero and
    one make exact products.
    """
    x, y, z = direction
    along_z = (abs(z) >= abs(x)) & (abs(z) >= abs(y))
    along_x = ~along_z & (abs(x) >= abs(y))
    along_y = ~along_z & ~along_x

    def chosen(first: Any, second: Any, third: Any) -> Array:
        return jnp.where(along_x, first, jnp.where(along_y, second, third))

    most = chosen(x, y, z)
    inverse = 1 / jnp.where(most == 0, 1, most)
    one = jnp.ones_like(x)
    zero = jnp.zeros_like(x)
    shear_x, shear_y = -chosen(y, z, x) * inverse, -chosen(z, x, y) * inverse
    return (
        (chosen(shear_x, zero, one), chosen(one, shear_x, zero), chosen(zero, one, shear_x)),
        (chosen(shear_y, one, zero), chosen(zero, shear_y, one), chosen(one, zero, shear_y)),
        (chosen(inverse, zero, zero), chosen(zero, inverse, zero), chosen(zero, zero, inverse)),
    )


def _on(corner: Vector, one: Vector, other: Vector, slack: Any) -> Array:
    """Return whether origins are on triangles.

    Near their planes is not enough: a ray in the plane of a triangle that starts beside it would pass it, and
    then slip through the silhouette of a mesh.
    """
    scale, (one, other) = scaled(one, other)
    corner, slack, normal = times(scale, corner), scale * slack, cross(one, other)
    squared = dot(normal, normal)
    inverse = 1 / jnp.where(squared > 0, squared, 1)
    duals = times(inverse, cross(other, normal)), times(inverse, cross(normal, one))
    u, v = -dot(corner, duals[0]), -dot(corner, duals[1])
    wider = slack * (length(duals[0]) + length(duals[1]))
    height = dot(normal, corner)
    near = (u >= -wider) & (v >= -wider) & (u + v <= 1 + wider)
    return near & (height * height <= slack * slack * squared)

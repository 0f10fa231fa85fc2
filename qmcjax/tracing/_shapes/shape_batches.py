"""The base of all shapes: batches of primitives of one kind, and rays in object space."""

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._shapes.vectors import Vector, components, dot, minus, unit

SLACK = 16
"""Origins within this many units of rounding of a surface are considered to be on it."""


class Rays(NamedTuple):
    """Rays in object space, all components of one shape.

    A ray that starts on a surface, within rounding, does not hit it there again, except where the surface
    curves back. The tolerance is ``slack`` plus the same for the coordinates of the primitive.
    """

    origin: Vector
    direction: Vector
    time: Any
    squared: Any
    """Squared length of the direction."""
    slack: Any
    """``SLACK`` units of rounding of the largest coordinate; infinite for rays that cannot hit anything."""


def rounding(scale: Any) -> Any:
    """Return ``SLACK`` units of rounding of coordinates as large as the scale."""
    return SLACK * jnp.finfo(scale.dtype).eps * scale


def row(array: Array, number: Any) -> Vector:
    """Return the vectors of some primitives: one number for all rays, or one per ray."""
    return components(array[number])


class Shape(ABC):
    """A batch of primitives of one kind: a pytree of arrays with the primitive as first axis.

    The number of a primitive is one for all rays, one per ray, or ``slice(None)`` if there is one primitive
    per ray. Points and rays are in object space, with components of one shape (see
    ``qmcjax.tracing._shapes.vectors``).
    """

    tree: Any = None
    """Accelerates the search for a primitive, see ``triangle_tree``; None without a tree."""

    @property
    def count(self) -> int:
        """Number of primitives."""
        return next(iter(vars(self).values())).shape[0]

    @property
    def moving(self) -> bool:
        """Whether primitives depend on time in object space."""
        return False

    def at(self, time: Any) -> "Shape":
        """Return the shape at one time."""
        return self

    def alone(self) -> "Shape":
        """Return the batch without its tree."""
        return self

    def prepare(self, rays: Rays) -> Any:
        """Return the data shared by tests of all primitives against the same rays, by default the rays."""
        return rays

    @abstractmethod
    def distance(self, number: Any, prepared: Any) -> Array:
        """Return the distance of the first hit in units of the direction's length, inf for a miss.

        It is not differentiated, and never NaN.
        """

    @abstractmethod
    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        """Return a function of the point that is 0 on the surface, and its gradient, which points outward.

        Derivatives of hits follow from both. They are finite everywhere.
        """

    def normal(self, number: Any, point: Vector, time: Any) -> Vector:
        """Return unit normals at points of the surface."""
        return unit(self.surface(number, point, time)[1])

    @abstractmethod
    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        """Return (u, v) of points of the surface, for textures; in [0, 1] except for planes."""

    @abstractmethod
    def bounds(self, time: float) -> tuple[Array, Array]:
        """Return boxes of primitives when the shutter opens (0) or closes (1): low, high (count, 3)."""

    def extent(self) -> tuple[Array, Array]:
        """Return boxes of primitives at all times: low, high (count, 3)."""
        low, high = self.bounds(0)
        if self.moving:
            last_low, last_high = self.bounds(1)
            low, high = jnp.minimum(low, last_low), jnp.maximum(high, last_high)
        return low, high


def first(near: Any, far: Any, rays: Rays, slack: Any) -> Array:
    """Return the first of two distances that is a hit."""
    return jnp.where(ahead(near, rays, slack), near, jnp.where(ahead(far, rays, slack), far, jnp.inf))


def ahead(distance: Any, rays: Rays, slack: Any) -> Array:
    """Return whether a distance is that of a hit: above 0, and above rounding."""
    return (distance > 0) & (distance * distance * rays.squared > slack * slack)


def roots(b: Any, c: Any, squared: Any, chord: Any, on: Any) -> tuple[Array, Array]:
    """Return where lines cross a round surface: the roots of ``squared t^2 + 2 b t + c``, or NaN.

    ``chord`` is the squared half chord, which gives the discriminant without cancellation; ``on`` is true
    where c is 0 up to rounding.

    References
    ----------
    .. [1] E. Haines et al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019.
    """
    squared = jnp.where(squared > 0, squared, 1)
    root = jnp.sqrt(squared * chord)
    q = -(b + jnp.where(b > 0, root, -root))
    one, other = q / squared, jnp.where(on, 0, c / jnp.where(q == 0, 1, q))
    one = jnp.where(on, -2 * b / squared, one)
    return jnp.minimum(one, other), jnp.maximum(one, other)


def slabs(below: Vector, above: Vector, direction: Vector) -> tuple[Array, Array]:
    """Return the distances where rays enter and leave boxes; those of a miss are reversed.

    ``below`` and ``above`` are the corners relative to the origins. A ray along a face is outside.
    """
    enter, leave = -jnp.inf, jnp.inf
    for low, high, d in zip(below, above, direction, strict=True):
        inverse = 1 / jnp.where(d == 0, 1, d)
        inside = (low < 0) & (high > 0)
        near, far = jnp.minimum(low * inverse, high * inverse), jnp.maximum(low * inverse, high * inverse)
        near = jnp.where(d == 0, jnp.where(inside, -jnp.inf, jnp.inf), near)
        far = jnp.where(d == 0, jnp.where(inside, jnp.inf, -jnp.inf), far)
        enter, leave = jnp.maximum(enter, near), jnp.minimum(leave, far)
    return jnp.asarray(enter), jnp.asarray(leave)


def meets(below: Vector, above: Vector, direction: Vector, limit: Array) -> Array:
    """Return whether rays may hit boxes up to a limit, with the products of :func:`slabs` rounded."""
    enter, leave = slabs(below, above, direction)
    slower = 1 + 8 * jnp.finfo(limit.dtype).eps
    inside = jnp.minimum(enter, enter / slower) <= leave * slower
    return (leave >= 0) & inside & (enter <= limit * slower)


def plane(point: Vector, normal: Vector, rays: Rays, slack: Any) -> Array:
    """Return the distances where rays cross a plane, else inf; the normal has any length."""
    height, slope = dot(normal, minus(point, rays.origin)), dot(normal, rays.direction)
    off = height * height > slack * slack * dot(normal, normal)
    distance = height / jnp.where(slope == 0, 1, slope)
    return jnp.where(off & (slope != 0) & (distance > 0), distance, jnp.inf)

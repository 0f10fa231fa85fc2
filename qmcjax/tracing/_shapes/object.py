"""Objects: shapes that move together.

The base of all shapes: batches of primitives of one kind, and rays in object space.
"""

from abc import ABC, abstractmethod
from itertools import accumulate
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.parameters import cast
from qmcjax.core.plug_ins import unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.vectors import (
    Vector,
    components,
    cross,
    dot,
    largest,
    minus,
    plus,
    stacked,
    times,
    unit,
)
from qmcjax.tracing.motion.evaluation import evaluate_motion

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


class Frame(NamedTuple):
    """An affine map from object space to the world, at the time of each ray."""

    columns: tuple[Vector, Vector, Vector]
    """Images of the axes."""
    duals: tuple[Vector, Vector, Vector]
    """Rows of the inverse; zeros if the map is singular."""
    translation: Vector

    def inside(self, vector: Vector) -> Vector:
        """Return directions of the world in object space."""
        return dot(self.duals[0], vector), dot(self.duals[1], vector), dot(self.duals[2], vector)

    def outside(self, vector: Vector) -> Vector:
        """Invert :meth:`inside`."""
        return _combine(self.columns, vector)

    def normal(self, gradient: Vector) -> Vector:
        """Return gradients in the world: by the inverse transpose."""
        return _combine(self.duals, gradient)

    def gradient(self, normal: Vector) -> Vector:
        """Invert :meth:`normal`."""
        return dot(self.columns[0], normal), dot(self.columns[1], normal), dot(self.columns[2], normal)


def to_object_space(frame: Frame | None, origin: Vector, direction: Vector, time: Array) -> Rays:
    """Return world rays in the object space of a frame; distances along them stay the same."""
    size = largest(origin)
    if frame is not None:
        size = size + largest(frame.translation)
        size = size * jnp.sqrt(sum(dot(dual, dual) for dual in frame.duals))
        origin, direction = frame.inside(minus(origin, frame.translation)), frame.inside(direction)
        size = jnp.where(jnp.isfinite(time), size, jnp.inf)
    squared = dot(direction, direction)
    slack = jnp.where(jnp.isfinite(squared) & (squared > 0), rounding(size), jnp.inf)
    return Rays(origin, direction, time, squared, slack)


def identity(time: Array) -> Frame:
    """Return the frame of still objects."""
    zero, one = jnp.zeros_like(time), jnp.ones_like(time)
    axes = (one, zero, zero), (zero, one, zero), (zero, zero, one)
    return Frame(axes, axes, (zero, zero, zero))


def _combine(vectors: tuple[Vector, Vector, Vector], factors: Vector) -> Vector:
    one, two, three = (times(factor, vector) for factor, vector in zip(factors, vectors, strict=True))
    return plus(plus(one, two), three)


@frozen_pytree
class Object:
    """Shapes in object space, and the motion of that space in the world."""

    shapes: tuple[Shape, ...]
    motion: Any
    """From times, shape (...), to matrices (..., 3, 3) and translations (..., 3); None if it is still."""
    material: Any

    @property
    def count(self) -> int:
        """Number of primitives."""
        return sum(shape.count for shape in self.shapes)

    def numbered(self, first: int) -> list[tuple[Shape, int]]:
        """Return shapes with the numbers of their first primitives, by that of the object."""
        starts = accumulate((shape.count for shape in self.shapes[:-1]), initial=first)
        return list(zip(self.shapes, starts, strict=True)) if self.shapes else []

    @property
    def moves(self) -> bool:
        """Whether any primitive depends on time."""
        return self.motion is not None or any(shape.moving for shape in self.shapes)

    @property
    def recolors(self) -> bool:
        """Whether the material may depend on time."""
        return self.material is not None and getattr(unwrap(self.material), "moving", True)

    def frame(self, time: Array) -> Frame | None:
        """Return the map to the world at some times, shape (n,); None for the identity.

        Rays without a time (NaN) get the map of another ray, which keeps derivatives finite.
        """
        if self.motion is None:
            return None
        time = jnp.where(jnp.isfinite(time), time, 0)
        matrix, translation = cast(evaluate_motion(unwrap(self.motion), time), time.dtype)
        a, b, c = (components(matrix[..., j]) for j in range(3))
        duals = cross(b, c), cross(c, a), cross(a, b)
        volume = dot(a, duals[0])
        inverse = jnp.where(volume == 0, 0, 1 / jnp.where(volume == 0, 1, volume))
        duals = times(inverse, duals[0]), times(inverse, duals[1]), times(inverse, duals[2])
        return Frame((a, b, c), duals, components(translation))

    def placed(self, time: Array) -> tuple[Array, Array] | None:
        """Return the map at one time as a matrix (3, 3) and a translation (3,); None for the identity."""
        frame = self.frame(time[None])
        if frame is None:
            return None
        return jnp.stack([stacked(a)[0] for a in frame.columns], axis=-1), stacked(frame.translation)[0]

    def bounds(self) -> tuple[Array, Array]:
        """Return the bounding box of the shapes in object space, at all times: low and high, (3,)."""
        lows, highs = zip(*(shape.extent() for shape in self.shapes), strict=True)
        return jnp.concatenate(lows).min(axis=0), jnp.concatenate(highs).max(axis=0)


def as_motion(motion: Any) -> Any:
    """Return a motion, or None, as a pytree, or raise a TypeError."""
    if motion is None:
        return None
    checks.function("motion", motion, "of times")
    return wrap("motion", motion)


def as_object(name: str, value: Any) -> Object:
    """Return an object, or raise a TypeError that names the argument."""
    if not isinstance(value, Object):
        raise TypeError(f"{name} must be objects of qmcjax.tracing (sphere, ...), got {checks.shown(value)}")
    return value

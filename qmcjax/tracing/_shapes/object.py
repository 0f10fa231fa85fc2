"""Objects: shapes that move together."""

from itertools import accumulate
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.parameters import cast
from qmcjax.core.plug_ins import unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.shape_batches import Rays, Shape, rounding
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
)
from qmcjax.tracing.motion.evaluation import evaluate_motion


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

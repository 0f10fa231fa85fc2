"""Intersections: the nearest hits with everything that is differentiable about them."""

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.parameters import cast
from qmcjax.tracing._search.picked import EACH, picked
from qmcjax.tracing._search.search import search
from qmcjax.tracing._shapes.object import Frame, identity, seen_from
from qmcjax.tracing._shapes.shape_batches import Shape
from qmcjax.tracing._shapes.vectors import Vector, along, dot, each, kept, minus, plus, times, unit, where
from qmcjax.tracing._world.world import World, with_shapes

UNKNOWN = -2
"""Replaces the number of a primitive that has to be searched."""


class Intersection(NamedTuple):
    """Hits, components of shape (n,)."""

    valid: Array
    """Whether anything is hit; if not, the numbers below are only finite."""
    number: Array
    """int32: number of the primitive, -1 without a hit."""
    distance: Array
    point: Vector
    """In world space, on the surface up to rounding."""
    normal: Vector
    """Unit vectors; zeros without a hit."""
    inside: Vector
    """The point in object space."""


def in_dtype(world: World, dtype: DTypeLike) -> World:
    """Return a world with the numbers of shapes and lights in a dtype."""

    def numbers(shape: Shape) -> Any:
        # A tree is made of integers.
        others: Any = cast(shape.alone(), dtype)
        return others if shape.tree is None else replace(others, tree=shape.tree)

    return World(with_shapes(world, numbers).objects, cast(world.lights, dtype))


def intersect(
    world: World, origin: Vector, direction: Vector, time: Array, known: Array | None = None
) -> Intersection:
    """Return the nearest hits of rays. The choice of the primitive has no derivative; all else has.

    ``known`` are numbers of primitives, -1 for nothing, ``UNKNOWN`` where they have to be searched.
    """
    fixed = jax.lax.stop_gradient((world, origin, direction, time))
    farthest = jnp.full_like(time, jnp.inf)
    if known is None:
        distance, number = search(*fixed, farthest, False)
    else:
        distance, number = _confirmed(*fixed, farthest, known)
    hit = number >= 0
    # Rays without a hit, also those with NaN, continue with harmless numbers, to keep derivatives finite.
    origin, direction = kept(hit, origin), kept(hit, direction)
    at, distance = jnp.where(hit, time, 0), jnp.where(hit, distance, 0)
    frame = frames(world, number, time)
    if frame is not None:
        origin, direction = frame.inside(minus(origin, frame.translation)), frame.inside(direction)
    surface = partial(_surface, picked(world.batches(), number), at)
    # A Newton step: the value is 0 up to rounding, and its derivatives are those of the distance.
    value, gradient = surface(along(origin, distance, direction))
    slope = dot(gradient, direction)
    step = value / jnp.where(slope == 0, 1, slope)
    distance = distance - (step - jax.lax.stop_gradient(step))
    # Shortest way to the surface: no farther from it than its coordinates are rounded.
    inside = along(origin, distance, direction)
    value, gradient = surface(inside)
    squared = dot(gradient, gradient)
    inside = minus(inside, times(value / jnp.where(squared == 0, 1, squared), gradient))
    point = inside
    if frame is not None:
        point, gradient = plus(frame.outside(inside), frame.translation), frame.normal(gradient)
    return Intersection(hit, number, distance, point, unit(gradient), inside)


def _confirmed(
    world: World, origin: Vector, direction: Vector, time: Array, farthest: Array, known: Array
) -> tuple[Array, Array]:
    """Return distances and numbers of known primitives.

    Unknown ones, and those that a ray misses by rounding at the ends of intervals, are searched.
    """
    distance = farthest
    rays = seen_from(frames(world, known, time), origin, direction, time)
    for here, shape in picked(world.batches(), known):
        distance = jnp.where(here, shape.distance(EACH, shape.prepare(rays)), distance)
    lost = (known == UNKNOWN) | ((known >= 0) & (distance == jnp.inf))
    direction = kept(lost, direction)
    others = jax.lax.cond(
        jnp.any(lost),
        lambda: search(world, origin, direction, time, farthest, False),
        lambda: (distance, jnp.full_like(known, -1)),
    )
    return jnp.where(lost, others[0], distance), jnp.where(lost, others[1], known)


def coordinates(
    world: World, which: list[bool], number: Array, time: Array, point: Vector
) -> tuple[Array, Array]:
    """Return (u, v) of points in object space, for the marked objects; else 0."""
    marked = [
        (shape, start + before)
        for (item, start), wanted in zip(world.numbered(), which, strict=True)
        for shape, before in zip(item.shapes, item.starts, strict=True)
        if wanted
    ]
    zero = jnp.zeros_like(time)
    result = zero, zero
    for here, shape in picked(marked, number):
        result = where(here, shape.coordinates(EACH, point, time), result)
    return result


def frames(world: World, number: Array, time: Array) -> Frame | None:
    """Return for each ray the map from the hit object to the world; None if all are still."""
    chosen = None
    for item, first in world.numbered():
        frame = item.frame(time)
        if frame is not None:
            here = (number >= first) & (number < first + item.count)
            chosen = identity(time) if chosen is None else chosen
            chosen = where(here, frame, chosen)
    return chosen


def _surface(kinds: list[tuple[Array, Shape]], time: Array, point: Vector) -> tuple[Array, Vector]:
    """Return the surface function and gradient of each ray's primitive; zeros without one."""
    result = jnp.zeros_like(time), each(jnp.zeros_like, point)
    for here, shape in kinds:
        result = where(here, shape.surface(EACH, point, time), result)
    return result

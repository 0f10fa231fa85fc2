"""The nearest hits of rays by the fastest method, with their derivatives.

A JAX program tests primitives without a tree in fused loops over tiles of rays and walks through trees
(``program``). On CPUs with Numba installed, compiled loops do the latter (``compiled_walk``). Both find the
same hits, up to rounding.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import backends
from qmcjax.core.parameters import cast
from qmcjax.tracing._shapes.object import Frame, Shape, identity, to_object_space
from qmcjax.tracing._shapes.vectors import Vector, along, dot, each, keep, minus, plus, times, unit, where
from qmcjax.tracing._world.world import World, with_shapes
from qmcjax.tracing.search.program import by_program

_FEW_ROWS = 16
"""Number of rows up to which selecting from all is faster than a gather."""

EACH = slice(None)
"""The number of a row in tables that have one row for each ray."""


def select_rows(tables: Sequence[tuple[Any, int]], number: Array) -> list[tuple[Array, Any]]:
    """Return, for each kind of table, which rays have a row in it, and a table of these rows, one per ray.

    Tables are pytrees of arrays with rows along the first axis, given with the number of the first row; those
    of equal structure are of one kind. Rays without a row get an arbitrary one.
    """
    kinds: dict[Any, list[tuple[Any, int]]] = {}
    for table, start in tables:
        kinds.setdefault(jax.tree.structure(table), []).append((table, start))
    return [_of_kind(given, number) for given in kinds.values()]


def _of_kind(tables: list[tuple[Any, int]], number: Array) -> tuple[Array, Any]:
    anywhere = jnp.zeros_like(number, bool)
    rows: list[Any] | None = None
    tree = None
    for table, start in tables:
        leaves, tree = jax.tree.flatten(table)
        count = leaves[0].shape[0]
        here = (number >= start) & (number < start + count)
        anywhere = anywhere | here
        if count <= _FEW_ROWS:
            for row in range(count):
                rows = _either(number == start + row, [_parts(leaf[row]) for leaf in leaves], rows)
        else:
            row = jnp.clip(number - start, 0, count - 1)
            rows = _either(here, [_parts(leaf[row], 1) for leaf in leaves], rows)
    assert rows is not None and tree is not None
    shapes = [leaf.shape[1:] for leaf in jax.tree.leaves(tables[0][0])]
    together = [
        jnp.stack([jnp.broadcast_to(part, number.shape) for part in parts], axis=-1).reshape(
            *number.shape, *shape
        )
        for parts, shape in zip(rows, shapes, strict=True)
    ]
    return anywhere, jax.tree.unflatten(tree, together)


def _either(here: Array, rows: list[Any], others: list[Any] | None) -> list[Any]:
    return rows if others is None else where(here, rows, others)


def _parts(array: Array, axes: int = 0) -> list[Array]:
    """Return the numbers of a row, or of one row per ray, as separate arrays, which fill SIMD registers."""
    flat = array.reshape(*array.shape[:axes], -1)
    return [flat[..., j] for j in range(flat.shape[-1])]


_MANY = 512
"""Number of triangles above which a JAX program on a CPU is faster with their tree than with loops."""

Intersector = Callable[
    [World, Sequence[Frame | None], Vector, Vector, Array, Array, bool], tuple[Array, Array]
]
"""From a world, frames of its parts, origins, directions, times, limits and whether any hit counts, to
distances and numbers of primitives (-1: none)."""


def compiled(*given: Any) -> tuple[Array, Array]:
    """Search by a JAX program that calls compiled loops for trees."""
    from qmcjax.tracing.search import compiled_walk  # Only where Numba is installed.

    return by_program(*given, walk=compiled_walk.walk)


def search(
    world: World,
    origin: Vector,
    direction: Vector,
    time: Array,
    limit: Array,
    any_hit: bool,
    intersector: Intersector | None = None,
) -> tuple[Array, Array]:
    """Return distances and primitives of the nearest hits before a limit.

    Components have the shape (n,). Without a hit the number is -1 and the distance the limit. With
    ``any_hit`` the number is that of some hit. Tests choose the method.
    """
    if intersector is None:
        world, intersector = _fastest(world)
    # Outside all loops: all searches of a program share the motions at the given times.
    frames = [item.frame(time) for item in world.parts]
    distance, number = intersector(world, frames, origin, direction, time, limit, any_hit)
    return jnp.where(number < 0, limit, distance), number


def _fastest(world: World) -> tuple[World, Intersector]:
    """Return the search method, and the world with the trees that pay off for it."""
    if not backends.current().caches:
        return world, by_program
    if find_spec("numba") is not None:
        return world, compiled
    return with_shapes(world, lambda shape: shape if shape.count >= _MANY else shape.alone()), by_program


UNKNOWN = -2
"""Replaces the number of a primitive that has to be searched."""


class Intersection(NamedTuple):
    """Hits, components of shape (n,)."""

    valid: Array
    """Whether anything is hit; if not, the values below are arbitrary but finite."""
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
        # A tree consists of integers.
        others: Any = cast(shape.alone(), dtype)
        return others if shape.tree is None else replace(others, tree=shape.tree)

    return World(with_shapes(world, numbers).objects, cast(world.lights, dtype))


def intersect(
    world: World, origin: Vector, direction: Vector, time: Array, known: Array | None = None
) -> Intersection:
    """Return the nearest hits of rays, differentiable except for the choice of the primitive.

    ``known`` are numbers of primitives, -1 for nothing, ``UNKNOWN`` if they have to be searched.
    """
    fixed = jax.lax.stop_gradient((world, origin, direction, time))
    farthest = jnp.full_like(time, jnp.inf)
    if known is None:
        distance, number = search(*fixed, farthest, False)
    else:
        distance, number = _confirm(*fixed, farthest, known)
    hit = number >= 0
    # Rays without a hit, including NaN, continue with harmless numbers, to keep derivatives finite.
    origin, direction = keep(hit, origin), keep(hit, direction)
    at, distance = jnp.where(hit, time, 0), jnp.where(hit, distance, 0)
    frame = frames(world, number, time)
    if frame is not None:
        origin, direction = frame.inside(minus(origin, frame.translation)), frame.inside(direction)
    surface = partial(_surface, select_rows(world.batches(), number), at)
    # A Newton step: the value is 0 up to rounding, and its derivatives are those of the distance.
    value, gradient = surface(along(origin, distance, direction))
    slope = dot(gradient, direction)
    step = value / jnp.where(slope == 0, 1, slope)
    distance = distance - (step - jax.lax.stop_gradient(step))
    # The shortest way to the surface, within the rounding of its coordinates.
    inside = along(origin, distance, direction)
    value, gradient = surface(inside)
    squared = dot(gradient, gradient)
    inside = minus(inside, times(value / jnp.where(squared == 0, 1, squared), gradient))
    point = inside
    if frame is not None:
        point, gradient = plus(frame.outside(inside), frame.translation), frame.normal(gradient)
    return Intersection(hit, number, distance, point, unit(gradient), inside)


def _confirm(
    world: World, origin: Vector, direction: Vector, time: Array, farthest: Array, known: Array
) -> tuple[Array, Array]:
    """Return distances and numbers of known primitives.

    Unknown ones, and those that a ray misses by rounding at the ends of intervals, are searched.
    """
    distance = farthest
    rays = to_object_space(frames(world, known, time), origin, direction, time)
    for here, shape in select_rows(world.batches(), known):
        distance = jnp.where(here, shape.distance(EACH, shape.prepare(rays)), distance)
    lost = (known == UNKNOWN) | ((known >= 0) & (distance == jnp.inf))
    direction = keep(lost, direction)
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
        batch
        for (item, start), wanted in zip(world.numbered(), which, strict=True)
        for batch in (item.numbered(start) if wanted else ())
    ]
    zero = jnp.zeros_like(time)
    result = zero, zero
    for here, shape in select_rows(marked, number):
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

"""Which primitive a ray hits, in two ways behind one function.

A program of JAX tests primitives without a tree in fused loops over tiles of rays
(``loops``), and walks through trees (``walk``). On processors, where
numba is installed, worlds of more than a few primitives are searched by compiled loops
(:mod:`qmcjax.tracing._search.compiled_world`). All find the same hits, but for rounding.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._search import compiled_world, loops, walk
from qmcjax.tracing._shapes.object import Frame, seen_from
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import Vector
from qmcjax.tracing._world.world import World

_MANY = 512
"""From so many triangles on, a program of JAX for a processor is faster with their tree than with loops."""

_FEW = 47
"""Up to so many primitives, fused loops are faster than compiled ones: they test 16 rays in one step."""

Way = Callable[[World, Sequence[Frame | None], Vector, Vector, Array, Array, bool], tuple[Array, Array]]
"""From a world, frames of its parts, origins, directions, times, limits and whether any hit counts, to
distances and numbers of primitives (-1: none)."""


def search(
    world: World,
    origin: Vector,
    direction: Vector,
    time: Array,
    limit: Array,
    any_hit: bool,
    way: Way | None = None,
) -> tuple[Array, Array]:
    """Return distances, and numbers of primitives, of the nearest hits before a limit.

    Components have the shape (n,). The number is -1, and the distance the limit, where there is none.
    With ``any_hit`` the number is that of some hit. Tests choose the way.
    """
    if way is None:
        world, way = _fastest(world)
    # Outside of all loops: what motions make of times is the same for all searches of a program.
    frames = [item.frame(time) for item in world.parts]
    distance, number = way(world, frames, origin, direction, time, limit, any_hit)
    return jnp.where(number < 0, limit, distance), number


def by_program(
    world: World,
    frames: Sequence[Frame | None],
    origin: Vector,
    direction: Vector,
    time: Array,
    limit: Array,
    any_hit: bool,
) -> tuple[Array, Array]:
    """Search by a program of JAX alone."""
    distance, number = loops.visit(world, frames, origin, direction, time, limit, any_hit)
    for (item, start), frame in zip(world.numbered(), frames, strict=True):
        if all(shape.tree is None for shape in item.shapes):
            continue
        rays = seen_from(frame, origin, direction, time)
        for shape, before in zip(item.shapes, item.starts, strict=True):
            if not isinstance(shape, Triangles) or shape.tree is None:
                continue
            new, row = walk.walk(shape, rays, distance, any_hit)
            distance = jnp.where(row < 0, distance, -jnp.inf if any_hit else new)
            number = jnp.where(row < 0, number, start + before + row)
    return distance, number


def _fastest(world: World) -> tuple[World, Way]:
    """Return the way to search, and the world with those trees that are worth it there."""
    if jax.default_backend() != "cpu":
        return world, by_program
    known = all(type(shape) in compiled_world.KINDS for shape, _ in world.batches())
    if known and world.count > _FEW and find_spec("numba") is not None:
        return world, compiled_world.search
    objects = (
        replace(item, shapes=tuple(s if s.count >= _MANY else s.alone() for s in item.shapes))
        for item in world.objects
    )
    return World(tuple(objects), world.lights), by_program

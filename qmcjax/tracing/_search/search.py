"""The nearest primitive of rays, by two methods behind one function.

A JAX program tests primitives without a tree in fused loops over tiles of rays (``loops``), and traverses
trees (``walk``). On processors with numba installed, worlds of more than a few primitives are searched by
compiled loops (:mod:`qmcjax.tracing._search.compiled_world`). All find the same hits, up to rounding.
"""

from collections.abc import Callable, Sequence
from importlib.util import find_spec

import jax.numpy as jnp
from jax import Array

from qmcjax.core import backends
from qmcjax.tracing._search import compiled_world
from qmcjax.tracing._search.loops import by_program
from qmcjax.tracing._shapes.object import Frame
from qmcjax.tracing._shapes.vectors import Vector
from qmcjax.tracing._world.world import World, with_shapes

_MANY = 512
"""From so many triangles on, a JAX program for a processor is faster with their tree than with loops."""

_FEW = 47
"""Up to so many primitives, fused loops are faster than compiled ones: they test 16 rays per step."""

Intersector = Callable[
    [World, Sequence[Frame | None], Vector, Vector, Array, Array, bool], tuple[Array, Array]
]
"""From a world, frames of its parts, origins, directions, times, limits and whether any hit counts, to
distances and numbers of primitives (-1: none)."""


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
    # Outside of all loops: motions at the given times are the same for all searches of a program.
    frames = [item.frame(time) for item in world.parts]
    distance, number = intersector(world, frames, origin, direction, time, limit, any_hit)
    return jnp.where(number < 0, limit, distance), number


def _fastest(world: World) -> tuple[World, Intersector]:
    """Return the search method, and the world with the trees that are worth it there."""
    if not backends.current().caches:
        return world, by_program
    known = all(type(shape) in compiled_world.KINDS for shape, _ in world.batches())
    if known and world.count > _FEW and find_spec("numba") is not None:
        return world, compiled_world.search
    return with_shapes(world, lambda shape: shape if shape.count >= _MANY else shape.alone()), by_program

"""Which primitive a ray hits, in three ways behind one function.

Primitives without a tree are tested in fused loops over tiles of rays (:mod:`qmcjax.tracing._loops`); trees
are walked by a program of JAX (:mod:`qmcjax.tracing._walk`), or on processors, where numba is installed, by
compiled loops (:mod:`qmcjax.tracing._compiled_walk`). All find the same hits, but for rounding.
"""

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing import _compiled_walk, _loops, _walk
from qmcjax.tracing._object import seen_from
from qmcjax.tracing._shape import Rays
from qmcjax.tracing._vectors import Vector
from qmcjax.tracing._world import World

_MANY = 512
"""From so many triangles on, a program of JAX for a processor is faster with their tree than with loops."""

Walk = Callable[[Any, Rays, Array, bool], tuple[Array, Array]]
"""From triangles with a tree, rays, limits and whether any hit counts, to distances and rows (-1: none)."""


def search(
    world: World,
    origin: Vector,
    direction: Vector,
    time: Array,
    limit: Array,
    any_hit: bool,
    walk: Walk | None = None,
) -> tuple[Array, Array]:
    """Return distances, and numbers of primitives, of the nearest hits before a limit.

    Components have the shape (n,). The number is -1, and the distance the limit, where there is none.
    With ``any_hit`` the number is that of some hit. Tests choose how trees are walked.
    """
    if walk is None:
        world, walk = _fastest(world)
    # Outside of all loops: what motions make of times is the same for all searches of a program.
    frames = [item.frame(time) for item in world.parts]
    distance, number = _loops.visit(world, frames, origin, direction, time, limit, any_hit)
    for (item, start), frame in zip(world.numbered(), frames, strict=True):
        if all(shape.tree is None for shape in item.shapes):
            continue
        rays = seen_from(frame, origin, direction, time)
        for shape, before in zip(item.shapes, item.starts, strict=True):
            if shape.tree is None:
                continue
            new, row = walk(shape, rays, distance, any_hit)
            distance = jnp.where(row < 0, distance, -jnp.inf if any_hit else new)
            number = jnp.where(row < 0, number, start + before + row)
    return jnp.where(number < 0, limit, distance), number


def _fastest(world: World) -> tuple[World, Walk]:
    """Return how trees are walked, and the world with those trees that are worth it there."""
    if jax.default_backend() != "cpu":
        return world, _walk.walk
    if find_spec("numba") is not None:
        return world, _compiled_walk.walk
    objects = (
        replace(item, shapes=tuple(s if s.count >= _MANY else s.alone() for s in item.shapes))
        for item in world.objects
    )
    return World(tuple(objects), world.lights), _walk.walk

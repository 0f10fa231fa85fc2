"""Which primitive a ray hits: all of them in fused loops over tiles of rays."""

import operator
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.tracing._object import Object
from qmcjax.tracing._shape import Rays, Shape, rounding, slabs
from qmcjax.tracing._vectors import Vector, components, each, largest, minus
from qmcjax.tracing._world import World, merged

TILE = 8192
"""Rays that are tested together: their state fits the second cache of a processor."""

_UNROLLED = 4
"""Primitives that are tested in one pass over a tile, whose nearest hits stay in registers."""

_FEW = 4
"""Up to so many primitives, the box around an object costs more than it saves."""


def search(
    world: World, origin: Vector, direction: Vector, time: Array, limit: Array, any_hit: bool
) -> tuple[Array, Array]:
    """Return distances, and numbers of primitives, of the nearest hits before a limit.

    Components have the shape (n,). The number is -1, and the distance the limit, where there is none.
    With ``any_hit`` the number is that of some hit.
    """
    rays = *origin, *direction, time, limit
    count = time.shape[0]
    if count <= TILE:
        return _tile(world, rays, any_hit)
    tiles = -(-count // TILE)
    padded = [jnp.concatenate([a, jnp.broadcast_to(a[-1:], tiles * TILE - count)]) for a in rays]
    shaped = tuple(a.reshape(tiles, TILE) for a in padded)
    distance, number = jax.lax.map(lambda tile: _tile(world, tile, any_hit), shaped)
    return distance.reshape(-1)[:count], number.reshape(-1)[:count]


def _tile(world: World, rays: Any, any_hit: bool) -> tuple[Array, Array]:
    origin, direction, time, limit = rays[:3], rays[3:6], rays[6], rays[7]
    found = limit, jnp.full(time.shape, -1, jnp.int32)
    small = [(item, start) for item, start in world.numbered() if _small(item)]
    if small:
        together = Object(tuple(shape for item, _ in small for shape in item.shapes), None, None)
        starts = [start + before for item, start in small for before in item.starts]
        of_all = together.rays(origin, direction, time)
        for shape, places in merged(together.shapes):
            counts = [together.shapes[place].count for place in places]
            firsts = [starts[place] for place in places]
            rows = [np.arange(a, a + n, dtype=np.int32) for a, n in zip(firsts, counts, strict=True)]
            name = jnp.asarray(np.concatenate(rows)).__getitem__
            found = _visit(shape, name, of_all, found, any_hit)
    for item, start in world.numbered():
        if _small(item):
            continue
        of_object = item.rays(origin, direction, time)

        def visit(found: Any, item: Object = item, start: int = start, rays: Rays = of_object) -> Any:
            for shape, before in zip(item.shapes, item.starts, strict=True):
                found = _visit(shape, partial(operator.add, start + before), rays, found, any_hit)
            return found

        if item.count <= _FEW:
            found = visit(found)
        else:
            found = jax.lax.cond(_meets(item, of_object, found[0]), visit, lambda found: found, found)
    return jnp.where(found[1] < 0, limit, found[0]), found[1]


def _small(item: Object) -> bool:
    """Tell whether an object is tested together with others."""
    return item.motion is None and item.count <= _FEW


def _meets(item: Object, rays: Rays, limit: Array) -> Array:
    """Tell whether any ray meets the box of an object before its limit."""
    low, high = map(components, item.bounds())
    finite = [each(lambda a: jnp.where(jnp.isfinite(a), a, 0), corner) for corner in (low, high)]
    wider = rays.slack + rounding(largest(finite[0]) + largest(finite[1]))
    below = each(lambda a: a - wider, minus(low, rays.origin))
    above = each(lambda a: a + wider, minus(high, rays.origin))
    enter, leave = slabs(below, above, rays)
    # The products in slabs are rounded, too.
    slower = 1 + 8 * jnp.finfo(limit.dtype).eps
    meets = (leave >= 0) & (jnp.minimum(enter, enter / slower) <= leave * slower) & (enter < limit * slower)
    return jnp.any(meets & jnp.isfinite(rays.slack))


def _visit(shape: Shape, name: Callable[[Any], Any], rays: Rays, found: Any, any_hit: bool) -> Any:
    """Test all primitives of a shape, whose numbers in the world are told by their rows."""
    prepared = shape.prepare(rays)

    def test(number: Any, found: Any) -> Any:
        limit, which = found
        distance = shape.distance(number, prepared)
        closer = distance < limit
        # What is found of any hit is final: no distance is below that.
        nearest = jnp.where(closer, -jnp.inf if any_hit else distance, limit)
        return nearest, jnp.where(closer, name(number), which)

    whole = shape.count // _UNROLLED * _UNROLLED if shape.count > _UNROLLED else 0

    def several(block: Array, found: Any) -> Any:
        for j in range(_UNROLLED):
            found = test(block * _UNROLLED + j, found)
        return found

    if whole:
        found = jax.lax.fori_loop(0, whole // _UNROLLED, several, found)
    for number in range(whole, shape.count):
        found = test(np.int32(number), found)
    return found

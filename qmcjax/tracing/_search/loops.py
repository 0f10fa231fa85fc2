"""Intersection by a JAX program: primitives without a tree in fused loops over tiles of rays, then trees.

Still primitives are merged by kind of shape, with one loop per kind. Each kind in a moving object, or in one
that is worth a bounding box, has its own loop, which is skipped if no ray of the tile hits the box.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.tracing._search.tiles import by_tiles
from qmcjax.tracing._search.walk import walk
from qmcjax.tracing._shapes.object import Frame, Object, seen_from
from qmcjax.tracing._shapes.shape_batches import Rays, Shape, meets, rounding
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import Vector, components, each, largest, minus
from qmcjax.tracing._world.world import World, merged

TILE = 8192
"""Rays tested together: their state fits the L2 cache of a processor."""

_FEW = 4
"""Up to so many primitives, the bounding box of an object costs more than it saves."""

Nearest = tuple[Array, Array]
"""Distances, -inf where any hit is final, and numbers of primitives, -1 without a hit."""


class _Segment(NamedTuple):
    """Primitives of one kind that move together: rows of the merged batch."""

    space: int
    first: int
    stop: int
    low: Array | None
    """(3,): their bounding box, None if it is not worth a test."""
    high: Array | None


class _Kind(NamedTuple):
    shape: Shape
    numbers: Array
    """int32 (n,): numbers in the world."""
    segments: list[_Segment]


def by_program(
    world: World,
    frames: Sequence[Frame | None],
    origin: Vector,
    direction: Vector,
    time: Array,
    limit: Array,
    any_hit: bool,
) -> Nearest:
    """Search by a JAX program alone: primitives without a tree, then trees. Each object has a frame."""
    spaces, kinds = _sorted(world)

    def tile(rays: Any) -> Nearest:
        origin, direction, time, limit, frames = rays
        nearest = limit, jnp.full(time.shape, -1, jnp.int32)
        rays = [seen_from(frame, origin, direction, time) for frame in frames]
        for kind in kinds:
            for segment in kind.segments:
                these = rays[segment.space]
                rows = partial(_rows, kind, segment, these, any_hit)
                if segment.low is None or segment.high is None:
                    nearest = rows(nearest)
                else:
                    inside = _any_meets(segment.low, segment.high, these, nearest[0])
                    nearest = jax.lax.cond(inside, rows, lambda nearest: nearest, nearest)
        return nearest

    rays = origin, direction, time, limit, [frames[place] for place in spaces]
    distance, number = by_tiles(tile, rays, TILE)
    for (item, start), frame in zip(world.numbered(), frames, strict=True):
        if all(shape.tree is None for shape in item.shapes):
            continue
        rays = seen_from(frame, origin, direction, time)
        for shape, before in zip(item.shapes, item.starts, strict=True):
            if not isinstance(shape, Triangles) or shape.tree is None:
                continue
            new, row = walk(shape, rays, distance, any_hit)
            distance = jnp.where(row < 0, distance, -jnp.inf if any_hit else new)
            number = jnp.where(row < 0, number, start + before + row)
    return distance, number


def _sorted(world: World) -> tuple[list[int], list[_Kind]]:
    """Return the index of an object for each motion, and the kinds of shapes."""
    spaces: list[int] = []
    still = None
    batches: list[tuple[int, bool, Shape, int]] = []  # space, whether large, shape, first number
    for place, (item, number) in enumerate(world.numbered()):
        if all(shape.tree is not None for shape in item.shapes):
            continue
        if item.motion is None and still is not None:
            space = still
        else:
            space, still = len(spaces), len(spaces) if item.motion is None else still
            spaces.append(place)
        for shape, before in zip(item.shapes, item.starts, strict=True):
            if shape.tree is None:
                batches.append((space, shape.count > _FEW, shape, number + before))
    batches.sort(key=lambda batch: batch[:2])
    kinds = []
    for shape, places in merged([shape for _, _, shape, _ in batches]):
        numbers, segments, row = [], [], 0
        for place in places:
            space, large, part, number = batches[place]
            numbers.append(np.arange(number, number + part.count, dtype=np.int32))
            previous = segments[-1] if segments else None
            if not large and previous is not None and previous.space == space:
                segments[-1] = previous._replace(stop=row + part.count)
            else:
                box = Object((part,), None, None).bounds() if large else (None, None)
                segments.append(_Segment(space, row, row + part.count, *box))
            row += part.count
        kinds.append(_Kind(shape, jnp.asarray(np.concatenate(numbers)), segments))
    return spaces, kinds


def _rows(kind: _Kind, segment: _Segment, rays: Rays, any_hit: bool, nearest: Nearest) -> Nearest:
    """Test some rows: an iteration reduces the distances of the previous row and computes its own.

    XLA computes an expression once for each of two results that share it. So the distance is a result itself
    and is reduced in the next iteration: it is computed once, not two or three times.
    """
    prepared = kind.shape.prepare(rays)

    def reduced(row: Any, distance: Array, nearest: Nearest) -> Nearest:
        closer = distance < nearest[0]
        # With any_hit the first hit is final: no distance is below it.
        least = jnp.where(closer, -jnp.inf if any_hit else distance, nearest[0])
        return least, jnp.where(closer, kind.numbers[row], nearest[1])

    def turn(row: Any, state: tuple[Array, Nearest]) -> tuple[Array, Nearest]:
        return kind.shape.distance(row, prepared), reduced(row - 1, *state)

    state = jnp.full_like(nearest[0], jnp.inf), nearest
    return reduced(segment.stop - 1, *jax.lax.fori_loop(segment.first, segment.stop, turn, state))


def _any_meets(low: Array, high: Array, rays: Rays, limit: Array) -> Array:
    """Whether any ray hits a box before its limit."""
    corners = components(low), components(high)
    finite = [each(lambda a: jnp.where(jnp.isfinite(a), a, 0), corner) for corner in corners]
    wider = rays.slack + rounding(largest(finite[0]) + largest(finite[1]))
    below = each(lambda a: a - wider, minus(corners[0], rays.origin))
    above = each(lambda a: a + wider, minus(corners[1], rays.origin))
    return jnp.any(meets(below, above, rays.direction, limit) & jnp.isfinite(rays.slack))

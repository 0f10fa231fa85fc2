"""All primitives that have no tree, in fused loops over tiles of rays.

What is still is merged by kinds of shapes, with one loop for each kind; each kind in each object that moves,
or is worth a box, has a loop of its own, which is skipped where no ray of the tile meets the box.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.tracing._search.tiles import by_tiles
from qmcjax.tracing._shapes.object import Frame, seen_from
from qmcjax.tracing._shapes.shape_batches import Rays, Shape, rounding, slabs
from qmcjax.tracing._shapes.vectors import Vector, components, each, largest, minus
from qmcjax.tracing._world.world import World, merged

TILE = 8192
"""Rays that are tested together: their state fits the second cache of a processor."""

_FEW = 4
"""Up to so many primitives, the box around an object costs more than it saves."""

Found = tuple[Array, Array]
"""Distances, -inf where any hit is final, and numbers of primitives, -1 without one."""


class _Segment(NamedTuple):
    """Primitives of one kind that move together: rows of the batch that is merged of all."""

    space: int
    first: int
    stop: int
    low: Array | None
    """(3,): the box around them, None if it is not worth a test."""
    high: Array | None


class _Kind(NamedTuple):
    shape: Shape
    names: Array
    """int32 (n,): numbers in the world."""
    segments: list[_Segment]


def visit(
    world: World,
    frames: Sequence[Frame | None],
    origin: Vector,
    direction: Vector,
    time: Array,
    limit: Array,
    any_hit: bool,
) -> Found:
    """Return what rays hit of all primitives without a tree; each object has a frame."""
    spaces, kinds = _sorted(world)

    def tile(rays: Any) -> Found:
        origin, direction, time, limit, frames = rays
        found = limit, jnp.full(time.shape, -1, jnp.int32)
        seen = [seen_from(frame, origin, direction, time) for frame in frames]
        for kind in kinds:
            found = _visit(kind, seen, found, any_hit)
        return found

    return by_tiles(tile, (origin, direction, time, limit, [frames[place] for place in spaces]), TILE)


def _sorted(world: World) -> tuple[list[int], list[_Kind]]:
    """Return the place of an object for each way of moving, and the kinds of shapes."""
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
        names, segments, row = [], [], 0
        for place in places:
            space, large, part, number = batches[place]
            names.append(np.arange(number, number + part.count, dtype=np.int32))
            previous = segments[-1] if segments else None
            if not large and previous is not None and previous.space == space:
                segments[-1] = previous._replace(stop=row + part.count)
            else:
                box = _box(part) if large else (None, None)
                segments.append(_Segment(space, row, row + part.count, *box))
            row += part.count
        kinds.append(_Kind(shape, jnp.asarray(np.concatenate(names)), segments))
    return spaces, kinds


def _box(shape: Shape) -> tuple[Array, Array]:
    """Return the box around all primitives at all times."""
    boxes = [shape.bounds(time) for time in (0, 1)]
    low, high = (jnp.stack(corners) for corners in zip(*boxes, strict=True))
    return low.min(axis=(0, 1)), high.max(axis=(0, 1))


def _visit(kind: _Kind, spaces: list[Rays], found: Found, any_hit: bool) -> Found:
    """Test all primitives of a kind."""
    for segment in kind.segments:
        rays = spaces[segment.space]

        def rows(found: Found, segment: _Segment = segment, rays: Rays = rays) -> Found:
            return _rows(kind, segment.first, segment.stop, rays, found, any_hit)

        if segment.low is None or segment.high is None:
            found = rows(found)
        else:
            meets = _meets(segment.low, segment.high, rays, found[0])
            found = jax.lax.cond(meets, rows, lambda found: found, found)
    return found


def _rows(kind: _Kind, first: Any, stop: Any, rays: Rays, found: Found, any_hit: bool) -> Found:
    """Test some rows: a turn takes in the distances of the row before, and computes its own.

    What two results of a turn share, XLA computes once for each of them. So a distance is a result of its
    own, which becomes part of what is found in the next turn: it is computed once, not two or three times.
    """
    prepared = kind.shape.prepare(rays)

    def taken(row: Any, distance: Array, found: Found) -> Found:
        closer = distance < found[0]
        # What is found of any hit is final: no distance is below that.
        nearest = jnp.where(closer, -jnp.inf if any_hit else distance, found[0])
        return nearest, jnp.where(closer, kind.names[row], found[1])

    def turn(row: Any, state: tuple[Array, Found]) -> tuple[Array, Found]:
        return kind.shape.distance(row, prepared), taken(row - 1, *state)

    before = jnp.full_like(found[0], jnp.inf)
    return taken(stop - 1, *jax.lax.fori_loop(first, stop, turn, (before, found)))


def _meets(low: Array, high: Array, rays: Rays, limit: Array) -> Array:
    """Tell whether any ray meets a box before its limit."""
    corners = components(low), components(high)
    finite = [each(lambda a: jnp.where(jnp.isfinite(a), a, 0), corner) for corner in corners]
    wider = rays.slack + rounding(largest(finite[0]) + largest(finite[1]))
    below = each(lambda a: a - wider, minus(corners[0], rays.origin))
    above = each(lambda a: a + wider, minus(corners[1], rays.origin))
    enter, leave = slabs(below, above, rays.direction)
    # The products in slabs are rounded, too.
    slower = 1 + 8 * jnp.finfo(limit.dtype).eps
    meets = (leave >= 0) & (jnp.minimum(enter, enter / slower) <= leave * slower) & (enter < limit * slower)
    return jnp.any(meets & jnp.isfinite(rays.slack))

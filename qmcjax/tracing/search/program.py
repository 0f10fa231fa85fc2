"""Intersection by a JAX program: primitives without a tree in fused loops over tiles of rays, then trees.

Still primitives are merged by kind of shape, with one loop per kind. Each kind in a moving object, or in an
object that deserves a bounding box, has its own loop, which is skipped if no ray of the tile hits the box.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import backends
from qmcjax.tracing._shapes.object import Frame, Object, Rays, Shape, meets, rounding, to_object_space
from qmcjax.tracing._shapes.triangles import Tree, Triangles
from qmcjax.tracing._shapes.vectors import Vector, components, each, largest, minus
from qmcjax.tracing._world.world import World, merge_kinds

_FEW_RAYS = 64
"""Number of rays up to which overhead dominates."""


def map_tiles(function: Callable[[Any], Any], rays: Any, size: int) -> Any:
    """Apply a function to tiles of rays, the last axis of arrays, and concatenate its results.

    Devices other than CPUs do not profit from tiles: they get all rays at once.
    """
    count = jax.tree.leaves(rays)[0].shape[-1]
    size = tile_size(count, size)
    if size == count:
        return function(rays)
    tiles = -(-count // size)

    def tiled(a: Any) -> Any:
        more = jnp.broadcast_to(a[..., -1:], (*a.shape[:-1], tiles * size - count))
        whole = jnp.concatenate([a, more], axis=-1) if more.size else a
        return jnp.moveaxis(whole.reshape(*a.shape[:-1], tiles, size), -2, 0)

    def together(a: Any) -> Any:
        return jnp.moveaxis(a, 0, -2).reshape(*a.shape[1:-1], tiles * size)[..., :count]

    return jax.tree.map(together, jax.lax.map(function, jax.tree.map(tiled, rays)))


def tile_size(count: int, size: int) -> int:
    """Return the number of rays in a tile, at most ``size``, or all where tiles do not pay off."""
    if count <= _FEW_RAYS or not backends.current().caches:
        return count
    # XLA unrolls a loop of one iteration and fuses its inputs into each use, which takes three to four times
    # as long.
    return min(size, -(-count // 2))


TREE_TILE = 1024
"""Rays that traverse together on a CPU; all wait for the slowest."""


class Walkable(NamedTuple):
    """A tree with its triangles in order, and with boxes."""

    vertices: list[Array]
    """(n, 3, 3): at one or both ends of the shutter."""
    boxes: Array
    """(n, 6), or (n, 12) at both ends: low and high."""
    skip: Array
    start: Array
    slack: Array
    """Of the coordinates of boxes."""


def in_order(shape: Triangles, tree: Tree) -> Walkable:
    """Return a tree over triangles as they are now."""
    ends = [shape.vertices] if shape.close is None else [shape.vertices, shape.close]
    ends = [vertices[tree.order] for vertices in ends]
    boxes = jnp.concatenate([boxes_of(vertices, tree) for vertices in ends], axis=1)
    largest = 2 * jnp.max(jnp.stack([jnp.max(abs(vertices)) for vertices in ends]))
    return Walkable(ends, boxes, tree.skip, tree.start, rounding(largest))


def walk(tree: Walkable, rays: Rays, limit: Array, any_hit: bool) -> tuple[Array, Array]:
    """Return the distances of hits before the limits, and rows of sorted triangles; -1 without a hit."""
    ends, boxes, (count, _) = tree.vertices, tree.boxes, tree.boxes.shape
    sorted_faces = Triangles(ends[0], None if len(ends) == 1 else ends[1])
    used = tree.skip[0]
    stop = tree.start[jnp.minimum(tree.skip, count - 1)]

    def tile(given: tuple[Rays, Array]) -> tuple[Array, Array]:
        rays, limit = given
        prepared = sorted_faces.prepare(rays)
        wider = rays.slack + tree.slack
        below, above = each(lambda a: a - wider, rays.origin), each(lambda a: a + wider, rays.origin)
        inverse = each(lambda d: 1 / d, rays.direction)
        slower = 1 + 8 * jnp.finfo(limit.dtype).eps

        def meets(node: Array, limit: Array) -> Array:
            box = boxes[node]
            if len(ends) == 2:
                time = rays.time[:, None]
                box = (1 - time) * box[:, :6] + time * box[:, 6:]
            enter, leave = jnp.zeros_like(limit), limit * slower
            low, high = minus(components(box[:, :3]), above), minus(components(box[:, 3:]), below)
            for one, other, factor in zip(low, high, inverse, strict=True):
                one, other = one * factor, other * factor
                near, far = jnp.minimum(one, other), jnp.maximum(one, other)
                # NaN, of a ray in the plane of a face, is inside.
                enter, leave = jnp.where(near > enter, near, enter), jnp.where(far < leave, far, leave)
            return (enter <= leave * slower) & (leave > 0)

        def step(state: Any) -> Any:
            """Process the current node, or the triangle of a leaf, and go to the next one.

            The node is part of the state: XLA would recompute it for each result that uses it.
            """
            node, row, inside, distance, limit, place = state
            skip, last = tree.skip[node], stop[node]
            leaf, tested, more = skip == node + 1, row >= 0, row + 1 < last
            closer = tested & (distance < limit)
            limit = jnp.where(closer, -jnp.inf if any_hit else distance, limit)
            place = jnp.where(closer, row, place)
            enters = ~tested & inside
            next_node = jnp.where(
                enters, jnp.where(leaf, node, node + 1), jnp.where(tested & more, node, skip)
            )
            next_row = jnp.where(
                tested, jnp.where(more, row + 1, -1), jnp.where(enters & leaf, tree.start[node], -1)
            )
            seen = jnp.minimum(next_node, count - 1)
            return (
                next_node,
                next_row,
                meets(seen, state[4]) & (next_node < used),
                sorted_faces.distance(jnp.maximum(next_row, 0), prepared),
                limit,
                place,
            )

        # All rays enter the root, except those that cannot hit anything.
        inside = jnp.isfinite(rays.slack) & (limit > 0)
        none = jnp.full(limit.shape, -1, jnp.int32)
        state = jnp.zeros_like(none), none, inside, limit, limit, none
        *_, limit, place = jax.lax.while_loop(lambda state: jnp.any(state[0] < used), step, state)
        return limit, place

    return map_tiles(tile, (rays, limit), TREE_TILE)


def boxes_of(vertices: Array, tree: Tree) -> Array:
    """Return the bounding boxes of all nodes, low and high, shape (n, 6).

    The triangles of a node are one run; its minimum is that of two overlapping runs of a power of 2.
    """
    count = vertices.shape[0]
    levels = [jnp.concatenate([vertices.min(axis=1), -vertices.max(axis=1)], axis=1)]
    for k in range(count.bit_length() - 1):
        half = levels[-1]
        levels.append(jnp.minimum(half, jnp.concatenate([half[2**k :], half[-(2**k) :]])))
    least = jnp.stack(levels).reshape(-1, 6)
    start = jnp.minimum(tree.start, count - 1)
    stop = tree.start[jnp.minimum(tree.skip, count - 1)]
    level = 31 - jax.lax.clz(jnp.maximum(stop - start, 1))
    last = jnp.maximum(stop - jnp.left_shift(1, level), 0)
    found = jnp.minimum(least[level * count + start], least[level * count + last])
    return jnp.concatenate([found[:, :3], -found[:, 3:]], axis=1)


LOOP_TILE = 8192
"""Rays tested together, whose state fits the L2 cache of a CPU."""

_FEW_PRIMITIVES = 4
"""Number of primitives up to which the bounding box of an object costs more than it saves."""

Nearest = tuple[Array, Array]
"""Distances, -inf where any hit is final, and numbers of primitives, -1 without a hit."""


class _Segment(NamedTuple):
    """Primitives of one kind that move together: rows of the merged batch."""

    space: int
    first: int
    stop: int
    low: Array | None
    """(3,): their bounding box, None if a test does not pay off."""
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
    walk: Callable[[Walkable, Rays, Array, bool], Nearest] = walk,
) -> Nearest:
    """Search by a JAX program: primitives without a tree, then trees. Each object has a frame."""
    spaces, kinds = _sort_kinds(world)

    def tile(rays: Any) -> Nearest:
        origin, direction, time, limit, frames = rays
        nearest = limit, jnp.full(time.shape, -1, jnp.int32)
        rays = [to_object_space(frame, origin, direction, time) for frame in frames]
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
    distance, number = map_tiles(tile, rays, LOOP_TILE)
    for (item, start), frame in zip(world.numbered(), frames, strict=True):
        if all(shape.tree is None for shape in item.shapes):
            continue
        rays = to_object_space(frame, origin, direction, time)
        for shape, first in item.numbered(start):
            if not isinstance(shape, Triangles) or shape.tree is None:
                continue
            tree = jax.tree.map(lambda a: a.astype(jnp.int32), shape.tree)
            new, row = walk(in_order(shape, tree), rays, distance, any_hit)
            distance = jnp.where(row < 0, distance, -jnp.inf if any_hit else new)
            number = jnp.where(row < 0, number, first + tree.order[row])
    return distance, number


def _sort_kinds(world: World) -> tuple[list[int], list[_Kind]]:
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
        for shape, first in item.numbered(number):
            if shape.tree is None:
                batches.append((space, shape.count > _FEW_PRIMITIVES, shape, first))
    batches.sort(key=lambda batch: batch[:2])
    kinds = []
    for shape, places in merge_kinds([shape for _, _, shape, _ in batches]):
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

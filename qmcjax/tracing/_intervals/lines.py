"""What the rays of fans see, exactly: intervals of t, with ends that move with everything they depend on."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.tracing._intervals.candidates import Batch, RayState, background, insert_spans, over_rows
from qmcjax.tracing._intervals.fans import KINDS, Fan, find_spans, outline, value
from qmcjax.tracing._intervals.resolution import resolve
from qmcjax.tracing._shapes.object import Object, Shape, rounding, row
from qmcjax.tracing._shapes.primitives import Box, Rectangle
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import each, largest
from qmcjax.tracing._world.world import World, merge_kinds
from qmcjax.tracing.search.intersection import EACH, frames, select_rows
from qmcjax.tracing.search.program import boxes_of, map_tiles

TILE = 32
"""Fans tested together."""


def opened(world: World) -> World:
    """Return a world with boxes as rectangles, so that their edges are seen."""
    return World(
        tuple(Object(tuple(map(_faces, item.shapes)), item.motion, item.material) for item in world.objects),
        world.lights,
    )


def _faces(shape: Shape) -> Shape:
    if isinstance(shape, Box):
        low, high = (jnp.asarray(side) for side in (shape.low, shape.high))
        corners, edges = [], []
        for axis in range(3):
            along = [jnp.eye(3, dtype=low.dtype)[None, (axis + k) % 3] * (high - low) for k in (1, 2)]
            for corner in (low, low.at[:, axis].set(high[:, axis])):
                corners.append(corner)
                edges.append(along)
        corner, u, v = (
            jnp.stack(part, axis=1).reshape(-1, 3)
            for part in (corners, [edge[0] for edge in edges], [edge[1] for edge in edges])
        )
        return Rectangle(corner, u, v)
    if not isinstance(shape, KINDS):
        kinds = ", ".join(kind.__name__ for kind in KINDS)
        raise TypeError(f"lines need shapes of the kinds {kinds} or Box, got {checks.shown(shape)}")
    return shape


class Parts(NamedTuple):
    """Parts of lines in which one primitive is seen, or nothing in the way."""

    start: Array
    """(count, n)."""
    end: Array
    before: Array
    """int32: the primitive whose edge may be the start, -1 for none."""
    number: Array
    """int32: the primitive that is seen; -1 where a part is unused."""
    after: Array
    until: Array
    """(n,): everything before this t is known; 1 unless parts do not fit."""


CLEAR = np.iinfo(np.int32).max
"""The number of a part with nothing in the way."""


def find_visible(world: World, fan: Fan, count: int) -> Parts:
    """Return the visible primitives along lines, up to ``count``; their ends are not differentiated."""

    def parts(state: RayState) -> Parts:
        found = resolve(state)
        start, end, number = found[:3]
        touches = (start[1:] == end[:-1]) & (number[1:] >= 0)
        none = jnp.full_like(number[:1], -1)
        before = jnp.concatenate([none, jnp.where(touches, number[:-1], -1)])
        after = jnp.concatenate([jnp.where(touches, number[1:], -1), none])
        return Parts(start, end, before, number, after, found.until)

    return _find(world, fan, count, parts)


def find_clear(world: World, fan: Fan, count: int) -> Parts:
    """Return the parts of lines in which nothing is in the way, up to ``count`` + 1; not differentiated."""

    def parts(state: RayState) -> Parts:
        spans, until = state.candidates, state.until[None]
        stops = jnp.minimum(spans.end, until)
        # A part begins at 0 and at the end of each span, unless another covers it, up to the next start.
        start = jnp.concatenate([0 * until, jnp.where(spans.start < stops, stops, 2)])
        before = jnp.concatenate([jnp.full_like(spans.number[:1], -1), spans.number])
        here, first, last, hidden = start[:, None], spans.start[None], stops[None], spans.number[None]
        covered = ((first <= here) & (here < last)).any(axis=1)
        following = jnp.where((first < last) & (first > here), first, 2)
        end = jnp.minimum(following.min(axis=1), until)
        hidden = jnp.broadcast_to(hidden, following.shape)
        after = jnp.take_along_axis(hidden, jnp.argmin(following, axis=1)[:, None], axis=1)[:, 0]
        # Of equal ends the first counts.
        earlier = jnp.tri(len(start), k=-1, dtype=bool)[..., None]
        again = ((start[None] == here) & earlier).any(axis=1)
        number = jnp.where((start < end) & ~covered & ~again, CLEAR, -1).astype(jnp.int32)
        after = jnp.where(end < until, after, -1)
        return Parts(start, jnp.maximum(start, end), before, number, after, state.until)

    return _find(world, fan, count, parts)


def _find(world: World, fan: Fan, count: int, parts: Callable[[RayState], Parts]) -> Parts:
    world, fan = jax.lax.stop_gradient((world, fan))
    groups = _groups(world)
    placed = [None if item is None else item.frame(fan.time) for item, _ in groups]

    def tile(given: Any) -> tuple[list[Array], ...]:
        fan, placed = given
        zero = jnp.zeros((), fan.time.dtype)
        nothing = jnp.full(fan.time.shape, -1, jnp.int32)
        state = background(nothing, fan.limit, count, zero, zero + 1)
        for frame, (_, batches) in zip(placed, groups, strict=True):
            for batch in batches:
                state = _collect(state, batch, fan.inside(frame))
        found = parts(state)
        return *map(list, found[:-1]), [found.until]

    *found, until = map_tiles(tile, (fan, placed), TILE)
    start, end, before, number, after = map(jnp.stack, found)
    return Parts(start, end, before, number, after, until[0])


def _collect(state: RayState, batch: Batch, fan: Fan) -> RayState:
    """Add the spans of primitives: shapes that may be seen before the farthest known surface."""
    low, high = batch.rows.extent()
    wider = rounding(largest(fan.apex))

    def near(number: Any, state: RayState) -> Array:
        below, above = row(low, number), row(high, number)
        slack = wider + rounding(jnp.where(jnp.isfinite(below[0]), largest(below) + largest(above), 0))
        below = each(lambda a, o: a - o - slack, below, fan.apex)
        above = each(lambda a, o: a - o + slack, above, fan.apex)
        return jnp.any(fan.meets(below, above, state.bound.max(axis=0)))

    def visit(number: Any, state: RayState) -> RayState:
        def insert() -> RayState:
            return insert_spans(state, find_spans(batch.rows, number, fan), batch.numbers[number])

        return jax.lax.cond(near(number, state), insert, lambda: state)

    return over_rows(batch, fan, lambda state: state.bound.max(axis=0), visit, state)


def _groups(world: World) -> list[tuple[Object | None, list[Batch]]]:
    """Return the shapes of still objects together, then those of each moving object."""
    still: list[tuple[Shape, int]] = []
    groups: list[tuple[Object | None, list[Batch]]] = []
    for item, start in world.numbered():
        if item.motion is None:
            still.extend(item.numbered(start))
        else:
            groups.append((item, _batches(item.numbered(start))))
    return [(None, _batches(still)), *groups]


def _batches(numbered: list[tuple[Shape, int]]) -> list[Batch]:
    made = [_with_tree(shape, start) for shape, start in numbered if shape.tree is not None]
    others = [(shape, start) for shape, start in numbered if shape.tree is None]
    for shape, places in merge_kinds([shape for shape, _ in others]):
        rows = [np.arange(others[k][1], others[k][1] + others[k][0].count, dtype=np.int32) for k in places]
        made.append(Batch(shape, jnp.asarray(np.concatenate(rows))))
    return made


def _with_tree(shape: Any, start: int) -> Batch:
    assert isinstance(shape, Triangles)
    tree = jax.tree.map(lambda a: jnp.asarray(a, jnp.int32), shape.tree)
    ends = [shape.vertices] if shape.close is None else [shape.vertices, shape.close]
    boxes = jnp.stack([boxes_of(vertices[tree.order], tree) for vertices in ends])
    both = jnp.concatenate([boxes[..., :3].min(axis=0), boxes[..., 3:].max(axis=0)], axis=1)
    numbers = jnp.arange(start, start + shape.count, dtype=jnp.int32)
    return Batch(shape.alone(), numbers, tree, both)


def bare(world: World) -> World:
    """Return what the ends of intervals depend on: shapes and motions."""

    def shapes(item: Object) -> Object:
        return Object(tuple(shape.alone() for shape in item.shapes), item.motion, None)

    return World(tuple(shapes(item) for item in world.parts), ())


@jax.custom_jvp
def attach(world: World, fan: Fan, t: Array, left: Array, right: Array) -> Array:
    """Return ends of parts, (2, n), between the primitives ``left`` and ``right``, with their derivatives.

    At an end an edge of one of them crosses the ray, or their distances are equal: a function F(t) of the
    world and the fan is 0. By the implicit function theorem the end moves by ``-dF / F'(t)``.
    """
    return t


@attach.defjvp
def _attach(primals: Any, tangents: Any) -> tuple[Array, Array]:
    world, fan, t, left, right = primals
    sides = jnp.stack([left, right])

    def functions(world: World, fan: Fan, t: Array) -> Array:
        return _functions(world, fan, t, sides)

    values, slopes = jax.jvp(lambda t: functions(world, fan, t), (t,), (jnp.ones_like(t),))
    root = jnp.where(slopes == 0, jnp.inf, abs(values / jnp.where(slopes == 0, 1, slopes)))
    # Surfaces that share an edge meet there, too: the edge is known better.
    root = root.at[-1].multiply(4)
    chosen = jnp.argmin(root, axis=0)[None]
    _, moved = jax.jvp(partial(functions, t=t), (world, fan), tangents[:2])
    moved, slope = (jnp.take_along_axis(a, chosen, axis=0)[0] for a in (moved, slopes))
    inner = (t > 0) & (t < 1) & jnp.isfinite(root.min(axis=0))
    return t, jnp.where(inner, -moved / jnp.where(inner, slope, 1), 0)


def _functions(world: World, fan: Fan, t: Array, sides: Array) -> Array:
    """Return functions of t, one of which is 0 at the ends: (m, 2, n), with ``sides`` (2, 2, n)."""
    shape, number = sides.shape, sides.reshape(-1)
    fan, t = jax.tree.map(lambda a: jnp.broadcast_to(a, shape).reshape(-1), (fan, t))
    fan = fan.inside(frames(world, number, fan.time))
    found = []
    distance, seen = jnp.zeros_like(t), jnp.zeros_like(t, bool)
    for here, of_kind in select_rows(world.batches(), number):
        edges, layers = outline(of_kind, EACH, fan)
        found.extend(jnp.where(here[None], value(edges, t), 0))
        # The first layer is the nearest.
        for layer in reversed(layers):
            squared, den = value(layer.squared, t), value(layer.den, t)
            root = jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1)), 0)
            at = (value(layer.num, t) + layer.side * root) / jnp.where(den == 0, 1, den)
            there = here & layer.present(t)
            distance, seen = jnp.where(there, at, distance), seen | there
    of_edges = jnp.stack(found).reshape(-1, *shape)
    (one, other), (first, second) = distance.reshape(shape), seen.reshape(shape)
    crossing = jnp.where(first & second, one - other, 0)
    return jnp.concatenate([of_edges[:, 0], of_edges[:, 1], crossing[None]])

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
from qmcjax.tracing._intervals.fans import Fan
from qmcjax.tracing._intervals.outlines import KINDS, find_spans, folded, may_hit, outline, value
from qmcjax.tracing._intervals.resolution import resolve
from qmcjax.tracing._shapes.object import Object, Shape, rounding, row
from qmcjax.tracing._shapes.primitives import Box, Plane, Rectangle
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import along, dot, each, largest, length, minus, unit
from qmcjax.tracing._world.world import World, merge_kinds
from qmcjax.tracing.search.intersection import EACH, frames, search, select_rows
from qmcjax.tracing.search.program import boxes_of, map_tiles, tile_size

TILE = 32
"""Fans whose candidates are listed together."""

WIDE_TILE = 256
"""Fans tested together for candidates, and resolved together."""


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

    return _find(world, fan, count, parts, False)


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

    return _find(world, fan, count, parts, True)


def _find(world: World, fan: Fan, count: int, parts: Callable[[RayState], Parts], clear: bool) -> Parts:
    """Return the parts of lines; where one primitive hides all others, without a list of candidates."""
    world, fan = jax.lax.stop_gradient((world, fan))
    groups = _groups(world)
    placed = [None if item is None else item.frame(fan.time) for item, _ in groups]
    direction = fan.direction(jnp.full_like(fan.time, 0.5))
    start, size = along(fan.apex, fan.begin, direction), length(direction)
    _, number = search(world, start, unit(direction), fan.time, fan.limit * size, clear)

    def others(given: Any) -> Array:
        fan, placed, number, bound = given
        some = jnp.zeros_like(number, bool)
        for frame, (_, batches) in zip(placed, groups, strict=True):
            for batch in batches:
                some = _others(some, batch, fan.inside(frame), number, bound)
        return some

    def collected(given: Any) -> RayState:
        fan, placed, bound = given
        state = background(jnp.full_like(bound, -1, jnp.int32), bound, count, zero, zero + 1)
        for frame, (_, batches) in zip(placed, groups, strict=True):
            for batch in batches:
                state = _collect(state, batch, fan.inside(frame))
        return state._replace(opened=(), closed=())

    zero = jnp.zeros((), fan.time.dtype)
    covers, bound = _covering(world, fan, number)
    bound = jnp.where(covers, jnp.minimum(bound, fan.limit), fan.limit)
    some = map_tiles(others, (fan, placed, number, bound), WIDE_TILE)
    known = jnp.where(number < 0, ~some, covers if clear else covers & ~some)
    seen = jnp.where(number < 0, CLEAR, -1) if clear else number
    one = jax.eval_shape(parts, background(number[:1], bound[:1], count, zero, zero)).start
    ends, none = (jnp.full((len(one), number.size), a) for a in (zero, jnp.int32(-1)))
    whole = Parts(
        ends,
        ends.at[0].set(jnp.where(seen == -1, 0, zero + 1)),
        none,
        none.at[0].set(seen),
        none,
        0 * fan.time + 1,
    )
    tile = tile_size(number.size, WIDE_TILE)
    place = jnp.cumsum(~known, dtype=jnp.int32)
    order = listed(jnp.where(known, -1, place - 1), known.size + -known.size % tile)

    def turn(k: Array, found: Parts) -> Parts:
        here = jax.lax.dynamic_slice_in_dim(order, k * tile, tile)
        state = map_tiles(collected, jax.tree.map(lambda a: a[here], (fan, placed, bound)), TILE)
        new = parts(state._replace(opened=zero, closed=zero + 1))
        mine = jnp.where(known[here], number.size, here)
        return jax.tree.map(lambda a, b: a.at[..., mine].set(b, mode="drop"), found, new)

    return jax.lax.fori_loop(0, (place[-1] + tile - 1) // tile, turn, whole)


def listed(place: Array, size: int) -> Array:
    """Return the numbers of what is at the places 0, 1, ... of a list, int32 (size,); -1 is not listed."""
    where = jnp.where(place < 0, size, place)
    return jnp.zeros(size, jnp.int32).at[where].set(jnp.arange(place.size, dtype=jnp.int32), mode="drop")


def _covering(world: World, fan: Fan, number: Array) -> tuple[Array, Array]:
    """Return whether all rays of lines hit primitives, with no edge in sight, and how far at most."""
    fan = fan.inside(frames(world, number, fan.time))
    half = jnp.full_like(fan.time, 0.5)
    covers, bound = jnp.zeros_like(half, bool), jnp.full_like(half, jnp.inf)
    for here, of_kind in select_rows(world.batches(), number):
        edges, layers = outline(of_kind, EACH, fan)
        least, most = folded(jnp.minimum, edges), folded(jnp.maximum, edges)
        one_sign = folded(jnp.logical_and, (least > 0) | (most < 0) | ((least == 0) & (most == 0)))
        for layer in layers:
            sign = jnp.sign(value(layer.den, half))[None]
            den, num = (sign * a for a in (layer.den, layer.num))
            smallest = folded(jnp.minimum, den)
            root = folded(jnp.maximum if layer.side > 0 else jnp.minimum, layer.squared)
            high = folded(jnp.maximum, num) + layer.side * jnp.sqrt(jnp.maximum(root, 0))
            sure = here & one_sign & layer.present(half) & (smallest > 1e-3 * folded(jnp.maximum, den))
            bound = jnp.where(sure, jnp.minimum(bound, high / jnp.where(sure, smallest, 1)), bound)
            covers = covers | sure
    return covers, bound * (1 + 64 * jnp.finfo(half.dtype).eps)


def _others(some: Array, batch: Batch, fan: Fan, number: Array, bound: Array) -> Array:
    """Return whether lines may hit other primitives up to a distance; found so far, or of a batch."""
    near = _tests(batch, fan)

    def visit(row: Any, some: Array) -> Array:
        return some | (near(row, bound) & (batch.numbers[row] != number))

    return over_rows(batch, fan, lambda _: bound, visit, some)


def _collect(state: RayState, batch: Batch, fan: Fan) -> RayState:
    """Add the spans of primitives: shapes that may be seen before the farthest known surface."""
    near = _tests(batch, fan)

    def visit(number: Any, state: RayState) -> RayState:
        def insert() -> RayState:
            return insert_spans(state, find_spans(batch.rows, number, fan), batch.numbers[number])

        return jax.lax.cond(jnp.any(near(number, state.bound.max(axis=0))), insert, lambda: state)

    return over_rows(batch, fan, lambda state: state.bound.max(axis=0), visit, state)


def _tests(batch: Batch, fan: Fan) -> Callable[[Any, Array], Array]:
    """Return a function that says whether lines may hit a primitive up to a distance."""
    wider = rounding(largest(fan.apex))
    if isinstance(batch.rows, Plane):
        planes = batch.rows

        def crosses(number: Any, limit: Array) -> Array:
            normal, point = unit(row(planes.axis, number)), row(planes.point, number)
            height, slack = dot(normal, minus(point, fan.apex)), wider + rounding(largest(point))
            reach = jnp.maximum(*(jnp.sign(height) * dot(normal, d) for d in (fan.first, fan.last)))
            return (fan.begin < 0) | ((reach > 0) & (abs(height) - slack <= limit * reach))

        return crosses
    low, high = batch.rows.extent()

    def meets(number: Any, limit: Array) -> Array:
        below, above = row(low, number), row(high, number)
        slack = wider + rounding(largest(below) + largest(above))
        below = each(lambda a, o: a - o - slack, below, fan.apex)
        above = each(lambda a, o: a - o + slack, above, fan.apex)
        inside = fan.meets(below, above, limit)
        return jax.lax.cond(
            jnp.any(inside), lambda: inside & may_hit(batch.rows, number, fan), lambda: inside
        )

    return meets


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
def attach(world: World, fan: Fan, t: Array, left: Array, right: Array, across: Fan | None) -> Array:
    """Return ends of parts, (2, n), between the primitives ``left`` and ``right``, with their derivatives.

    At an end an edge of one of them crosses the ray, or their distances are equal: a function F(t) of the
    world and the fan is 0. By the implicit function theorem the end moves by ``-dF / F'(t)``. This is large
    where the edge is almost parallel to the line. If half of the lines are at right angles to others, and
    the fan changes by ``across`` to the side, derivatives of both are weighted by twice the squares of the
    slopes of F along the line and across, divided by their sum: weights add up to 2 at each point of an
    edge, and derivatives are bounded.
    """
    return t


@attach.defjvp
def _attach(primals: Any, tangents: Any) -> tuple[Array, Array]:
    world, fan, t, left, right, across = primals
    sides = jnp.stack([left, right])

    def functions(world: World, fan: Fan, t: Array) -> Array:
        return _functions(world, fan, t, sides)

    values, slopes = jax.jvp(lambda t: functions(world, fan, t), (t,), (jnp.ones_like(t),))
    root = jnp.where(slopes == 0, jnp.inf, abs(values / jnp.where(slopes == 0, 1, slopes)))
    # Surfaces that share an edge meet there, too: the edge is known better.
    root = root.at[-1].multiply(4)
    chosen = jnp.argmin(root, axis=0)[None]

    def of_chosen(a: Array) -> Array:
        return jnp.take_along_axis(a, chosen, axis=0)[0]

    _, moved = jax.jvp(partial(functions, t=t), (world, fan), tangents[:2])
    inner = (t > 0) & (t < 1) & jnp.isfinite(root.min(axis=0))
    moved, slope = of_chosen(moved), jnp.where(inner, of_chosen(slopes), 1)
    if across is not None:
        _, beside = jax.jvp(lambda fan: functions(world, fan, t), (fan,), (across,))
        side = of_chosen(beside)
        size = jnp.maximum(abs(slope), abs(side))
        slope, side = slope / size, side / size
        return t, jnp.where(inner, -2 * slope / (slope * slope + side * side) * moved / size, 0)
    return t, jnp.where(inner, -moved / slope, 0)


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

"""What the rays of fans see, exactly: intervals of t; and where all of them see the same."""

from collections.abc import Callable
from functools import reduce
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.tracing._intervals.candidates import Batch, RayState, background, insert_spans, over_rows
from qmcjax.tracing._intervals.ends import Parts, listed
from qmcjax.tracing._intervals.fans import Fan
from qmcjax.tracing._intervals.outlines import KINDS, find_spans, may_hit, outline, value
from qmcjax.tracing._intervals.resolution import resolve
from qmcjax.tracing._shapes.object import Frame, Object, Shape, rounding, row
from qmcjax.tracing._shapes.primitives import Box, Plane, Rectangle
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import Vector, dot, each, largest, length, minus, unit
from qmcjax.tracing._world.world import World, merge_kinds
from qmcjax.tracing.search.intersection import EACH, frames, search, select_rows
from qmcjax.tracing.search.program import boxes_of, map_tiles

NARROW_TILE = 64
"""Fans whose candidates are listed together."""

WIDE_TILE = 1024
"""Fans tested together for what covers them."""


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
    groups, zero = _groups(world), jnp.zeros((), fan.time.dtype)

    def found(given: Any) -> Parts:
        fan, placed = given
        none = jnp.full(fan.time.shape, -1, jnp.int32)
        state = background(none, fan.limit, count, zero, zero + 1)
        for frame, (_, batches) in zip(placed, groups, strict=True):
            for batch in batches:
                state = _collect(state, batch, fan.inside(frame))
        return parts(state)

    return map_tiles(found, (fan, _placed(groups, fan)), NARROW_TILE)


def find_known(world: World, fan: Fan, clear: bool) -> tuple[Array, Array]:
    """Return whether all rays see the same, and its number: a primitive, or -1 for nothing, without edges.

    With ``clear``, whether nothing is in the way of any ray, CLEAR, or a primitive in that of all, -1.
    """
    world, fan = jax.lax.stop_gradient((world, fan))
    groups = _groups(world)
    direction = fan.direction(jnp.full_like(fan.time, 0.5))
    size = length(direction)
    _, number = search(world, fan.start(direction), unit(direction), fan.time, fan.limit * size, clear)
    covers, bound = _covering(world, fan, number)
    bound = jnp.where(covers, jnp.minimum(bound, fan.limit), fan.limit)

    def others(given: Any) -> Array:
        fan, placed, number, bound = given
        some = jnp.zeros_like(number, bool)
        for frame, (_, batches) in zip(placed, groups, strict=True):
            for batch in batches:
                some = _others(some, batch, fan.inside(frame), number, bound)
        return some

    some = map_tiles(others, (fan, _placed(groups, fan), number, bound), WIDE_TILE)
    known = jnp.where(number < 0, ~some, covers if clear else covers & ~some)
    return known, jnp.where(number < 0, CLEAR, -1) if clear else number


def joined(found: Parts, here: Array, number: Array) -> Parts:
    """Return parts of lines, some of which see one primitive from end to end, or nothing."""
    first = jnp.arange(len(found.start), dtype=jnp.int32)[:, None] == 0
    none, number = jnp.full_like(found.number, -1), number[None]
    end = (first & (number != -1)).astype(found.end.dtype)
    numbers = jnp.where(first, number, none)
    one = Parts(jnp.zeros_like(found.start), end, none, numbers, none, jnp.ones_like(found.until))
    return jax.tree.map(lambda a, b: jnp.where(here if a.ndim == 1 else here[None], a, b), one, found)


def _placed(groups: list[tuple[Object | None, list[Batch]]], fan: Fan) -> list[Frame | None]:
    return [None if item is None else item.frame(fan.time) for item, _ in groups]


def _covering(world: World, fan: Fan, number: Array) -> tuple[Array, Array]:
    """Return whether all rays hit primitives, with no edge in sight, and how far at most."""
    fan = fan.inside(frames(world, number, fan.time))
    half = jnp.full_like(fan.time, 0.5)
    covers, bound = jnp.zeros_like(half, bool), jnp.full_like(half, jnp.inf)
    for here, of_kind in select_rows(world.batches(), number):
        edges, layers = outline(of_kind, EACH, fan)
        for edge in edges:
            least, most = reduce(jnp.minimum, edge), reduce(jnp.maximum, edge)
            here = here & ((least > 0) | (most < 0) | ((least == 0) & (most == 0)))
        for layer in layers:
            sign = jnp.sign(value(layer.den, half))
            den, num = ([sign * a for a in part] for part in (layer.den, layer.num))
            smallest = reduce(jnp.minimum, den)
            root = reduce(jnp.maximum if layer.side > 0 else jnp.minimum, layer.squared)
            high = reduce(jnp.maximum, num) + layer.side * jnp.sqrt(jnp.maximum(root, 0))
            sure = here & layer.present(half) & (smallest > 1e-3 * reduce(jnp.maximum, den))
            bound = jnp.where(sure, jnp.minimum(bound, high / jnp.where(sure, smallest, 1)), bound)
            covers = covers | sure
    return covers, bound * (1 + 64 * jnp.finfo(half.dtype).eps)


def _others(some: Array, batch: Batch, fan: Fan, number: Array, bound: Array) -> Array:
    """Return whether lines may hit other primitives up to a distance; found so far, or of a batch."""
    near = _tests(batch, fan)

    def visit(row: Any, some: Array) -> Array:
        return some | (near(row, bound) & (batch.numbers[row] != number))

    return _over_rows(batch, fan, lambda _: bound, visit, some)


def _collect(state: RayState, batch: Batch, fan: Fan) -> RayState:
    """Add the spans of primitives: shapes that may be seen before the farthest known surface."""
    near = _tests(batch, fan)

    def visit(number: Any, state: RayState) -> RayState:
        def insert() -> RayState:
            return insert_spans(state, *find_spans(batch.rows, number, fan), batch.numbers[number])

        return jax.lax.cond(jnp.any(near(number, state.bound.max(axis=0))), insert, lambda: state)

    return _over_rows(batch, fan, lambda state: state.bound.max(axis=0), visit, state)


FEW = 8
"""Primitives that are not worth a list of those near the fans of a tile."""

BOXES = 2**16
"""Of primitives and fans, at most, tested at once for a list: memory does not grow with the world."""


def _over_rows(batch: Batch, fan: Fan, limit: Callable[[Any], Array], visit: Any, state: Any) -> Any:
    """Visit the rows of a batch, those of a tree or a list only where a ray may hit their boxes."""
    rows, total = batch.rows, batch.numbers.shape[0]
    alone = total <= FEW or total * fan.time.size > BOXES
    if batch.tree is not None or isinstance(rows, Plane) or alone:
        return over_rows(batch, fan, limit, visit, state)
    each_fan = jax.tree.map(lambda a: a[None], fan)
    all_rows = jnp.arange(total, dtype=jnp.int32)[:, None]
    meets = each_fan.meets(*_relative(rows.extent(), all_rows, each_fan), limit(state)[None]).any(axis=1)
    place = jnp.cumsum(meets, dtype=jnp.int32)
    order = listed(jnp.where(meets, place - 1, -1), total)
    return jax.lax.fori_loop(0, place[-1], lambda k, state: visit(order[k], state), state)


def _relative(boxes: tuple[Array, Array], number: Any, fan: Fan) -> tuple[Vector, Vector]:
    """Return the lower and upper corners of boxes, relative to the apex."""
    below, above = (row(side, number) for side in boxes)
    slack = rounding(largest(fan.apex)) + rounding(largest(below) + largest(above))
    low = each(lambda a, o: a - o - slack, below, fan.apex)
    return low, each(lambda a, o: a - o + slack, above, fan.apex)


def _tests(batch: Batch, fan: Fan) -> Callable[[Any, Array], Array]:
    """Return a function that says whether lines may hit a primitive up to a distance."""
    if isinstance(batch.rows, Plane):
        planes = batch.rows

        def crosses(number: Any, limit: Array) -> Array:
            normal, point = unit(row(planes.axis, number)), row(planes.point, number)
            height = dot(normal, minus(point, fan.apex))
            slack = rounding(largest(fan.apex)) + rounding(largest(point))
            slopes = [dot(normal, d) for d in fan.ends]
            heights = [height - fan.begin * slope for slope in slopes]
            side = jnp.sign(heights[0])
            least = reduce(jnp.minimum, [side * a for a in heights])
            reach = reduce(jnp.maximum, [side * slope for slope in slopes])
            crossed = (fan.begin < 0) & (least <= slack)
            crossed = crossed | ((reach > 0) & (least - slack <= limit * reach))
            return crossed if fan.plane is None else crossed & may_hit(planes, number, fan)

        return crosses
    boxes = batch.rows.extent()

    def meets(number: Any, limit: Array) -> Array:
        inside = fan.meets(*_relative(boxes, number, fan), limit)
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

"""Candidates for visibility: a short list of spans per ray, culled by the distance of sight.

In a slot of the shutter that a span covers, nothing beyond the span is visible, and the search ends at the
farthest slot. This is the early-out culling of the thesis (Sect. 3.2.1), but does not need a single span that
covers the whole shutter.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.spans import Depth, Spans
from qmcjax.tracing._shapes.object import rounding
from qmcjax.tracing._shapes.triangles import Tree
from qmcjax.tracing._shapes.vectors import components, each, largest

_SLOTS = 8


class Batch(NamedTuple):
    """Primitives of one kind: linearly moving ones, one linear segment per row, or those seen by a fan."""

    rows: Any
    """`Polygons`, `Balls`, or a shape."""
    numbers: Array
    """int32 (rows,): of the primitives in the world."""
    tree: Tree | None = None
    """Of the rows of one segment: the other segments repeat this order."""
    boxes: Array | None = None
    """(nodes, 6): low and high, of all times."""


class Candidates(NamedTuple):
    """Spans of rays, (c, n), in no order."""

    start: Array
    """2 where there is no span."""
    end: Array
    number: Array
    depth: Depth


class RayState(NamedTuple):
    """The candidates of rays, and their distance of sight."""

    candidates: Candidates
    until: Array
    """(n,): spans that start earlier are among the candidates, or hidden."""
    bound: Array
    """(slots, n): how far rays can see in each part of the shutter."""
    opened: Array
    """The shutter."""
    closed: Array


def background(number: Array, distance: Array, count: int, opened: Array, closed: Array) -> RayState:
    """Return rays with their hits in the still part of the world: numbers, -1 for nothing, and distances.

    Without a hit, a distance is how far rays see.
    """
    hit = number >= 0

    def first(value: Array, others: Any) -> Array:
        rest = jnp.full((count - 1, *number.shape), others, value.dtype)
        return jnp.concatenate([value[None], rest])

    zero, one = jnp.zeros_like(distance), jnp.ones_like(distance)
    far = jnp.where(hit, distance, one)
    depth = Depth(
        jnp.stack([first(far, 1)] * 4),
        jnp.ones((3, count, *zero.shape), zero.dtype),
        jnp.zeros((3, count, *zero.shape), zero.dtype),
        *(first(value, 1) for value in (one, zero, far, far, far)),
    )
    candidates = Candidates(first(jnp.where(hit, zero, 2), 2), first(one, 2), first(number, -1), depth)
    bound = jnp.broadcast_to(distance[None], (_SLOTS, *zero.shape))
    return RayState(candidates, one, bound, opened, closed)


def collect(state: RayState, batch: Batch, view: Any) -> RayState:
    """Add the spans of a batch of primitives.

    Rows that any ray of the tile may hit are listed first, then their spans are computed.
    """
    rows = batch.rows
    order, listed = _list_rows(state, batch, view)

    def turn(place: Any, state: RayState) -> RayState:
        spans = rows.spans(order[place], view)
        number = batch.numbers[order[place]]
        return insert_spans(state, spans.start < spans.end, partial(at_places, spans), number)

    return jax.lax.fori_loop(0, listed, turn, state)


def _list_rows(state: RayState, batch: Batch, view: Any) -> tuple[Array, Array]:
    """Return the rows that any ray of the tile may hit, and their number."""
    rows, limit = batch.rows, state.bound.max(axis=0)
    total = batch.numbers.shape[0]

    def may_be_hit(row: Any) -> Array:
        def any_ray() -> Array:
            seen, hit = rows.seen(row, view)
            return jnp.any(hit & (rows.nearest(seen) <= limit))

        begin, finish = rows.begin[row], rows.finish[row]
        on = (begin < finish) & (begin <= state.closed) & (finish >= state.opened)
        return jax.lax.cond(on, any_ray, lambda: jnp.asarray(False))

    def tested(row: Any, found: tuple[Array, Array]) -> tuple[Array, Array]:
        order, listed = found
        # A row that is not listed is overwritten by the next one; the last place takes rows not listed.
        return order.at[listed].set(row), listed + may_be_hit(row).astype(jnp.int32)

    none = jnp.zeros(total + 1, jnp.int32), jnp.zeros((), jnp.int32)
    return over_rows(batch, view, lambda _: limit, tested, none)


def over_rows(
    batch: Batch, view: Any, limit: Callable[[Any], Array], visit: Callable[[Any, Any], Any], state: Any
) -> Any:
    """Visit the rows of a batch, those of a tree only where a ray may hit before its limit by the state."""
    total = batch.numbers.shape[0]
    if batch.tree is None or batch.boxes is None:
        return jax.lax.fori_loop(0, total, lambda row, state: visit(jnp.int32(row), state), state)
    tree, boxes = batch.tree, batch.boxes
    count = tree.order.shape[0]
    used, stop = tree.skip[0], tree.start[jnp.minimum(tree.skip, count - 1)]
    wider = rounding(abs(boxes).max() + largest(view.origin))

    def inside(node: Array, state: Any) -> Array:
        low, high = components(boxes[node, :3]), components(boxes[node, 3:])
        below = each(lambda a, o: a - o - wider, low, view.origin)
        above = each(lambda a, o: a - o + wider, high, view.origin)
        return jnp.any(view.meets(below, above, limit(state)))

    def step(walk: tuple[Array, Any]) -> tuple[Array, Any]:
        node, state = walk
        skip = tree.skip[node]
        enters = inside(node, state)
        leaf = enters & (skip == node + 1)

        def of_leaf(place: Any, state: Any) -> Any:
            return jax.lax.fori_loop(
                0,
                total // count,
                lambda segment, state: visit(segment * count + tree.order[place], state),
                state,
            )

        state = jax.lax.fori_loop(
            tree.start[node], jnp.where(leaf, stop[node], tree.start[node]), of_leaf, state
        )
        return jnp.where(enters, node + 1, skip), state

    return jax.lax.while_loop(lambda walk: walk[0] < used, step, (jnp.zeros((), jnp.int32), state))[1]


def insert_spans(state: RayState, some: Array, spans_at: Callable[[Array], Spans], number: Array) -> RayState:
    """Insert the spans of one primitive that there are, (s, n): the first of all rays, then the second, ...

    ``spans_at`` makes one of each ray, (n,), from their places, (n,).
    """
    rank = jnp.cumsum(some, axis=0, dtype=jnp.int32)

    def turn(k: Array, state: RayState) -> RayState:
        one = spans_at(jnp.argmax(some & (rank == k + 1), axis=0))
        return _insert(state, one._replace(end=jnp.where(k < rank[-1], one.end, one.start)), number)

    return jax.lax.fori_loop(0, rank[-1].max(), turn, state)


def at_places(values: Any, place: Array) -> Any:
    """Return one of the values of each ray, (..., s, n)."""

    def of_place(a: Array) -> Array:
        mine = place.reshape((1,) * (a.ndim - 1) + place.shape)
        return jnp.take_along_axis(a, mine, axis=-2)[..., 0, :]

    return jax.tree.map(of_place, values)


def _insert(state: RayState, span: Spans, number: Array) -> RayState:
    """Insert spans, one per ray, in place of an empty one, a hidden one, or the last to start.

    If there is no room, the span that starts last is dropped: up to its start everything is known.
    """
    (start, end, depth), candidates = span, state.candidates
    limit = state.bound.max(axis=0)
    wanted = (start < end) & (depth.high > 0) & (depth.low <= limit)
    wanted = wanted & (start <= state.closed) & (end >= state.opened)
    key = jnp.where(candidates.depth.low > limit[None], 2, candidates.start)
    place, latest = jnp.argmax(key, axis=0).astype(jnp.int32), jnp.max(key, axis=0)
    taken = wanted & (start < latest)
    left_out = jnp.where(taken, latest, jnp.where(wanted, start, 2))
    until = jnp.minimum(state.until, left_out)
    here = (jnp.arange(key.shape[0], dtype=jnp.int32)[:, None] == place[None]) & taken[None]

    def put(new: Array, old: Array) -> Array:
        shape = (1,) * (old.ndim - 2) + here.shape
        return jnp.where(here.reshape(shape), jnp.expand_dims(new, new.ndim - 1), old)

    new = Candidates(start, end, jnp.broadcast_to(number, start.shape), depth)
    edges = state.opened + (state.closed - state.opened) * jnp.linspace(0, 1, _SLOTS + 1, dtype=start.dtype)
    covered = (start[None] <= edges[:-1, None]) & (end[None] >= edges[1:, None]) & (start < end)[None]
    covered = covered & (depth.low > 0)[None]
    bound = jnp.minimum(state.bound, jnp.where(covered, depth.high[None], jnp.inf))
    return state._replace(candidates=jax.tree.map(put, new, candidates), until=until, bound=bound)

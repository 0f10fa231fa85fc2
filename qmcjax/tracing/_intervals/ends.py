"""The ends of parts of lines, which move with everything they depend on."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.fans import Fan
from qmcjax.tracing._intervals.outlines import outline, value
from qmcjax.tracing._shapes.object import Object
from qmcjax.tracing._world.world import World
from qmcjax.tracing.search.intersection import EACH, frames, select_rows
from qmcjax.tracing.search.program import tile_size

TILE = 512
"""Ends of parts that move together."""


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


def listed(place: Array, size: int) -> Array:
    """Return the numbers of what is at the places 0, 1, ... of a list, int32 (size,); -1 is not listed."""
    where = jnp.where(place < 0, size, place)
    return jnp.zeros(size, jnp.int32).at[where].set(jnp.arange(place.size, dtype=jnp.int32), mode="drop")


saving = partial(jax.checkpoint, prevent_cse=False)
"""For a turn of a loop: reverse mode keeps none of its values, but repeats it."""


def map_listed(function: Callable[[Array], Any], wanted: Array, nothing: Any) -> Any:
    """Apply a function to the numbers of what is wanted, (m,), a tile at a time.

    Results are in the places of ``wanted``; they are 0 elsewhere, and for a tile of nothing ``nothing``.
    """
    size = jax.tree.leaves(nothing)[0].size
    place = jnp.cumsum(wanted, dtype=jnp.int32) - 1
    order = listed(jnp.where(wanted, place, -1), wanted.size + -wanted.size % size).reshape(-1, size)

    @saving
    def turn(first: Array, numbers: Array) -> tuple[Array, Any]:
        return first + size, jax.lax.cond(first <= place[-1], lambda: function(numbers), lambda: nothing)

    found = jax.lax.scan(turn, jnp.int32(0), order)[1]
    return jax.tree.map(lambda a: jnp.where(wanted, a.reshape(-1)[place], 0), found)


def bare(world: World) -> World:
    """Return what the ends of intervals depend on: shapes and motions."""

    def shapes(item: Object) -> Object:
        return Object(tuple(shape.alone() for shape in item.shapes), item.motion, None)

    return World(tuple(shapes(item) for item in world.parts), ())


@jax.custom_jvp
def attach(world: World, fan: Fan, found: Parts, across: Fan | None) -> Parts:
    """Return parts whose ends have derivatives.

    At an end an edge of one of the primitives on both sides crosses the ray, or their distances are equal: a
    function F(t) of the world and the fan is 0. By the implicit function theorem the end moves by
    ``-dF / F'(t)``. This is large where the edge is almost parallel to the line. If half of the lines are at
    right angles to others, and the fan changes by ``across`` to the side, derivatives of both are weighted by
    twice the squares of the slopes of F along the line and across, divided by their sum: weights add up to 2
    at each point of an edge, and derivatives are bounded.
    """
    return found


@attach.defjvp
def _attach(primals: Any, tangents: Any) -> tuple[Parts, Parts]:
    world, fan, found, across = primals
    used = found.number != -1
    # Most parts end where the next one starts.
    shared = used[1:] & (found.start[1:] == found.end[:-1]) & (found.before[1:] == found.number[:-1])
    shared = jnp.concatenate([shared, jnp.zeros_like(used[:1])])
    starts, ends = found.start > 0, ~shared & (found.end < found.until[None])
    wanted = jnp.concatenate([used & starts, used & ends]).reshape(-1)
    lines = fan.time.size
    sides = [[found.start, found.before, found.number], [found.end, found.number, found.after]]
    t, left, right = (jnp.concatenate(pair).reshape(-1) for pair in zip(*sides, strict=True))

    def tile(of: Array) -> Array:
        mine, my_across, move = jax.tree.map(lambda a: a[of % lines], (fan, across, tangents[1]))
        return _motion(world, mine, t[of], jnp.stack([left[of], right[of]]), my_across, (tangents[0], move))

    moved = map_listed(tile, wanted, jnp.zeros(tile_size(lines, TILE), t.dtype))
    start, end = moved.reshape(2, *used.shape)
    after = jnp.concatenate([start[1:], jnp.zeros_like(start[:1])])
    return found, tangents[2]._replace(start=start, end=jnp.where(shared, after, end))


def _motion(world: World, fan: Fan, t: Array, sides: Array, across: Fan | None, tangents: Any) -> Array:
    """Return how ends of lines between primitives, (2, n), move with the world and the lines."""

    def functions(world: World, fan: Fan, t: Array) -> Array:
        return _functions(world, fan, t, sides)

    values, slopes = jax.jvp(lambda t: functions(world, fan, t), (t,), (jnp.ones_like(t),))
    root = jnp.where(slopes == 0, jnp.inf, abs(values / jnp.where(slopes == 0, 1, slopes)))
    # Surfaces that share an edge meet there, too: the edge is known better.
    root = root.at[-1].multiply(4)
    chosen = jnp.argmin(root, axis=0)[None]

    def of_chosen(a: Array) -> Array:
        return jnp.take_along_axis(a, chosen, axis=0)[0]

    _, moved = jax.jvp(partial(functions, t=t), (world, fan), tangents)
    inner = jnp.isfinite(root.min(axis=0))
    moved, slope = of_chosen(moved), jnp.where(inner, of_chosen(slopes), 1)
    if across is not None:
        _, beside = jax.jvp(lambda fan: functions(world, fan, t), (fan,), (across,))
        side = of_chosen(beside)
        size = jnp.maximum(abs(slope), abs(side))
        slope, side = slope / size, side / size
        return jnp.where(inner, -2 * slope / (slope * slope + side * side) * moved / size, 0)
    return jnp.where(inner, -moved / slope, 0)


def _functions(world: World, fan: Fan, t: Array, sides: Array) -> Array:
    """Return functions of t, (m, n), one of which is 0 at the ends between primitives, (2, n)."""
    shape, number = sides.shape, sides.reshape(-1)
    fan, t = jax.tree.map(lambda a: jnp.broadcast_to(a, shape).reshape(-1), (fan, t))
    fan = fan.inside(frames(world, number, fan.time))
    found = []
    distance, seen = jnp.zeros_like(t), jnp.zeros_like(t, bool)
    for here, of_kind in select_rows(world.batches(), number):
        edges, layers = outline(of_kind, EACH, fan)
        found.extend(jnp.where(here, value(edge, t), 0) for edge in edges)
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

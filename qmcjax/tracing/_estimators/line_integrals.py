"""Integrals over lines: visibility is exact, and values are sampled once in each interval.

An interval adds its length times the value at one of its points, uniform in it. Its ends move with what they
depend on: the derivative of the sum is an unbiased estimate of the derivative of the mean, with edges. Where
all lines side by side see the same, one point of them is enough.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.ends import Parts, attach, bare, listed, map_listed, saving
from qmcjax.tracing._intervals.fans import Fan
from qmcjax.tracing._intervals.lines import find_clear, find_known, joined
from qmcjax.tracing._shapes.vectors import Vector, each, keep, where
from qmcjax.tracing._world.world import World
from qmcjax.tracing.search.intersection import UNKNOWN
from qmcjax.tracing.search.program import tile_size

TILE, MOST = 512, 2**16
"""Lines, and parts of them, that are found and shaded together, and how many on devices without tiles."""

Shade = Callable[["Line", Array, Array, Array, Array], Vector]
"""From lines, starts and ends of parts, numbers of primitives and whether they are wanted, to integrals of
values over parts."""


class Line(NamedTuple):
    """A line: its fan, and where on its parts they are shaded."""

    fan: Fan
    offset: Array
    across: Fan | None
    """How the fan changes as the line moves to its side by its length; None if all lines are parallel."""
    given: Any
    """More for a `Shade`."""


class Lines(NamedTuple):
    """The lines of samples: ``parallel`` equidistant ones in each direction."""

    names: tuple[str, str]
    chosen: tuple[str, ...]
    parallel: int

    @property
    def both(self) -> bool:
        """Return whether lines have both directions."""
        return set(self.names) <= set(self.chosen)

    @property
    def number(self) -> int:
        """Return the number of lines of a sample."""
        return self.parallel * (2 if self.both else 1)

    def place(self, u: Array, v: Array, k: Array) -> tuple[Array, Array, Array]:
        """Return which lines are along v, their other coordinate, and where parts are shaded.

        The other coordinates of a sample's lines are its own, shrunk to each of ``parallel`` intervals: if
        samples are stratified, so are all their lines together. Line -1 has the coordinates of the sample.
        """
        along_v = jnp.broadcast_to(k % 2 == 1 if self.both else self.names[1] in self.chosen, u.shape)
        aside, offset = jnp.where(along_v, u, v), jnp.where(along_v, v, u)
        strip = (k // 2 if self.both else k).astype(u.dtype)
        return along_v, jnp.where(k < 0, aside, (strip + aside) / self.parallel), offset

    def line(self, fan: Callable[[Array], Fan], offset: Array, given: Any) -> Line:
        """Return lines from their fans as they move to their side by some of their lengths."""
        still = jnp.zeros_like(offset)
        if not self.both:
            return Line(fan(still), offset, None, given)
        here, across = jax.jvp(fan, (still,), (still + 1,))
        return Line(here, offset, across, given)


def placed(along_v: Array, t: Any, aside: Array) -> tuple[Array, Array]:
    """Return the two coordinates of points t of lines."""
    return jnp.where(along_v, aside, t), jnp.where(along_v, t, aside)


def integrate(
    world: World,
    all_rays: Fan,
    given: Any,
    count: int,
    lines: Callable[[Any, Array], Line],
    find: partial[Parts],
    shade: Shade,
    apart: Shade | None,
    again: Callable[[Array, Array], Array] | None = None,
) -> tuple[Vector, Array]:
    """Return the means of samples over their lines, and the share of them in which nothing is seen.

    ``lines`` takes what is given for samples, and makes the k-th of ``count`` lines of each. Where all rays
    see the same, one line is enough, that of the sample's own coordinates. It is shaded by ``apart``, which
    is faster, or without that with the parts of other lines. ``again`` takes which samples are known, and the
    primitives that they see, and returns which stay so.
    """
    samples = all_rays.time.size
    if samples * count >= 2**31:  # Positions in the list of lines are int32.
        raise ValueError(f"points of {count} lines each must be fewer than {2**31 // count}, got {samples}")
    known, number = find_known(world, all_rays, find.func is find_clear)
    if again is not None:
        known = again(known, number)
    whole = known & (apart is None)
    place, after = (jnp.cumsum(here, dtype=jnp.int32) for here in (~known, whole))
    others = count * place[-1]
    total = others + after[-1]
    order, rest = (
        listed(jnp.where(here, place - 1, -1), samples) for here, place in ((~known, place), (whole, after))
    )
    size = min(tile_size(samples * count, TILE), MOST)
    line = jax.tree.map(lambda a: jax.ShapeDtypeStruct((size,), a.dtype), all_rays._replace(beside=()))
    nothing = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), jax.eval_shape(find, world, line))

    def chunk(position: Array) -> tuple[Vector, Array]:
        alone = position >= others
        mine = jnp.where(
            alone, rest[(position - others) % samples], order[jnp.minimum(position // count, samples - 1)]
        )
        line = lines(jax.tree.map(lambda a: a[mine], given), jnp.where(alone, -1, position % count))
        found = jax.lax.cond(position[0] < others, lambda: find(world, line.fan), lambda: nothing)
        return integrate_parts(world, line, joined(found, alone, number[mine]), shade)

    @saving
    def turn(first: Array, _: None) -> tuple[Array, tuple[Vector, Array]]:
        zero = jnp.zeros(size, all_rays.time.dtype)
        none = (zero, zero, zero), zero
        position = first + jnp.arange(size, dtype=jnp.int32)
        return first + size, jax.lax.cond(first < total, lambda: chunk(position), lambda: none)

    _, found = jax.lax.scan(turn, jnp.int32(0), None, -(-samples * count // size))

    def of_samples(a: Array) -> Array:
        """Return means of the results of lines, shape (chunks, size)."""
        flat = a.reshape(-1)
        means = flat[: samples * count].reshape(samples, count).mean(axis=1)
        return jnp.where(known, flat[others + after - 1], means[place - 1])

    value, empty = jax.tree.map(of_samples, found)
    if apart is not None:
        first = lines(given, jnp.full_like(number, -1))
        lit, zero = known & (number != -1), jnp.zeros_like(first.offset)
        alone = apart(first, zero, zero + 1, number, lit)
        value = where(known, keep(lit, alone), value)
        empty = jnp.where(known, (number == -1).astype(empty.dtype), empty)
    return value, empty


def integrate_parts(
    world: World, line: Line, found: Parts, shade: Shade, within: tuple[Array, Array] | None = None
) -> tuple[Vector, Array]:
    """Return the integrals of values over the parts of lines, and the length in which nothing is seen.

    Where parts do not fit, the rest of a line is one more part, in which visibility is sampled. Most lines
    have few parts: the parts in use are listed, and shaded a tile at a time.
    """
    start, end, _, number, _, until = attach(bare(world), line.fan, found, line.across)
    low, high = within or (jnp.zeros_like(until), jnp.ones_like(until))
    if within is not None:
        start, end = jnp.maximum(start, low[None]), jnp.minimum(end, high[None])
    rest = jnp.where(until < 1, UNKNOWN, -1).astype(jnp.int32)
    last = jnp.maximum(until, low), high, rest
    flat = tuple(jnp.concatenate([*a, end]) for a, end in zip((start, end, number), last, strict=True))
    used, lines = flat[2] != -1, line.offset.shape[0]

    def tile(parts: Array) -> tuple[Vector, Array]:
        start, end, number = (a[parts] for a in flat)
        mine = jax.tree.map(lambda a: a[parts % lines], line)
        length = jnp.where(number == -1, 0, end - start)
        lit = length > 0
        return keep(lit, shade(mine, start, end, number, lit)), length

    zero = jnp.zeros(tile_size(lines, TILE), line.offset.dtype)
    value, length = map_listed(tile, used, ((zero, zero, zero), zero))

    def of_lines(a: Array) -> Array:
        return a.reshape(-1, lines).sum(axis=0)

    return each(of_lines, value), high - low - of_lines(length)

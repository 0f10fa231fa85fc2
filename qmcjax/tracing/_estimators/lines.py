"""Radiance along lines: visibility is exact, and shading is sampled once in each interval.

An interval adds its length times the radiance at one of its points, uniform in it. Its ends move with what
they depend on: the derivative of the sum is an unbiased estimate of the derivative of the mean, with edges.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.fans import Fan, eye, lens_fan
from qmcjax.tracing._intervals.lines import (
    Parts,
    attach,
    bare,
    find_clear,
    find_visible,
    listed,
    opened,
)
from qmcjax.tracing._light.interaction import (
    Choice,
    SurfaceInteraction,
    by_kind,
    reach,
    sample_light,
    visible,
)
from qmcjax.tracing._light.scattering import evaluate, reflect_lights
from qmcjax.tracing._shapes.vectors import (
    Vector,
    along,
    components,
    each,
    keep,
    length,
    minus,
    plus,
    unit,
    where,
)
from qmcjax.tracing._world.lights import Environment, RectangleLight, Sample
from qmcjax.tracing._world.world import Sight, World
from qmcjax.tracing.search.intersection import UNKNOWN
from qmcjax.tracing.search.program import tile_size

SCREEN, LENS, LIGHT = ("x", "y"), ("lens_u", "lens_v"), ("light_u", "light_v")
"""Coordinates that lines may be along."""

TILE = 1024
"""Parts that are shaded together."""

Shade = Callable[[Any, Array, Array, Array], Vector]
"""From other arguments of lines, t, numbers of primitives and whether they are wanted, to values."""

Gain = Callable[[Sample, Vector, Array], Vector]
"""See :func:`reflect_lights`; without arrays of its own, which would not be in tiles."""


class Line(NamedTuple):
    """A line in one of two directions, or in either: a fan, and where on its parts they are shaded."""

    fan: Fan
    offset: Array
    across: Fan | None
    """How the fan changes as the line moves to its side by its length; None if all lines are parallel."""


def turned(names: tuple[str, str], lines: tuple[str, ...], u: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return which lines are along the second coordinate, their other coordinate, and where parts are shaded.

    Of both kinds, u chooses one: along the line it is not needed.
    """
    if set(names) <= set(lines):
        second = u >= 0.5
        return second, v, 2 * u - second.astype(u.dtype)
    along_v = names[1] in lines
    return jnp.full_like(u, along_v, bool), *((u, v) if along_v else (v, u))


def _placed(along_v: Array, t: Any, aside: Array) -> tuple[Array, Array]:
    """Return the two coordinates of points t of lines."""
    return jnp.where(along_v, aside, t), jnp.where(along_v, t, aside)


def line_of(fan: Callable[[Array], Fan], offset: Array, both: bool) -> Line:
    """Return lines from their fans as they move to their side by some of their lengths."""
    still = jnp.zeros_like(offset)
    if not both:
        return Line(fan(still), offset, None)
    here, across = jax.jvp(fan, (still,), (still + 1,))
    return Line(here, offset, across)


def integrate_parts(world: World, line: Line, found: Parts, given: Any, shade: Shade) -> tuple[Vector, Array]:
    """Return the integrals of values over the parts of lines, and the length in which nothing is seen.

    Where parts do not fit, the rest of a line is one more part, in which visibility is sampled. Most lines
    have one part: the parts in use are listed, and shaded a tile at a time.
    """
    shapes = bare(world)
    *slots, until = found
    rest = jnp.where(until < 1, UNKNOWN, -1).astype(jnp.int32)
    last = until, jnp.ones_like(until), rest, rest, rest
    flat = tuple(jnp.concatenate([*a, end]) for a, end in zip(slots, last, strict=True))
    used, lines = flat[3] != -1, line.offset.shape[0]
    # Parts whose ends move are listed first, by lines; of the others, at most one is of a line.
    whole = (used & (flat[0] == 0) & (flat[1] == 1)).reshape(-1, lines)
    moves = used.reshape(-1, lines) & ~whole
    of_line = jnp.cumsum(moves, axis=0, dtype=jnp.int32)
    first = jnp.cumsum(of_line[-1], dtype=jnp.int32)
    second = first[-1] + jnp.cumsum(whole.any(axis=0), dtype=jnp.int32)
    place = (first - of_line[-1])[None] + of_line
    place = jnp.where(moves, place, jnp.where(whole, second[None], 0)).reshape(-1) - 1
    moves = moves.reshape(-1)
    size, total = tile_size(lines, TILE), second[-1]
    tiles = -(-used.size // size)
    order = listed(place, tiles * size)

    def tile(parts: Array) -> tuple[Vector, Array]:
        (start, end, before, number, after), mine = (a[parts] for a in flat), parts % lines
        (fan, u, across), others = jax.tree.map(lambda a: a[mine], (line, given))
        ends = jnp.stack([start, end])
        sides = jnp.stack([before, number]), jnp.stack([number, after])
        first, last = jax.lax.cond(
            jnp.any(moves[parts]),
            lambda: jnp.where(number == UNKNOWN, ends, attach(shapes, fan, ends, *sides, across)),
            lambda: ends,
        )
        length = jnp.where(number == -1, 0, last - first)
        lit = length > 0
        value = shade(others, first + u * (last - first), number, lit)
        return each(lambda v: jnp.where(lit, length * v, 0), value), length

    def turn(first: Array, parts: Array) -> tuple[Array, tuple[Vector, Array]]:
        zero = jnp.zeros(size, line.offset.dtype)
        none = (zero, zero, zero), zero
        return first + size, jax.lax.cond(first < total, lambda: tile(parts), lambda: none)

    _, (value, length) = jax.lax.scan(turn, jnp.int32(0), order.reshape(tiles, size))

    def of_lines(a: Array) -> Array:
        return jnp.where(used, a.reshape(-1)[place], 0).reshape(-1, lines).sum(axis=0)

    return each(of_lines, value), 1 - of_lines(length)


def along_the_camera(
    estimator: Any, world: World, camera: Any, coordinates: dict[str, Array], time: Array
) -> Vector:
    """Return the mean radiance across the pixels of points, or along chords of the lens, components (n,)."""
    world = opened(world)
    x, y = coordinates["x"], coordinates["y"]
    others, lines = dict(coordinates), estimator.lines
    if set(lines) & set(SCREEN):
        lens = tuple(others.pop(name) for name in camera.lens)
        width, height = estimator.size
        column, row = (jnp.clip(jnp.floor(a * n), 0, n - 1) for a, n in ((x, width), (y, height)))
        upright, aside, offset = turned(SCREEN, lines, x * width - column, y * height - row)

        def fan_of(moved: Array) -> Fan:
            to_side = aside + moved

            def sight(t: float) -> tuple[Vector, Vector, Array]:
                right, down = _placed(upright, t, to_side)
                return camera.sights((column + right) / width, (row + down) / height, time, lens)

            origin, first, _ = sight(0)
            return eye(origin, first, sight(1)[1], time)

    else:
        upright, aside, offset = turned(LENS, lines, *(others.pop(name) for name in LENS))

        def fan_of(moved: Array) -> Fan:
            first, last, focus = camera.chord(x, y, time, aside, upright, moved)
            return lens_fan(first, last, focus, time)

    # A ray at the very end of a part may miss what is seen there.
    least = jnp.sqrt(jnp.finfo(x.dtype).eps) / 16
    offset = jnp.clip(offset, least, 1 - least)
    line = line_of(fan_of, offset, any(set(names) <= set(lines) for names in (SCREEN, LENS)))

    def shade(given: Any, t: Array, number: Array, lit: Array) -> Vector:
        fan, others = given
        direction = fan.direction(t)
        start = along(fan.apex, fan.begin, direction)
        sight = Sight(start, keep(lit, unit(direction)), fan.time, number)
        return estimator.radiance(world, sight, others)

    found = find_visible(world, line.fan, estimator.intervals)
    value, empty = integrate_parts(world, line, found, (line.fan, others), shade)
    for light in world.lights:
        if isinstance(light, Environment):
            value = each(lambda v, e: v + empty * e, value, components(light.radiance))
    return value


def reflect_along_lights(
    estimator: Any, world: World, choice: Choice, at: SurfaceInteraction, time: Array, gain: Gain
) -> Vector:
    """Return what :func:`reflect_lights` does, along lines on lights that are rectangles."""
    point = at.hit.point
    number = choice.number(world, time)
    corner = edge_u = edge_v = each(jnp.zeros_like, point)
    mine = jnp.zeros_like(time, bool)
    half = jnp.full_like(time, 0.5)
    u, v = (half if a is None else a for a in (choice.u, choice.v))
    along_v, aside, offset = turned(LIGHT, estimator.lines, u, v)
    for lights, row, here in by_kind(world.lights, number):
        if isinstance(lights, RectangleLight):
            parts = tuple(components(part[row]) for part in (lights.corner, lights.edge_u, lights.edge_v))
            corner, edge_u, edge_v = where(here, parts, (corner, edge_u, edge_v))
            mine = mine | here
    mine = mine & at.hit.valid
    width, side = where(along_v, (edge_v, edge_u), (edge_u, edge_v))

    middle = sample_light(world, number, point, at.normal, *_placed(along_v, half, aside))
    slack = jnp.where(mine, middle.distance - reach(middle, point), 0)

    def fan_of(moved: Array) -> Fan:
        start = minus(along(corner, aside + moved, side), point)
        first, last = keep(mine, start), keep(mine, plus(start, width))
        short = jnp.minimum(slack / jnp.where(mine, jnp.minimum(length(first), length(last)), 1), 0.5)
        return eye(point, first, last, time, jax.lax.stop_gradient(1 - short))

    line = line_of(fan_of, offset, set(LIGHT) <= set(estimator.lines))
    found = find_clear(world, line.fan, estimator.intervals)

    def shade(given: Any, t: Array, place: Array, lit: Array) -> Vector:
        at, number, along_v, aside, time = given
        light = sample_light(world, number, at.hit.point, at.normal, *_placed(along_v, t, aside))
        gained = gain(light, *evaluate(at.surface, at.normal, at.outgoing, light.direction))
        unknown = lit & (place == UNKNOWN)
        seen = jax.lax.cond(
            jnp.any(unknown),
            lambda: visible(world, light, at.hit.point, time, unknown) | ~unknown,
            lambda: lit,
        )
        return keep(seen, gained)

    value, _ = integrate_parts(world, line, found, (at, number, along_v, aside, time), shade)
    if all(isinstance(light, RectangleLight) for light in world.lights):
        return keep(mine, value)
    return where(mine, value, reflect_lights(world, choice, at, time, gain))

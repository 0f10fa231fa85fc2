"""Radiance along lines: visibility is exact, and shading is sampled once in each interval.

An interval adds its length times the radiance at one of its points, uniform in it. Its ends move with what
they depend on: the derivative of the sum is an unbiased estimate of the derivative of the mean, with edges.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.fans import Fan, eye, lens_fan
from qmcjax.tracing._intervals.lines import Parts, attach, bare, find_clear, find_visible, opened
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

TILE = 1024
"""Parts that are shaded together."""

Shade = Callable[[Any, Array, Array, Array], Vector]
"""From other arguments of lines, t, numbers of primitives and whether they are wanted, to values."""

Gain = Callable[[Sample, Vector, Array], Vector]
"""See :func:`reflect_lights`; without arrays of its own, which would not be in tiles."""


def integrate_parts(
    world: World, fan: Fan, found: Parts, offset: Array, given: Any, shade: Shade
) -> tuple[Vector, Array]:
    """Return the integrals of values over the parts of lines, and the length in which nothing is seen.

    Where parts do not fit, the rest of a line is one more part, in which visibility is sampled. Most lines
    have one part: the parts in use are listed, and shaded a tile at a time.
    """
    shapes = bare(world)
    *slots, until = found
    rest = jnp.where(until < 1, UNKNOWN, -1).astype(jnp.int32)
    last = until, jnp.ones_like(until), rest, rest, rest
    flat = tuple(jnp.concatenate([*a, end]) for a, end in zip(slots, last, strict=True))
    used, lines = flat[3] != -1, offset.shape[0]
    place = jnp.cumsum(used, dtype=jnp.int32) - 1
    size = tile_size(lines, TILE)
    tiles = -(-used.size // size)
    order = jnp.zeros(tiles * size, jnp.int32)
    order = order.at[jnp.where(used, place, order.size)].set(
        jnp.arange(used.size, dtype=jnp.int32), mode="drop"
    )

    def tile(listed: Array) -> tuple[Vector, Array]:
        (start, end, before, number, after), line = (a[listed] for a in flat), listed % lines
        mine, u, others = jax.tree.map(lambda a: a[line], (fan, offset, given))
        ends = jnp.stack([start, end])
        moved = attach(shapes, mine, ends, jnp.stack([before, number]), jnp.stack([number, after]))
        first, last = jnp.where(number == UNKNOWN, ends, moved)
        length = jnp.where(number == -1, 0, last - first)
        lit = length > 0
        value = shade(others, first + u * (last - first), number, lit)
        return each(lambda v: jnp.where(lit, length * v, 0), value), length

    def turn(first: Array, listed: Array) -> tuple[Array, tuple[Vector, Array]]:
        zero = jnp.zeros(size, offset.dtype)
        none = (zero, zero, zero), zero
        return first + size, jax.lax.cond(first <= place[-1], lambda: tile(listed), lambda: none)

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
    others = dict(coordinates)
    if "x" in estimator.lines:
        lens = tuple(others.pop(name) for name in camera.lens)
        columns, offset = estimator.columns, x * estimator.columns
        column = jnp.clip(jnp.floor(offset), 0, columns - 1)
        offset = offset - column
        origin, first, _ = camera.sights(column / columns, y, time, lens)
        _, last, _ = camera.sights((column + 1) / columns, y, time, lens)
        fan = eye(origin, first, last, time)
    else:
        offset = others.pop("lens_u")
        first, last, focus = camera.chord(x, y, time, others.pop("lens_v"))
        fan = lens_fan(first, last, focus, time)
    # A ray at the very end of a part may miss what is seen there.
    least = jnp.sqrt(jnp.finfo(x.dtype).eps) / 16
    offset = jnp.clip(offset, least, 1 - least)

    def shade(given: Any, t: Array, number: Array, lit: Array) -> Vector:
        fan, others = given
        direction = fan.direction(t)
        start = along(fan.apex, fan.begin, direction)
        sight = Sight(start, keep(lit, unit(direction)), fan.time, number)
        return estimator.radiance(world, sight, others)

    found = find_visible(world, fan, estimator.intervals)
    value, empty = integrate_parts(world, fan, found, offset, (fan, others), shade)
    for light in world.lights:
        if isinstance(light, Environment):
            value = each(lambda v, e: v + empty * e, value, components(light.radiance))
    return value


def reflect_along_lights(
    world: World, choice: Choice, at: SurfaceInteraction, time: Array, gain: Gain, intervals: int
) -> Vector:
    """Return what :func:`reflect_lights` does, along lines on lights that are rectangles."""
    point = at.hit.point
    number = choice.number(world, time)
    start = width = each(jnp.zeros_like, point)
    mine = jnp.zeros_like(time, bool)
    v = jnp.zeros_like(time) if choice.v is None else choice.v
    offset = jnp.zeros_like(time) if choice.u is None else choice.u
    for lights, row, here in by_kind(world.lights, number):
        if isinstance(lights, RectangleLight):
            corner, edge_u, edge_v = (
                components(part[row]) for part in (lights.corner, lights.edge_u, lights.edge_v)
            )
            start, width = where(here, (along(corner, v, edge_v), edge_u), (start, width))
            mine = mine | here
    mine = mine & at.hit.valid
    first = keep(mine, minus(start, point))
    last = keep(mine, plus(minus(start, point), width))
    middle = sample_light(world, number, point, at.normal, 0 * v + 0.5, v)
    slack = jnp.where(mine, middle.distance - reach(middle, point), 0)
    short = jnp.minimum(slack / jnp.where(mine, jnp.minimum(length(first), length(last)), 1), 0.5)
    fan = eye(point, first, last, time, jax.lax.stop_gradient(1 - short))
    found = find_clear(world, fan, intervals)

    def shade(given: Any, t: Array, place: Array, lit: Array) -> Vector:
        at, number, v, time = given
        light = sample_light(world, number, at.hit.point, at.normal, t, v)
        gained = gain(light, *evaluate(at.surface, at.normal, at.outgoing, light.direction))
        unknown = lit & (place == UNKNOWN)
        seen = jax.lax.cond(
            jnp.any(unknown),
            lambda: visible(world, light, at.hit.point, time, unknown) | ~unknown,
            lambda: lit,
        )
        return keep(seen, gained)

    value, _ = integrate_parts(world, fan, found, offset, (at, number, v, time), shade)
    if all(isinstance(light, RectangleLight) for light in world.lights):
        return keep(mine, value)
    return where(mine, value, reflect_lights(world, choice, at, time, gain))

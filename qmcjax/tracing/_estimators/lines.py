"""Radiance along lines on the screen, on the lens and on lights, and in flat mirrors that they meet."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial, reduce
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._estimators.line_integrals import Line, Lines, integrate, integrate_parts, placed
from qmcjax.tracing._intervals.fans import Fan, eye, lens_fan, mirrored
from qmcjax.tracing._intervals.lines import find_clear, find_known, find_visible, opened
from qmcjax.tracing._light.interaction import (
    Choice,
    SurfaceInteraction,
    by_kind,
    emission,
    interact,
    reach,
    sample_light,
    surface_kinds,
    visible,
)
from qmcjax.tracing._light.scattering import evaluate, reflect_lights
from qmcjax.tracing._shapes.primitives import Cylinder, Sphere
from qmcjax.tracing._shapes.vectors import (
    Vector,
    along,
    components,
    dot,
    each,
    keep,
    length,
    minus,
    times,
    unit,
    where,
)
from qmcjax.tracing._world.lights import Environment, RectangleLight, Sample
from qmcjax.tracing._world.world import Sight, World
from qmcjax.tracing.search.intersection import UNKNOWN

SCREEN, LENS, LIGHT = ("x", "y"), ("lens_u", "lens_v"), ("light_u", "light_v")
"""Coordinates that lines may be along."""

CORNERS = (0, 0), (1, 1), (0, 1), (1, 0)
"""Of what lines are in, opposite ones first."""

SPOTS = 4
"""Points of a part of a light that are shaded: visibility is known."""

SHIFTS = tuple(j * 0.6180339887498949 % 1 for j in range(SPOTS))
"""Where the whole light is seen, they are points of a lattice."""

Gain = Callable[[Sample, Vector, Array], Vector]
"""See :func:`reflect_lights`; without arrays of its own, which would not be in tiles."""


def sight_of(line: Line, start: Array, end: Array, number: Array, lit: Array) -> Sight:
    """Return the rays at which parts of lines are shaded; zero where they are not."""
    fan = line.fan
    direction = keep(lit, fan.direction(start + line.offset * (end - start)))
    return Sight(fan.start(direction), unit(direction), fan.time, number)


def along_the_camera(
    estimator: Any, world: World, camera: Any, coordinates: dict[str, Array], time: Array
) -> Vector:
    """Return the mean radiance across the pixels of points, or along chords of the lens, components (n,)."""
    world = opened(world)
    x, y = coordinates["x"], coordinates["y"]
    others = dict(coordinates)
    of = Lines(SCREEN if set(estimator.lines) & set(SCREEN) else LENS, estimator.lines, estimator.parallel)
    if of.names == SCREEN:
        lens = tuple(others.pop(name) for name in camera.lens)
        width, height = estimator.size
        column, row = (jnp.clip(jnp.floor(a * n), 0, n - 1) for a, n in ((x, width), (y, height)))
        u, v = x * width - column, y * height - row
        corner = column, row, time, lens

        def sight(corner: Any, right: Any, down: Any) -> tuple[Vector, Vector, Array]:
            column, row, time, lens = corner
            return camera.sights((column + right) / width, (row + down) / height, time, lens)

        def fan_of(corner: Any, along_v: Array, aside: Array, moved: Array) -> Fan:
            first, last = (sight(corner, *placed(along_v, t, aside + moved)) for t in (0, 1))
            return eye(first[0], first[1], last[1], first[2])

        (origin, *_), *_ = sights = [sight(corner, *place) for place in CORNERS]
        first, last, *beside = (direction for _, direction, _ in sights)
        all_rays = eye(origin, first, last, time)
    else:
        u, v = (others.pop(name) for name in LENS)
        corner = x, y, time

        def fan_of(corner: Any, along_v: Array, aside: Array, moved: Array) -> Fan:
            first, last, focus = camera.chord(*corner, aside, along_v, moved)
            return lens_fan(first, last, focus, corner[2])

        (first, focus), *around = (camera.focused(x, y, time, 2 * a - 1, 2 * b - 1) for a, b in CORNERS)
        all_rays = lens_fan(first, around[0][0], focus, time)
        beside = tuple(minus(focus, point) for point, _ in around[1:])
    # A ray at the very end of a part may miss what is seen there.
    least = jnp.sqrt(jnp.finfo(x.dtype).eps) / 16

    def lines(given: Any, k: Array) -> Line:
        corner, u, v, others = given
        along_v, aside, offset = of.place(u, v, k)
        offset = jnp.clip(offset, least, 1 - least)
        fan = partial(fan_of, corner, along_v, aside)
        return of.line(fan, offset, others)

    mirrors = flat_mirrors(world) if estimator.mirrors else []

    def reflects(number: Array) -> Array:
        return reduce(jnp.logical_or, [(number >= first) & (number < last) for first, last in mirrors])

    def shade(line: Line, start: Array, end: Array, number: Array, lit: Array) -> Vector:
        sight = sight_of(line, start, end, number, lit)
        return times(end - start, estimator.radiance(world, sight, line.given))

    def shade_all(line: Line, start: Array, end: Array, number: Array, lit: Array) -> Vector:
        here = lit & reflects(number)
        direct = shade(line, start, end, number, lit & ~here)

        def reflected() -> Vector:
            sight = sight_of(line, start, end, number, here)
            return where(here, reflect_lines(estimator, world, line, start, end, sight), direct)

        return jax.lax.cond(jnp.any(here), reflected, lambda: direct)

    all_rays = all_rays._replace(beside=tuple(beside))

    def in_mirrors(known: Array, number: Array) -> Array:
        """Return where also mirrors show one primitive, without edges."""
        here = known & reflects(number)

        def find() -> Array:
            direction = keep(here, all_rays.direction(jnp.full_like(x, 0.5)))
            at = interact(world, all_rays.start(direction), unit(direction), time, number)
            shown, _ = find_known(world, mirrored_at(at, all_rays), False)
            return known & (shown | ~here)

        return jax.lax.cond(jnp.any(here), find, lambda: known)

    given = corner, u, v, others
    find = partial(find_visible, count=estimator.intervals)
    apart = None if set(estimator.lines) & set(LIGHT) else shade
    of_parts, again = (shade_all, in_mirrors) if mirrors else (shade, None)
    value, empty = integrate(world, all_rays, given, of.number, lines, find, of_parts, apart, again)
    return _with_sky(world, value, empty)


def _with_sky(world: World, value: Vector, empty: Array) -> Vector:
    """Add the light of environments on the parts of lines in which nothing is seen."""
    for light in world.lights:
        if isinstance(light, Environment):
            value = each(lambda v, e: v + empty * e, value, components(light.radiance))
    return value


def flat_mirrors(world: World) -> list[tuple[int, int]]:
    """Return the ranges of numbers of flat primitives that may be mirrors."""
    numbered = [
        shape
        for item, start in world.numbered()
        if surface_kinds(item)[0].mirror is not None
        for shape in item.numbered(start)
    ]
    return [(k, k + shape.count) for shape, k in numbered if not isinstance(shape, Sphere | Cylinder)]


def mirrored_at(at: SurfaceInteraction, fan: Fan) -> Fan:
    """Return what the mirrors at some points show of fans."""
    return mirrored(fan, at.normal, dot(at.normal, at.hit.point))


def reflect_lines(estimator: Any, world: World, line: Line, start: Array, end: Array, sight: Sight) -> Vector:
    """Return the integrals of what is seen in flat mirrors over parts of lines; of no length without rays.

    Edges in mirrors move independently of those of mirrors: parts are cut at the ends of what is seen.
    """
    at = interact(world, sight.origin, sight.direction, sight.time, sight.number)
    assert at.surface.mirror is not None
    fan, across = mirrored_at(at, line.fan), line.across
    if across is not None:
        _, across = jax.jvp(partial(mirrored_at, at), (line.fan,), (across,))
    there, low, high = jax.lax.stop_gradient((at.hit.valid, start, end))
    ends = (keep(there, fan.direction(t)) for t in (low, high))
    found = find_visible(world, fan._replace(first=next(ends), last=next(ends)), estimator.intervals)

    def on_line(t: Array) -> Array:
        """Return places on lines; the ends of what was searched are no edges, and are cut away."""
        first, size = (jnp.broadcast_to(a, t.shape) for a in (low, high - low))
        return jnp.where(t <= 0, 0, jnp.where(t >= 1, 1, first + t * size))

    found = found._replace(start=on_line(found.start), end=on_line(found.end), until=on_line(found.until))
    seen = replace(estimator, mirrors=estimator.mirrors - 1)

    def shade(line: Line, start: Array, end: Array, number: Array, lit: Array) -> Vector:
        sight = sight_of(line, start, end, number, lit)
        return times(end - start, seen.radiance(world, sight, line.given))

    lines = Line(fan, line.offset, across, line.given)
    value, empty = integrate_parts(world, lines, found, shade, (start, end))
    emitted, _ = emission(world, at, sight.origin, at.normal)
    value = _with_sky(world, value, empty)
    return each(lambda m, v, e: m * v + (end - start) * e, at.surface.mirror, value, emitted)


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
    for lights, row, here in by_kind(world.lights, number):
        if isinstance(lights, RectangleLight):
            parts = tuple(components(part[row]) for part in (lights.corner, lights.edge_u, lights.edge_v))
            corner, edge_u, edge_v = where(here, parts, (corner, edge_u, edge_v))
            mine = mine | here
    mine = mine & at.hit.valid
    of = Lines(LIGHT, estimator.lines, 1)

    def direction(light: Any, a: Any, b: Any) -> Vector:
        corner, edge_u, edge_v, point, _ = light
        return minus(along(along(corner, a, edge_u), b, edge_v), point)

    light = corner, edge_u, edge_v, point, time
    directions = [keep(mine, direction(light, *place)) for place in CORNERS]
    middle = sample_light(world, number, point, at.normal, half, half)
    slack = jnp.where(mine, middle.distance - reach(middle, point), 0)
    nearest = reduce(jnp.minimum, map(length, directions))
    limit = jax.lax.stop_gradient(1 - jnp.minimum(slack / jnp.where(mine, nearest, 1), 0.5))
    first, last, *beside = directions
    all_rays = eye(point, first, last, time, limit)._replace(beside=tuple(beside))

    def lines(given: Any, k: Array) -> Line:
        light, limit, mine, u, v, at, number = given
        along_v, aside, offset = of.place(u, v, k)

        def fan_of(moved: Array) -> Fan:
            first, last = (direction(light, *placed(along_v, t, aside + moved)) for t in (0, 1))
            return eye(light[3], keep(mine, first), keep(mine, last), light[4], limit)

        return of.line(fan_of, offset, (at, number, along_v, aside, light[4]))

    def at_spot(line: Line, t: Array, aside: Array, place: Array | None, lit: Array) -> Vector:
        at, number, along_v, _, time = line.given
        light = sample_light(world, number, at.hit.point, at.normal, *placed(along_v, t, aside))
        gained = gain(light, *evaluate(at.surface, at.normal, at.outgoing, light.direction))
        if place is None:
            return gained
        unknown = lit & (place == UNKNOWN)
        seen = jax.lax.cond(
            jnp.any(unknown),
            lambda: visible(world, light, at.hit.point, time, unknown) | ~unknown,
            lambda: lit,
        )
        return keep(seen, gained)

    def mean(spots: list[Vector]) -> Vector:
        return each(lambda *parts: sum(parts[1:], parts[0]) / SPOTS, *spots)

    def shade(line: Line, start: Array, end: Array, place: Array, lit: Array) -> Vector:
        spots = [start + (end - start) * ((j + line.offset) / SPOTS) for j in range(SPOTS)]
        return times(end - start, mean([at_spot(line, t, line.given[3], place, lit) for t in spots]))

    def apart(line: Line, _: Array, __: Array, ___: Array, lit: Array) -> Vector:
        places = [((j + line.offset) / SPOTS, line.given[3] + turn) for j, turn in enumerate(SHIFTS)]
        return mean([at_spot(line, t, aside - jnp.floor(aside), None, lit) for t, aside in places])

    given = light, limit, mine, u, v, at, number
    find = partial(find_clear, count=estimator.intervals)
    value, _ = integrate(world, all_rays, given, of.number, lines, find, shade, apart)
    if all(isinstance(light, RectangleLight) for light in world.lights):
        return keep(mine, value)
    return where(mine, value, reflect_lights(world, choice, at, time, gain))

"""Light paths, and the densities of their vertices from both sides.

A path has vertices y_0 on a light, y_1, y_2, ... on surfaces; light and camera may each sample a part of it.
Strategies are compared by ratios of densities [1]_; ratios of neighbouring strategies have few factors: if
y_s is sampled from the light instead of the camera, its density given y_{s-1} replaces that given y_{s+1}.
Densities by area are those by angle times the cosine at the vertex over the squared distance. The cosine
cancels: a vertex stores `scale`, the cosine over its density by area from its own side. A mirror's density is
1 on both sides of a ratio; no strategy connects paths there.

References
----------
.. [1] E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997, section 10.2.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.tracing._light.interaction import SurfaceInteraction, any_of, by_kind, choose, interact
from qmcjax.tracing._light.scattering import Turn, evaluate, scatter, turn_needs
from qmcjax.tracing._shapes.vectors import Vector, dot, each, keep, minus, times, where
from qmcjax.tracing._world.lights import Source, Start
from qmcjax.tracing._world.world import World
from qmcjax.tracing.search.intersection import Intersection

_LARGE = 1e9
"""Ratios of densities are clamped here: larger ones do not matter, and two squares of it are finite."""


class Emission(NamedTuple):
    """Coordinates that choose an emitted ray; None if there is nothing to choose."""

    light: Array | None
    u: Array | None
    v: Array | None
    way_u: Array
    way_v: Array

    @classmethod
    def of(cls, coordinates: dict[str, Array]) -> "Emission":
        light, u, v = (coordinates.get(f"emit{part}") for part in ("", "_u", "_v"))
        return cls(light, u, v, coordinates["emit_way_u"], coordinates["emit_way_v"])


class Vertex(NamedTuple):
    """A vertex of a light path, components of shape (n,).

    Squared ratios of other strategies' densities to that of connecting the camera path here are
    ``r^2 (near + b^2 far)`` for all but the last, and ``r^2 b^2 hit`` where the camera path hits the light:
    r is ``scale`` times the camera's density of the direction to here over the squared distance, b the
    density of the direction back to the previous vertex.
    """

    at: SurfaceInteraction
    throughput: Vector
    scale: Array
    near: Array
    far: Array
    hit: Array
    mirror: Array
    first: Array
    """Whether the first surface is not a mirror."""


def emitters(world: World) -> list[Source]:
    """Return the lights at which paths start."""
    return [light for light in world.lights if isinstance(light, Source)]


def emission_needs(world: World, vertices: int) -> tuple[str, ...]:
    """Return the names of the coordinates of light paths with this many surfaces."""
    lights = emitters(world)
    if not lights or not vertices:
        return ()
    which = ("emit",) if len(lights) > 1 else ()
    place = ("emit_u", "emit_v") if any(light.coordinates for light in lights) else ()
    turns = [name for s in range(1, vertices) for name in turn_needs(world, f"scatter{s}")]
    return (*which, *place, "emit_way_u", "emit_way_v", *turns)


def start_density(world: World, number: Array) -> Array:
    """Return the density of paths starting at a light, by area and projected angle; 0 without one."""
    dtype = jnp.result_type(*jax.tree.leaves(world.lights))
    densities = [
        1 / light.extent() if isinstance(light, Source) else jnp.zeros((), dtype) for light in world.lights
    ]
    return jnp.stack(densities)[number] / max(len(emitters(world)), 1)


def start_density_at(world: World, at: Intersection) -> Array:
    """Return the same for the lights that rays hit; 0 without a hit."""
    places = [place for place, light in enumerate(world.lights) if light.object() is not None]
    if not places:
        return jnp.zeros_like(at.distance)
    number = at.number - (world.count - len(places))
    light = jnp.asarray(np.array(places, np.int32))[jnp.maximum(number, 0)]
    return jnp.where(number >= 0, start_density(world, light), 0)


def back(at: SurfaceInteraction, direction: Vector) -> Array:
    """Return the density of scattering light from an incoming direction back along the path."""
    density = evaluate(at.surface, at.normal, direction, at.outgoing)[1]
    return density if at.surface.mirror is None else jnp.where(any_of(at.surface.mirror), 1, density)


def is_mirror(at: SurfaceInteraction) -> Array:
    """Return where surfaces are mirrors."""
    return jnp.zeros_like(at.hit.valid) if at.surface.mirror is None else any_of(at.surface.mirror)


def squared(a: Vector, b: Vector) -> Array:
    """Return squared distances; 1 for equal points."""
    between = minus(a, b)
    result = dot(between, between)
    return jnp.where(result > 0, result, 1)


def square(ratio: Array) -> Array:
    """Return squared ratios of densities, clamped to finite values."""
    ratio = jnp.minimum(ratio, _LARGE)
    return ratio * ratio


def cut(squares: Array) -> Array:
    """Return sums of squares, clamped to be finite, so no product with 0 is NaN."""
    return jnp.minimum(squares, _LARGE * _LARGE)


def light_path(world: World, time: Array, emission: Emission, turns: list[Turn]) -> Vertex:
    """Return the vertices of light paths, one more than turns, along a new first axis."""
    first = _first_vertex(world, time, emission)
    if not turns:
        return jax.tree.map(lambda leaf: leaf[None], first)

    def step(vertex: Vertex, turn: Turn) -> tuple[Vertex, Vertex]:
        new = _next_vertex(world, time, vertex, turn)
        return new, new

    others = jax.lax.scan(step, first, jax.tree.map(lambda *parts: jnp.stack(parts), *turns))[1]
    return jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), first, others)


def start_paths(world: World, emission: Emission, zero: Array) -> tuple[Start, Array, Array]:
    """Return the emitted rays, one over their density, and 1 for lights with an extent, else 0."""
    lights = emitters(world)
    number = choose(emission.light, len(lights), zero)
    start, extent, visible = Start((zero, zero, zero), (zero, zero, zero), (zero, zero, zero)), zero, zero
    u, v = (zero if part is None else part for part in (emission.u, emission.v))
    for batch, row, here in by_kind(lights, number):
        made = batch.start(row, u, v, emission.way_u, emission.way_v)
        new = made, batch.extent()[row], zero + float(batch.coordinates > 0)
        start, extent, visible = where(here, new, (start, extent, visible))
    return start, len(lights) * extent, visible


def _first_vertex(world: World, time: Array, emission: Emission) -> Vertex:
    """Return the first surfaces of light paths."""
    lights, zero = emitters(world), jnp.zeros_like(time)
    number = choose(emission.light, len(lights), zero)
    start, extent, visible = start_paths(world, emission, zero)
    at = interact(world, start.point, start.direction, time)
    # Density of hitting that point of the light from the surface: by area, with the light's cosine.
    likely = zero
    for batch, row, here in by_kind(lights, number):
        found = batch.density(row, at.hit.point, at.normal, at.outgoing, start.point)
        found = found if batch.coordinates else zero + 1
        likely = jnp.where(here, found / len(world.lights), likely)
    mirror = is_mirror(at)
    near = jnp.where(mirror, 0, likely * likely)
    # Reflections of point lights in mirrors would be found only away from the first camera vertices.
    power = jnp.where(mirror & (visible == 0), 0, extent)
    # For point lights the squared distance is part of the scale.
    scale = jnp.where(visible == 0, extent * squared(at.hit.point, start.point), extent)
    return Vertex(at, times(power, start.radiance), scale, near, zero, visible, mirror, ~mirror)


def _next_vertex(world: World, time: Array, last: Vertex, turn: Turn) -> Vertex:
    """Return the next surfaces of light paths."""
    direction, factor, density = scatter(last.at, turn)
    throughput = each(lambda t, f: t * f, last.throughput, factor)
    goes_on = last.at.hit.valid & (density > 0) & any_of(throughput)
    direction, throughput = keep(goes_on, direction), keep(goes_on, throughput)
    density = jnp.where(last.mirror | ~goes_on, 1, density)
    at = interact(world, last.at.hit.point, direction, time)
    apart = squared(at.hit.point, last.at.hit.point)
    mirror = is_mirror(at)
    near = (~mirror & ~last.mirror).astype(time.dtype)
    ratio = square(last.scale / apart)
    returns = square(back(last.at, direction))
    far, hit = cut(ratio * (last.near + returns * last.far)), cut(ratio * returns * last.hit)
    return Vertex(at, throughput, apart / density, near, far, hit, mirror, last.first)

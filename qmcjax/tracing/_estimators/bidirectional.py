"""Bidirectional path tracing: camera paths connected to light paths."""

from dataclasses import field
from math import prod
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import Coordinates, validate_parts
from qmcjax.tracing._estimators.paths import Draws, Scattering
from qmcjax.tracing._light.interaction import Choice, SurfaceInteraction, any_of, emission, interact, visible
from qmcjax.tracing._light.light_paths import (
    Emission,
    Vertex,
    back,
    cut,
    emission_needs,
    emitters,
    is_mirror,
    light_path,
    square,
    squared,
    start_density,
    start_density_at,
)
from qmcjax.tracing._light.scattering import Turn, bounce_needs, evaluate, reflect_lights, scatter
from qmcjax.tracing._shapes.vectors import Vector, dot, each, keep, minus, plus, times
from qmcjax.tracing._world.lights import Sample
from qmcjax.tracing._world.world import Camera, Sight, World


class _Path(NamedTuple):
    """The state of camera paths on their way to the next surface."""

    origin: Vector
    direction: Vector
    """Unit vectors; zero where paths have ended."""
    normal: Vector
    """Normal of the surface that the path comes from."""
    density: Array
    """Density of the direction; inf where no other strategy finds it, at the camera and mirrors."""
    inverse: Array
    """One over the density; 0 at the camera, 1 at mirrors."""
    scale: Array
    """Of the surface that the path comes from, like the next three: see `_Surface`."""
    closed: Array
    """Whether paths are not connected there: at mirrors and the camera."""
    ratio: Array
    """See :meth:`_Surface.ratio`."""
    others: tuple[Array, ...]
    """Those of the next surface, except for the ratio between the two."""
    throughput: Vector
    radiance: Vector


class _Surface(NamedTuple):
    """The surface that camera paths hit, and the likelihood of light paths to find it, see :class:`Vertex`.

    If a light path may have J more surfaces than it has now, squared ratios are
    ``r^2 (open + b^2 others[J - 2])``: r is ``scale`` times the light's density of the direction to here over
    the squared distance, b the density of the direction back to the previous surface. For J = 1 the last term
    is omitted.
    """

    at: SurfaceInteraction
    scale: Array
    open: Array
    """1 where light paths may end here and be connected to the previous surface, else 0."""
    others: tuple[Array, ...]

    def ratio(self, direction: Vector) -> Array:
        """Return the squared ratio over r^2 for the largest possible J, towards a light."""
        if not self.others:
            return self.open
        return self.open + square(back(self.at, direction)) * self.others[-1]


@frozen_pytree
class Bidirectional(Scattering):
    """See :func:`bidirectional`."""

    world: World
    camera: Camera
    bounces: int = field(metadata={"static": True})
    light_bounces: int = field(metadata={"static": True})
    smooth: bool = field(metadata={"static": True})

    @property
    def _vertices(self) -> int:
        """Number of surfaces on light paths; those that cannot be connected are not followed."""
        return min(self.light_bounces, self.bounces) if emitters(self.world) else 0

    def light_needs(self) -> tuple[str, ...]:
        needs = bounce_needs(self.world, self.bounces)
        return needs + emission_needs(self.world, self._vertices)

    def radiance(self, world: World, sight: Sight, coordinates: Coordinates) -> Vector:
        one, zero = jnp.ones_like(sight.time), jnp.zeros_like(sight.time)
        black, white = (zero, zero, zero), (one, one, one)
        ratios = one * np.inf, zero, zero, one > 0, zero, (zero,) * (self._vertices - 1)
        path = _Path(sight.origin, sight.direction, black, *ratios, white, black)
        light = None
        if self._vertices:
            turns = [Turn.of(coordinates, f"scatter{s}") for s in range(1, self._vertices)]
            light = light_path(world, sight.time, Emission.of(coordinates), turns)
        surfaces = self.bounces + 1

        def step(path: _Path, draw: Draws) -> tuple[_Path, None]:
            return _step(world, sight.time, path, draw, light, surfaces), None

        return jax.lax.scan(step, path, self.draws(coordinates))[0].radiance


def _step(world: World, time: Array, path: _Path, draw: Draws, light: Vertex | None, surfaces: int) -> _Path:
    """Follow paths to the next surface, add the light there, and scatter them."""
    at = interact(world, path.origin, path.direction, time)
    emitted, chosen = emission(world, at, path.origin, path.normal)
    by_others = square(chosen / path.density)
    if light is not None:
        by_light = square(start_density_at(world, at.hit) * path.scale * path.inverse) * path.ratio
        by_others = by_others + jnp.where(chosen > 0, by_light, 0)
    weight = 1 / (1 + by_others)
    radiance = each(lambda r, t, e: r + t * e * weight, path.radiance, path.throughput, emitted)
    apart, mirror = squared(at.hit.point, path.origin), is_mirror(at)
    is_open = (~mirror & ~path.closed).astype(time.dtype)
    others = tuple(cut(square(path.scale / apart) * part) for part in path.others)
    surface = _Surface(at, apart * path.inverse, is_open, others)
    last = draw.number == surfaces
    gained = _light_of_lights(world, surface, time, path.throughput, draw.choice, last, light is not None)
    radiance = plus(radiance, gained)
    if light is not None:
        gained = _connect(world, surface, time, path.throughput, light, surfaces - draw.number)
        radiance = plus(radiance, gained)
    direction, factor, density = scatter(at, draw.turn)
    throughput = each(lambda t, f: t * f, path.throughput, factor)
    goes_on = at.hit.valid & (density > 0) & any_of(throughput) & ~last
    direction, throughput = keep(goes_on, direction), keep(goes_on, throughput)
    density = jnp.where(goes_on, density, 1)
    inverse = jnp.where(mirror, 1, 1 / density)
    ratio = surface.ratio(direction)
    if others:
        # With each surface the light path may be one longer: ending it here is then another strategy.
        returns = square(back(at, direction))
        others = (is_open, *(is_open + returns * part for part in others[:-1]))
    ratios = density, inverse, surface.scale, mirror, ratio, others
    return _Path(at.hit.point, direction, at.normal, *ratios, throughput, radiance)


def _light_of_lights(
    world: World, surface: _Surface, time: Array, throughput: Vector, choice: Choice, last: Array, joins: bool
) -> Vector:
    """Return direct light, weighted against the other strategies that find it."""

    def gain(light: Sample, reflectance: Vector, density: Array) -> Vector:
        others = jnp.where(last, 0, square(density / jnp.where(light.density > 0, light.density, 1)))
        if joins:
            # A point light is chosen with certainty, that is by area; by angle with the squared distance.
            likely = jnp.where(
                jnp.isinf(light.density), light.distance * light.distance / len(world.lights), light.density
            )
            start = start_density(world, choice.number(world, time))
            ratio = square(start * surface.scale / jnp.where(likely > 0, likely, 1))
            others = others + ratio * surface.ratio(light.direction)
        return each(lambda t, r, a: t * r * a / (1 + others), throughput, reflectance, light.arriving)

    return reflect_lights(world, choice, surface.at, time, gain)


def _connect(
    world: World, surface: _Surface, time: Array, throughput: Vector, light: Vertex, room: Array
) -> Vector:
    """Return the contribution of light-path vertices, at most ``room`` of them."""
    at, count = surface.at, len(surface.others) + 1
    zero = jnp.zeros_like(time)
    # The s-th may be followed by count - s others.
    opened = jnp.stack([surface.open] * (count - 1) + [zero])
    others = jnp.stack([*reversed(surface.others[:-1]), zero, zero][:count])

    def join(radiance: Vector, one: tuple[Vertex, Array, Array, Array]) -> tuple[Vector, None]:
        vertex, number, opened, others = one
        apart = squared(vertex.at.hit.point, at.hit.point)
        direction = times(1 / jnp.sqrt(apart), minus(vertex.at.hit.point, at.hit.point))
        from_here = each(jnp.negative, direction)
        here, density = evaluate(at.surface, at.normal, at.outgoing, direction)
        there, its = evaluate(vertex.at.surface, vertex.at.normal, vertex.at.outgoing, from_here)
        returns = square(back(vertex.at, from_here))
        ends = number == room
        by_camera = vertex.near + returns * (vertex.far + jnp.where(ends, 0, vertex.hit))
        ratios = square(density * vertex.scale / apart) * by_camera
        if count > 1:
            by_light = opened + square(back(at, direction)) * others
            ratios = ratios + square(its * surface.scale / apart) * by_light
        # No camera path finds mirrors that are the last of so many surfaces.
        counts = jnp.where(ends, vertex.first, number < room) & ~vertex.mirror & ~is_mirror(at)
        weight = jnp.where(counts, 1 / (apart * (1 + ratios)), 0)
        gained = each(lambda *factors: prod(factors) * weight, throughput, here, there, vertex.throughput)
        slope = abs(dot(vertex.at.normal, direction))
        sample = Sample(direction, jnp.sqrt(apart), gained, density, slope)
        seen = visible(world, sample, at.hit.point, time, at.hit.valid & vertex.at.hit.valid & any_of(gained))
        return plus(radiance, keep(seen, gained)), None

    numbers = jnp.arange(1, count + 1)
    return jax.lax.scan(join, (zero, zero, zero), (light, numbers, opened, others))[0]


def bidirectional(
    world: World, camera: Camera, bounces: int, light_bounces: int = 1, *, smooth: bool = False
) -> Bidirectional:
    """Make a scene of a world with scattered light, by paths from the camera and from lights.

    Each camera path is connected to one light path: each of its vertices to each vertex of the other.
    Multiple importance sampling weights these connections, and both strategies of :func:`path_tracing`, by
    the power heuristic over all strategies that find the same path [1]_. A sample is the radiance along one
    ray: light paths are not connected to the lens, so the scene remains a function on the screen.

    Parameters
    ----------
    world : World
    camera : Camera
    bounces : int
        See :func:`path_tracing`. The expectation is the same.
    light_bounces : int, optional
        Maximum number of surfaces on a light path, in [0, 64]; at most ``bounces`` are used. Paths start at
        point, sphere and rectangle lights, not at environments. 0 is path tracing.
    smooth : bool, optional
        See :func:`path_tracing`.

    Returns
    -------
    Bidirectional
        A scene with values (..., 3). It needs the coordinates of :func:`path_tracing`, then ``[emit][,
        emit_u, emit_v], emit_way_u, emit_way_v``, which choose a light, a point on it and a direction, and
        for s = 1, 2, ..., ``light_bounces - 1`` also ``scatter{s}_u, scatter{s}_v[, scatter{s}_lobe]``.

    References
    ----------
    .. [1] E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997, chapter 10.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> ball = tracing.sphere([0, 0, 0], 1.0, material=tracing.diffuse(0.8))
    >>> world = tracing.world([ball], [tracing.point_light([0, 3, 0], 1.0)])
    >>> scene = bidirectional(world, tracing.camera([0, 0, 4], [0, 0, 0]), bounces=1)
    >>> print(scene.needs)
    ('x', 'y', 'bounce1_u', 'bounce1_v', 'emit_way_u', 'emit_way_v')
    """
    validate_parts(world, camera, smooth)
    bounces = checks.integer("bounces", bounces, 0, 64)
    light_bounces = checks.integer("light_bounces", light_bounces, 0, 64)
    return Bidirectional(world, camera, bounces, light_bounces, smooth)

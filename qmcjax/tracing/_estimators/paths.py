"""Path tracing."""

from dataclasses import field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import Coordinates, Estimator, checked_lines, validate_parts
from qmcjax.tracing._estimators.lines import LENS, SCREEN
from qmcjax.tracing._estimators.varies import Seen
from qmcjax.tracing._light.interaction import Choice, any_of, emission, interact
from qmcjax.tracing._light.scattering import Turn, bounce_needs, reflect_lights, scatter
from qmcjax.tracing._shapes.vectors import Vector, each, keep, plus
from qmcjax.tracing._world.lights import Sample
from qmcjax.tracing._world.world import Camera, Sight, World
from qmcjax.tracing.search.intersection import UNKNOWN


class Draws(NamedTuple):
    """The coordinates used at surfaces; None if nothing is random."""

    choice: Choice
    turn: Turn
    roulette: Array | None
    number: Array
    """Of the surface: 1 for the first."""


class Scattering(Estimator):
    """An estimator with light scattered from surface to surface."""

    bounces: int

    def moves(self, found: Seen) -> Array:
        return found.objects | found.moves if self.bounces else found.moves

    def draws(self, coordinates: Coordinates, roulette: Array | None = None) -> Draws:
        """Return coordinates of all surfaces along a new first axis: of the light, and of the bounce away.

        ``roulette`` replaces its coordinates before it begins.
        """
        draws = []
        for k in range(self.bounces + 1):
            bounce = min(k + 1, self.bounces)
            survival = None if roulette is None else coordinates.get(f"roulette{bounce}", roulette)
            turn = Turn.of(coordinates, f"bounce{bounce}")
            choice = Choice.of(coordinates, str(k) if k else "")
            draws.append(Draws(choice, turn, survival, jnp.asarray(k + 1)))
        return jax.tree.map(lambda *parts: jnp.stack(parts), *draws)


class _Path(NamedTuple):
    """The state of paths on their way to the next surface."""

    origin: Vector
    direction: Vector
    """Unit vectors; zero where paths have ended."""
    number: Array | None
    """int32: the primitives that are hit, UNKNOWN if they have to be searched; None if all have to."""
    normal: Vector
    """Normal of the surface that the path comes from."""
    density: Array
    """Density of the direction; inf where no other strategy finds it, at the camera and mirrors."""
    throughput: Vector
    radiance: Vector


@frozen_pytree
class PathTracing(Scattering):
    """See :func:`path_tracing`."""

    world: World
    camera: Camera
    bounces: int = field(metadata={"static": True})
    roulette: int | None = field(metadata={"static": True})
    smooth: bool = field(metadata={"static": True})
    lines: tuple[str, ...] = field(metadata={"static": True, "keeps_mean": True})
    intervals: int = field(metadata={"static": True, "keeps_mean": True})
    parallel: int = field(metadata={"static": True, "keeps_mean": True})
    size: tuple[int, int] = field(metadata={"static": True, "keeps_mean": True})

    def light_needs(self) -> tuple[str, ...]:
        return bounce_needs(self.world, self.bounces, self.roulette)

    def without_lines(self) -> str:
        later = "" if self.bounces == 0 and not self.world.lights else "what later parts of paths see"
        return super().without_lines() or later

    def radiance(self, world: World, sight: Sight, coordinates: Coordinates) -> Vector:
        one, zero = jnp.ones_like(sight.time), jnp.zeros_like(sight.time)
        black, white = (zero, zero, zero), (one, one, one)
        start = _Path(sight.origin, sight.direction, sight.number, black, one * np.inf, white, black)
        # All paths survive before roulette begins.
        draws = self.draws(coordinates, None if (self.roulette or np.inf) > self.bounces else -one)

        def step(path: _Path, draw: Draws) -> tuple[_Path, None]:
            return _step(world, sight.time, path, draw, draw.number > self.bounces), None

        return jax.lax.scan(step, start, draws)[0].radiance


def _step(world: World, time: Array, path: _Path, draw: Draws, last: Array) -> _Path:
    """Follow paths to the next surface, add the light there, and scatter them."""
    at = interact(world, path.origin, path.direction, time, path.number)
    emitted, density = emission(world, at, path.origin, path.normal)
    weight = _weight(path.density, density)
    radiance = each(lambda r, t, e: r + t * e * weight, path.radiance, path.throughput, emitted)

    def gain(light: Sample, reflectance: Vector, density: Array) -> Vector:
        weight = jnp.where(last, 1, _weight(light.density, density))
        return each(lambda t, r, a: t * r * a * weight, path.throughput, reflectance, light.arriving)

    radiance = plus(radiance, reflect_lights(world, draw.choice, at, time, gain))
    direction, factor, density = scatter(at, draw.turn)
    throughput = each(lambda t, f: t * f, path.throughput, factor)
    goes_on = at.hit.valid & (density > 0) & any_of(throughput) & ~last
    if draw.roulette is not None:
        largest = jnp.maximum(jnp.maximum(*throughput[:2]), throughput[2])
        survival = jax.lax.stop_gradient(jnp.where(draw.roulette < 0, 1, jnp.clip(largest, 0, 1)))
        goes_on = goes_on & (draw.roulette < survival)
        throughput = each(lambda t: t / jnp.where(survival > 0, survival, 1), throughput)
    direction, throughput = keep(goes_on, direction), keep(goes_on, throughput)
    density = jnp.where(goes_on, density, 1)
    number = None if path.number is None else jnp.full_like(path.number, UNKNOWN)
    return _Path(at.hit.point, direction, number, at.normal, density, throughput, radiance)


def _weight(density: Array, other: Array) -> Array:
    """Return the weight of a strategy against one other by the power heuristic."""
    ratio = other / jnp.where(density > 0, density, 1)
    return 1 / (1 + ratio * ratio)


def path_tracing(
    world: World,
    camera: Camera,
    bounces: int,
    *,
    roulette: int | None = None,
    smooth: bool = False,
    lines: Any = (),
    intervals: int = 8,
    parallel: int = 1,
) -> PathTracing:
    """Make a scene of a world with light scattered from surface to surface.

    At each surface, a point of a light and a direction by the material are sampled; multiple importance
    sampling combines both by the power heuristic [1]_. Derivatives with respect to materials keep the sampled
    directions, lobes and roulette fixed, and so visibility edges: "detached sampling" [2]_.

    Parameters
    ----------
    world : World
    camera : Camera
    bounces : int
        Number of directions of a path after the first, in [0, 64]. 0 gives only direct light. Light scattered
        more than ``bounces + 1`` times is lost, and so is the reflection in a mirror that is the last of
        these surfaces.
    roulette : int, optional
        From this bounce on, at least 1, paths of low throughput end at random and the others are weighted up
        (Russian roulette), with one coordinate per bounce. None by default.
    smooth : bool, optional
        See :func:`direct_light`. Edges of lights and emitters, as seen from surfaces that scatter, count too.
    lines : str or sequence of str, optional
        ``x`` and ``y``, or ``lens_u`` and ``lens_v``, see :func:`direct_light`: what the camera sees first is
        integrated along a line, and one path starts in each of its parts. Edges that later parts of paths see
        are not covered: with ``smooth=True`` derivatives have those of the first surfaces, and lack those of
        shadows and bounces.
    intervals, parallel : int, optional
        See :func:`direct_light`.

    Returns
    -------
    PathTracing
        A scene with values (..., 3). It needs the coordinates of :func:`direct_light`, and for k = 1, 2, ...,
        ``bounces`` also ``bounce{k}_u, bounce{k}_v[, bounce{k}_lobe][, roulette{k}][, light{k}][,
        light{k}_u, light{k}_v]``; ``lobe`` if a material has microfacets and a Lambertian part.

    References
    ----------
    .. [1] E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997, sections 9.2 and 10.2.
    .. [2] T. Zeltner, S. Speierer, I. Georgiev, W. Jakob, "Monte Carlo Estimators for Differential Light
       Transport", 2021.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> ball = tracing.sphere([0, 0, 0], 1.0, material=tracing.diffuse(0.8))
    >>> world = tracing.world([ball], [tracing.environment(1.0)])
    >>> scene = path_tracing(world, tracing.camera([0, 0, 4], [0, 0, 0]), bounces=1)
    >>> print(scene.needs)
    ('x', 'y', 'light_u', 'light_v', 'bounce1_u', 'bounce1_v', 'light1_u', 'light1_v')
    """
    validate_parts(world, camera, smooth)
    bounces = checks.integer("bounces", bounces, 0, 64)
    if roulette is not None:
        roulette = checks.integer("roulette", roulette, 1, 64)
    lines = checked_lines(world, camera, lines, (*SCREEN, *LENS))
    intervals = checks.integer("intervals", intervals, 1, 256)
    parallel = checks.integer("parallel", parallel, 1, 256)
    return PathTracing(world, camera, bounces, roulette, smooth, lines, intervals, parallel, (1, 1))

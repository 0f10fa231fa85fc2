"""Direct light of many lights by resampled importance sampling: many candidates, one shadow ray.

A Hilbert curve visits all lights, and on each light another one visits its points. Candidates are at equal
distances along this curve, so neighbouring candidates are similar, and one coordinate chooses among them by
inversion: the chosen point depends on two coordinates only, and where its light is blocked in long intervals.
"""

from dataclasses import field

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import gray_decode
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import Coordinates, DirectLight, validate_parts
from qmcjax.tracing._estimators.varies import light_box
from qmcjax.tracing._light.interaction import SurfaceInteraction, any_of, choice_needs, sample_light, visible
from qmcjax.tracing._light.scattering import evaluate
from qmcjax.tracing._shapes.vectors import Vector, each, keep, times
from qmcjax.tracing._world.lights import Environment, Sample
from qmcjax.tracing._world.world import Camera, World

_CELLS = 10
"""Levels of the curve on a light, and of the curve through lights."""


@frozen_pytree
class ResampledLight(DirectLight):
    """See :func:`resampled_light`."""

    candidates: int = field(metadata={"static": True})

    def light_needs(self) -> tuple[str, ...]:
        lights = self.world.lights
        if not choice_needs(self.world):
            return ()
        shifted = any(light.coordinates for light in lights) or self.candidates % len(lights)
        return (("light",) if shifted else ()) + (("light_choice",) if self.candidates > 1 else ())

    def reflected(
        self, world: World, at: SurfaceInteraction, time: Array, coordinates: Coordinates
    ) -> Vector:
        zero = jnp.zeros_like(time)
        if not world.lights:
            return zero, zero, zero
        order, light = order_lights(world), coordinates.get("light", zero)

        def sample(world: World, at: SurfaceInteraction, number: Array) -> tuple[Sample, Vector]:
            which, u, v = along_lights(number, self.candidates, len(world.lights), light)
            found = sample_light(world, order[which], at.hit.point, at.normal, u, v)
            reflectance, _ = evaluate(at.surface, at.normal, at.outgoing, found.direction)
            return found, each(lambda r, a: r * a, reflectance, found.arriving)

        choice, chosen, total = coordinates.get("light_choice"), jnp.zeros(time.shape, jnp.int32), None
        if choice is not None:
            fixed = jax.lax.stop_gradient((world, at))

            def add(below: Array, number: Array) -> tuple[Array, Array]:
                below = below + sum(sample(*fixed, number)[1])
                return below, below

            total, below = jax.lax.scan(add, zero, jnp.arange(self.candidates))
            chosen = jnp.minimum(jnp.sum(below <= (choice * total)[None], axis=0), self.candidates - 1)
        found, gained = sample(world, at, chosen)
        if total is not None:
            weight = jax.lax.stop_gradient(sum(gained))
            gained = times(total / (self.candidates * jnp.where(weight > 0, weight, 1)), gained)
        return keep(visible(world, found, at.hit.point, time, at.hit.valid & any_of(gained)), gained)


def along_lights(number: Array, candidates: int, lights: int, shift: Array) -> tuple[Array, Array, Array]:
    """Return the places of candidates in the order of lights, and the points (u, v) on them.

    Candidate i is at (i + shift) / candidates of the way along the curve through all lights.
    """
    way = shift * lights
    start = jnp.minimum(jnp.floor(way), lights - 1)
    # Integers, so the position on a light keeps the digits of the shift.
    steps = number * lights + start.astype(jnp.int32)
    rest = ((steps % candidates).astype(shift.dtype) + (way - start)) / candidates
    u, v = hilbert_point(jnp.minimum(rest, 1 - jnp.finfo(shift.dtype).epsneg))
    return steps // candidates, u, v


def hilbert_point(position: Array) -> tuple[Array, Array]:
    """Return points of the unit square at positions in [0, 1) along a Hilbert curve from (0, 0) to (1, 0).

    In the smallest cells the curve is a diagonal: each coordinate is uniform if the position is.
    """
    quadrants = []
    for _ in range(_CELLS):
        position = 4 * position
        quadrants.append(jnp.floor(position))
        position = position - quadrants[-1]
    x = y = position
    for quadrant in reversed(quadrants):
        right, last = quadrant >= 2, quadrant == 3
        upper = (quadrant == 1) | (quadrant == 2)
        turned = jnp.where(last, 1 - y, y), jnp.where(last, 1 - x, x)
        x, y = jnp.where(upper, x, turned[0]), jnp.where(upper, y, turned[1])
        x, y = 0.5 * (x + right.astype(x.dtype)), 0.5 * (y + upper.astype(y.dtype))
    return x, y


def order_lights(world: World) -> Array:
    """Return the numbers of all lights along a Hilbert curve through space; environments are the last.

    References
    ----------
    .. [1] J. Skilling, "Programming the Hilbert curve", 2004.
    """
    dtype = jnp.result_type(*jax.tree.leaves(world.lights))
    infinite = np.array([isinstance(light, Environment) for light in world.lights])
    boxes = [light_box(light, dtype) for light in world.lights if not isinstance(light, Environment)]
    if len(boxes) < 2:
        return jnp.asarray(np.argsort(infinite, stable=True))
    place = jax.lax.stop_gradient(jnp.stack([0.5 * (low + high) for low, high in boxes]))
    place = place - place.min(axis=0, keepdims=True)
    size = place.max()
    cells = (place * ((2**_CELLS - 1) / jnp.where(size > 0, size, 1))).astype(jnp.uint32)

    def level(turn: Array, axes: tuple[Array, ...]) -> tuple[Array, ...]:
        bit = jnp.uint32(1) << (_CELLS - 1 - turn).astype(jnp.uint32)
        first, *others = axes
        first = jnp.where((first & bit) != 0, first ^ (bit - 1), first)
        for k, other in enumerate(others):
            swapped = (first ^ other) & (bit - 1)
            on = (other & bit) != 0
            first, others[k] = first ^ jnp.where(on, bit - 1, swapped), jnp.where(on, other, other ^ swapped)
        return first, *others

    x, y, z = jax.lax.fori_loop(0, _CELLS - 1, level, (cells[:, 0], cells[:, 1], cells[:, 2]))
    y = x ^ y
    z = y ^ z
    turned = gray_decode(z >> 1)
    levels = jnp.arange(_CELLS, dtype=jnp.uint32)[None]

    def spread(axis: Array, place: int) -> Array:
        bits = ((axis ^ turned)[:, None] >> levels) & 1
        return jnp.sum(bits << (3 * levels + place), axis=1, dtype=jnp.uint32)

    position = spread(x, 2) + spread(y, 1) + spread(z, 0)
    numbers = jnp.asarray(np.flatnonzero(~infinite))[jnp.argsort(position)]
    return jnp.concatenate([numbers, jnp.asarray(np.flatnonzero(infinite))])


def resampled_light(
    world: World, camera: Camera, candidates: int, mirrors: int = 0, *, smooth: bool = False
) -> ResampledLight:
    """Make a scene of a world with direct light of many lights, with one shadow ray.

    Resampled importance sampling [1]_: among candidates, points on lights, one is chosen with probability
    proportional to the light that it contributes if nothing blocks it, and a shadow ray is traced for this
    one only. The expectation is that of :func:`direct_light` for any number of candidates; the noise that
    remains for many candidates is that of shadows and colours.

    The candidates are equidistant along a curve through all lights: a Hilbert curve through space orders the
    lights, and another one covers each light. The coordinate ``light`` shifts all candidates;
    ``light_choice`` chooses one by inversion of their cumulative weights along the curve. With only these two
    coordinates, samplers that distribute errors as blue noise do so here, too.

    Parameters
    ----------
    world : World
    camera : Camera
    candidates : int
        Number of candidates, in [1, 1024]. With 1, a point is chosen without regard to its contribution.
    mirrors : int, optional
        See :func:`direct_light`.
    smooth : bool, optional
        See :func:`direct_light`. Derivatives treat the choice among candidates as constant. They are 0 with
        respect to lights without power, which are not chosen.

    Returns
    -------
    ResampledLight
        A scene with values (..., 3). It needs ``x, y[, time][, lens_u, lens_v][, light][, light_choice]``,
        without unused ones.

    References
    ----------
    .. [1] J. F. Talbot, D. Cline, P. Egbert, "Importance Resampling for Global Illumination", 2005.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> floor = tracing.plane([0, 0, 0], [0, 1, 0], material=tracing.diffuse(1.0))
    >>> lights = [tracing.point_light([x, 2, 0], 4 * jnp.pi) for x in range(5)]
    >>> scene = resampled_light(tracing.world([floor], lights), tracing.camera([0, 1, 1], [0, 0, 0]), 16)
    >>> print(scene.needs)
    ('x', 'y', 'light', 'light_choice')
    """
    validate_parts(world, camera, smooth)
    candidates = checks.integer("candidates", candidates, 1, 1024)
    mirrors = checks.integer("mirrors", mirrors, 0, 64)
    return ResampledLight(world, camera, mirrors, smooth, (), 1, 1, (1, 1), candidates)

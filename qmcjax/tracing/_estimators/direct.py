"""Direct light: surfaces lit only by lights, seen directly and in mirrors."""

from dataclasses import field
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import Coordinates, Estimator, validate_parts
from qmcjax.tracing._estimators.varies import Seen
from qmcjax.tracing._light.interaction import (
    Choice,
    SurfaceInteraction,
    any_of,
    choice_needs,
    emission,
    interact,
)
from qmcjax.tracing._light.scattering import mirror_direction, reflect_lights
from qmcjax.tracing._shapes.vectors import Vector, each, keep, where
from qmcjax.tracing._world.camera import Camera, Sight
from qmcjax.tracing._world.lights import Sample
from qmcjax.tracing._world.world import World


@frozen_pytree
class DirectLight(Estimator):
    """See :func:`direct_light`."""

    world: World
    camera: Camera
    mirrors: int = field(metadata={"static": True})
    smooth: bool = field(metadata={"static": True})

    def light_needs(self) -> tuple[str, ...]:
        return choice_needs(self.world)

    def moves(self, found: Seen) -> Array:
        return found.moves | found.mirrors if self.mirrors else found.moves

    def radiance(self, world: World, sight: Sight, coordinates: Coordinates) -> Vector:
        time, one = sight.time, jnp.ones_like(sight.time)
        last = interact(world, sight.origin, sight.direction, time, sight.number)
        seen, _ = emission(world, last, sight.origin, last.normal)
        state = last, (one, one, one), seen
        if last.surface.mirror is not None:
            state = jax.lax.fori_loop(
                0, self.mirrors, lambda _, state: _follow_mirrors(world, time, *state), state
            )
        last, throughput, seen = state

        def gain(light: Sample, reflectance: Vector, _: Array) -> Vector:
            return each(lambda r, a: r * a, reflectance, light.arriving)

        of_lights = reflect_lights(world, Choice.of(coordinates), last, time, gain)
        return each(lambda emitted, t, light: emitted + t * light, seen, throughput, of_lights)


def _follow_mirrors(
    world: World, time: Array, last: SurfaceInteraction, throughput: Vector, seen: Vector
) -> Any:
    """Follow rays from mirrors to their next hit."""
    mirror = last.surface.mirror
    assert mirror is not None
    on = last.hit.valid & any_of(mirror)
    direction = keep(on, mirror_direction(last.normal, last.outgoing))
    throughput = each(lambda t, m: jnp.where(on, t * m, t), throughput, mirror)
    following = interact(world, last.hit.point, direction, time)
    emitted, _ = emission(world, following, last.hit.point, last.normal)
    seen = each(lambda e, t, new: jnp.where(on, e + t * new, e), seen, throughput, emitted)
    return where(on, following, last), throughput, seen


def direct_light(world: World, camera: Camera, mirrors: int = 0, *, smooth: bool = False) -> DirectLight:
    """Make a scene of a world with direct light and shadows.

    The coordinate ``light`` chooses one of several lights with equal probability, and ``light_u`` and
    ``light_v`` a point on it. Lights and emitters are visible where rays hit them.

    Parameters
    ----------
    world : World
    camera : Camera
    mirrors : int, optional
        Maximum number of mirrors on a path, in [0, 64]; further reflections are black. Microfacets reflect
        lights, not other surfaces.
    smooth : bool, optional
        True asserts that no visibility edge moves with the differentiated parameters: then all derivatives
        are available. By default, derivatives with respect to shapes, motions, the camera and positions of
        lights raise an error, since derivatives of samples miss the effect of moving edges on means.
        Derivatives with respect to colours, roughness, radiance and intensity are unbiased, but 0 at black,
        where no light is traced.

    Returns
    -------
    DirectLight
        A scene with values (..., 3). It needs ``x, y[, time][, lens_u, lens_v][, light][, light_u,
        light_v]``, without unused ones.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> floor = tracing.plane([0, 0, 0], [0, 1, 0], material=tracing.diffuse(1.0))
    >>> world = tracing.world([floor], [tracing.point_light([0, 2, 0], 4 * jnp.pi)])
    >>> scene = direct_light(world, tracing.camera([0, 1, 1], [0, 0, 0]))
    >>> print(scene.needs, scene(jnp.array([0.5, 0.5])).round(4))
    ('x', 'y') [1. 1. 1.]
    """
    validate_parts(world, camera, smooth)
    return DirectLight(world, camera, checks.integer("mirrors", mirrors, 0, 64), smooth)

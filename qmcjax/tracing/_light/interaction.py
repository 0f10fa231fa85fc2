"""Surface interactions: the surface that a ray hits, its material, incoming and outgoing light."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.plug_ins import unwrap
from qmcjax.tracing._shapes.object import Object, rounding
from qmcjax.tracing._shapes.vectors import Vector, dot, each, keep, largest, plus, times, where
from qmcjax.tracing._world.lights import Environment, Light, Sample
from qmcjax.tracing._world.materials import Surface
from qmcjax.tracing._world.world import World
from qmcjax.tracing.search.intersection import Intersection, coordinates, intersect, search

Kind = TypeVar("Kind", bound=Light)


class Choice(NamedTuple):
    """Coordinates that choose a point on a light; None if there is nothing to choose."""

    light: Array | None = None
    u: Array | None = None
    v: Array | None = None

    @classmethod
    def of(cls, coordinates: dict[str, Array], vertex: str = "") -> "Choice":
        """Return the choice by the coordinates named after a vertex of a path."""
        return cls(*(coordinates.get(f"light{vertex}{part}") for part in ("", "_u", "_v")))

    def number(self, world: World, like: Array) -> Array:
        """Return the number of the chosen light, in the shape of an array."""
        return choose(self.light, len(world.lights), like)


def choose(coordinate: Array | None, count: int, like: Array) -> Array:
    """Return the number that a coordinate chooses among equally likely ones; 0 without a choice."""
    if coordinate is None:
        return jnp.zeros_like(like, jnp.int32)
    return jnp.minimum((coordinate * count).astype(jnp.int32), count - 1)


def choice_needs(world: World) -> tuple[str, ...]:
    """Return the names of the coordinates that choose a point on a light."""
    which = ("light",) if len(world.lights) > 1 else ()
    return which + (("light_u", "light_v") if any(light.coordinates for light in world.lights) else ())


def sample_lights(world: World, choice: Choice, point: Vector, normal: Vector) -> Sample:
    """Return samples of light that may reach points, divided by the probability of the chosen light."""
    zero = jnp.zeros_like(point[0])
    u, v = (zero if part is None else part for part in (choice.u, choice.v))
    return sample_light(world, choice.number(world, zero), point, normal, u, v)


def sample_light(world: World, number: Array, point: Vector, normal: Vector, u: Array, v: Array) -> Sample:
    """Return samples of numbered lights, divided by the probability of one of all lights."""
    count = len(world.lights)
    zero = jnp.zeros_like(point[0])
    result = Sample((zero, zero, zero), zero, (zero, zero, zero), zero, zero)
    for lights, row, here in by_kind(world.lights, number):
        sample = lights.sample(row, point, normal, u, v)
        result = where(here, sample, result)
    return result._replace(arriving=times(count, result.arriving), density=result.density / count)


def reach(sample: Sample, point: Vector) -> Array:
    """Return how far an object has to be to hide a light: its distance less what rounding decides."""
    # The hit on a light is known up to the rounding of coordinates, more at grazing angles.
    size = largest(point) + jnp.where(jnp.isfinite(sample.distance), sample.distance, 0)
    slack = 4 * rounding(size) / jnp.maximum(sample.slope, 2 * rounding(jnp.ones_like(size)))
    return sample.distance - jnp.minimum(slack, 0.5 * sample.distance)


def visible(world: World, sample: Sample, point: Vector, time: Array, wanted: Array) -> Array:
    """Return whether light reaches the points that are wanted."""
    rays = point, keep(wanted, sample.direction), time, jnp.where(wanted, reach(sample, point), 0)
    blocked = search(*jax.lax.stop_gradient((world, *rays)), True)[1] >= 0
    return wanted & ~blocked


def emitted_towards(
    world: World, at: Intersection, origin: Vector, normal: Vector, direction: Vector
) -> tuple[Vector, Array]:
    """Return the radiance of lights that rays hit, and the density of sampling them as lights.

    ``normal`` is that of the surfaces at the origins of rays.
    """
    zero = jnp.zeros_like(direction[0])
    radiance, density = (zero, zero, zero), zero
    first = world.count - sum(light.object() is not None for light in world.lights)
    number = 0
    for light in world.lights:
        if isinstance(light, Environment):
            here = ~at.valid
        elif light.object() is None:
            continue
        else:
            here = (at.number == first + number) & (dot(direction, at.normal) < 0)
            number += 1
        one, row = jax.tree.map(lambda leaf: leaf[None], light), jnp.zeros_like(at.number)
        emitted = one.emitted(row)
        radiance = plus(radiance, keep(here, emitted))
        likely = one.density(row, origin, normal, direction, at.point)
        density = jnp.where(here, density + likely / len(world.lights), density)
    return radiance, density


def by_kind(lights: Sequence[Kind], number: Array) -> Iterator[tuple[Kind, Array, Array]]:
    """Yield the lights of each kind as one batch, their rows, and whether it has the chosen light."""
    kinds: dict[Any, list[int]] = {}
    for place, light in enumerate(lights):
        kinds.setdefault(type(light), []).append(place)
    for places in kinds.values():
        row, mine = np.zeros(len(lights), np.int32), np.zeros(len(lights), bool)
        row[places], mine[places] = np.arange(len(places)), True
        batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(lights[place] for place in places))
        yield batch, jnp.asarray(row)[number], jnp.asarray(mine)[number]


DEFAULT = 0.5
"""Reflectance of objects without a material."""


class SurfaceInteraction(NamedTuple):
    """Surface interactions, components of shape (n,)."""

    hit: Intersection
    normal: Vector
    """Unit vectors on the side of the ray."""
    outgoing: Vector
    """Outgoing direction: unit vectors back along the ray."""
    surface: Surface


def interact(
    world: World, origin: Vector, direction: Vector, time: Array, known: Array | None = None
) -> SurfaceInteraction:
    """Return the surface interactions of rays of unit direction; see :func:`intersect`."""
    at = intersect(world, origin, direction, time, known)
    back = dot(at.normal, direction) > 0
    normal = each(lambda n: jnp.where(back, -n, n), at.normal)
    return SurfaceInteraction(at, normal, each(jnp.negative, direction), surface(world, at, time))


def surface(world: World, at: Intersection, time: Array) -> Surface:
    """Return the surface at each hit; all values are 0 if nothing, or a light, is hit."""
    textured = [is_textured(item.material) for item, _ in world.numbered()]
    number = at.number
    u, v = coordinates(world, textured, number, time, at.inside)
    starts = [start for _, start in world.numbered()]
    which = sum((number >= start).astype(jnp.int32) for start in starts) if starts else jnp.zeros_like(number)
    # Rays without a hit have 0.
    which = jnp.where(at.valid, which, 0)
    given = [_at(item.material, u, v, time) for item in world.objects]

    def field(name: str) -> Any:
        parts = [getattr(each_of, name) for each_of in given]
        if all(part is None for part in parts):
            return None
        zero = jnp.zeros_like(time)
        # A roughness of 0 would have infinite derivatives.
        value = zero + 1 if name == "roughness" else (zero, zero, zero)
        for place, part in enumerate(parts):
            if part is not None:
                value = where(which == place + 1, part, value)
        return value

    return Surface(*(field(name) for name in Surface._fields))


def emission(world: World, at: SurfaceInteraction, origin: Vector, normal: Vector) -> tuple[Vector, Array]:
    """Return the emitted radiance, and the density of sampling it as a light.

    ``origin`` and ``normal`` are those of the surfaces at the origins of rays.
    """
    direction = each(jnp.negative, at.outgoing)
    radiance, density = emitted_towards(world, at.hit, origin, normal, direction)
    if at.surface.emission is not None:
        radiance = plus(radiance, at.surface.emission)
    return radiance, density


def any_of(color: Vector) -> Array:
    """Return where a colour is not black."""
    return (color[0] > 0) | (color[1] > 0) | (color[2] > 0)


def has_random_lobes(world: World) -> bool:
    """Return whether any surface scatters light in random directions."""
    return any(kind.diffuse is not None or kind.glossy is not None for kind in surface_kinds(*world.objects))


def has_two_lobes(world: World) -> bool:
    """Return whether any surface has two lobes."""
    return any(kind.diffuse is not None and kind.glossy is not None for kind in surface_kinds(*world.objects))


def surface_kinds(*objects: Object) -> list[Surface]:
    """Return the components that the surfaces of objects may have; None for those they never have."""
    number = jax.ShapeDtypeStruct((1,), jnp.float32)
    return [jax.eval_shape(partial(_at, item.material), number, number, number) for item in objects]


def is_textured(material: Any) -> bool:
    """Return whether a material may depend on coordinates."""
    return material is not None and getattr(unwrap(material), "textured", True)


def _at(material: Any, u: Array, v: Array, time: Array) -> Surface:
    if material is None:
        half = jnp.asarray(DEFAULT, time.dtype)
        return Surface(diffuse=(half, half, half))
    given = unwrap(material).at(u, v, time)
    if not isinstance(given, Surface) or any(
        jnp.shape(leaf) not in ((), u.shape) for leaf in jax.tree.leaves(given)
    ):
        raise TypeError(
            "material.at must return a qmcjax.tracing.Surface of components of the shape of u, or (), got "
            f"{checks.shown(given)}"
        )
    if (given.glossy is None) != (given.roughness is None):
        raise TypeError("material.at must return glossy and roughness together, or neither")
    return jax.tree.map(lambda leaf: jnp.asarray(leaf).astype(time.dtype), given)

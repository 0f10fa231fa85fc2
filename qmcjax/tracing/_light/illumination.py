"""Sampling of lights: choice of a light, a point on it, and the density of both."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.tracing._search.intersection import Intersection
from qmcjax.tracing._search.search import search
from qmcjax.tracing._shapes.shape_batches import rounding
from qmcjax.tracing._shapes.vectors import Vector, dot, kept, largest, plus, times, where
from qmcjax.tracing._world.lights import Environment, Light, Sample
from qmcjax.tracing._world.world import World

Kind = TypeVar("Kind", bound=Light)


class Choice(NamedTuple):
    """Coordinates that choose a point on a light; None where there is nothing to choose."""

    light: Array | None = None
    u: Array | None = None
    v: Array | None = None

    @classmethod
    def of(cls, coordinates: dict[str, Array], vertex: str = "") -> "Choice":
        """Return the choice by the coordinates named after a vertex of a path."""
        return cls(*(coordinates.get(f"light{vertex}{part}") for part in ("", "_u", "_v")))

    def number(self, world: World, like: Array) -> Array:
        """Return the number of the chosen light, in the shape of an array."""
        return chosen(self.light, len(world.lights), like)


def chosen(coordinate: Array | None, count: int, like: Array) -> Array:
    """Return which of several things a coordinate chooses, all equally likely; 0 without a choice."""
    if coordinate is None:
        return jnp.zeros_like(like, jnp.int32)
    return jnp.minimum((coordinate * count).astype(jnp.int32), count - 1)


def chosen_by(world: World) -> tuple[str, ...]:
    """Return the names of the coordinates that choose a point on a light."""
    which = ("light",) if len(world.lights) > 1 else ()
    return which + (("light_u", "light_v") if any(light.coordinates for light in world.lights) else ())


def illuminated(world: World, choice: Choice, point: Vector, normal: Vector) -> Sample:
    """Return light that may reach points, divided by the probability of its light."""
    count = len(world.lights)
    zero = jnp.zeros_like(point[0])
    number = choice.number(world, zero)
    result = Sample((zero, zero, zero), zero, (zero, zero, zero), zero, zero)
    for lights, row, here in by_kind(world.lights, number):
        u, v = (zero if part is None else part for part in (choice.u, choice.v))
        sample = lights.sample(row, point, normal, u, v)
        result = where(here, sample, result)
    return result._replace(arriving=times(count, result.arriving), density=result.density / count)


def visible(world: World, sample: Sample, point: Vector, time: Array, wanted: Array) -> Array:
    """Return whether light reaches the points that are wanted."""
    # The hit on a light is known up to the rounding of coordinates, more at grazing angles.
    size = largest(point) + jnp.where(jnp.isfinite(sample.distance), sample.distance, 0)
    slack = 4 * rounding(size) / jnp.maximum(sample.slope, 2 * rounding(jnp.ones_like(size)))
    limit = sample.distance - jnp.minimum(slack, 0.5 * sample.distance)
    rays = point, kept(wanted, sample.direction), time, jnp.where(wanted, limit, 0)
    blocked = search(*jax.lax.stop_gradient((world, *rays)), True)[1] >= 0
    return wanted & ~blocked


def shining(
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
        radiance = plus(radiance, kept(here, emitted))
        likely = one.density(row, origin, normal, direction, at.point)
        density = jnp.where(here, density + likely / len(world.lights), density)
    return radiance, density


def by_kind(lights: Sequence[Kind], number: Array) -> Iterator[tuple[Kind, Array, Array]]:
    """Yield the lights of each kind as one batch, their rows, and whether the batch has the chosen light."""
    kinds: dict[Any, list[int]] = {}
    for place, light in enumerate(lights):
        kinds.setdefault(type(light), []).append(place)
    for places in kinds.values():
        row, mine = np.zeros(len(lights), np.int32), np.zeros(len(lights), bool)
        row[places], mine[places] = np.arange(len(places)), True
        batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(lights[place] for place in places))
        yield batch, jnp.asarray(row)[number], jnp.asarray(mine)[number]

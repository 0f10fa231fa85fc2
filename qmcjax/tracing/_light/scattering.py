"""Scattering at a surface: the next direction, random or mirrored."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._light.illumination import Choice, chosen_by, illuminated, visible
from qmcjax.tracing._light.interaction import SurfaceInteraction, any_of, mixed, scatters
from qmcjax.tracing._light.reflection import evaluate, reflected, sample_direction
from qmcjax.tracing._shapes.vectors import Vector, each, kept, where
from qmcjax.tracing._world.lights import Sample
from qmcjax.tracing._world.world import World


class Turn(NamedTuple):
    """Coordinates that choose a direction; None where nothing is random."""

    u: Array | None = None
    v: Array | None = None
    lobe: Array | None = None

    @classmethod
    def of(cls, coordinates: dict[str, Array], name: str) -> "Turn":
        """Return the choice by the coordinates of a name."""
        return cls(*(coordinates.get(f"{name}_{part}") for part in cls._fields))


def turned_by(world: World, name: str) -> tuple[str, ...]:
    """Return the names of the coordinates that choose a direction."""
    parts = (("u", "v") if scatters(world) else ()) + (("lobe",) if mixed(world) else ())
    return tuple(f"{name}_{part}" for part in parts)


def bounce_needs(world: World, bounces: int, roulette: int | None = None) -> tuple[str, ...]:
    """Return the names of the coordinates of paths with so many bounces: of lights, and of each bounce."""
    choice = chosen_by(world)
    needs = list(choice)
    for k in range(1, bounces + 1):
        needs += turned_by(world, f"bounce{k}")
        needs += [f"roulette{k}"] if roulette is not None and k >= roulette else []
        needs += [name.replace("light", f"light{k}", 1) for name in choice]
    return tuple(needs)


def lit(
    world: World,
    choice: Choice,
    at: SurfaceInteraction,
    time: Array,
    gain: Callable[[Sample, Vector, Array], Vector],
) -> Vector:
    """Return the light of lights that surfaces scatter back along their rays.

    ``gain`` returns it, if nothing blocks it, by the sample of a light and by what :func:`evaluate` returns.
    """
    if not world.lights:
        return each(jnp.zeros_like, at.normal)
    light = illuminated(world, choice, at.hit.point, at.normal)
    gained = gain(light, *evaluate(at.surface, at.normal, at.outgoing, light.direction))
    return kept(visible(world, light, at.hit.point, time, at.hit.valid & any_of(gained)), gained)


def scattered(at: SurfaceInteraction, turn: Turn) -> tuple[Vector, Vector, Array]:
    """Return the next directions, reflectance over density, and the density; 0 without a direction."""
    zero = jnp.zeros_like(at.normal[0])
    direction, factor, density = (zero, zero, zero), (zero, zero, zero), zero
    if turn.u is not None:
        direction = sample_direction(
            at.surface, at.normal, at.outgoing, turn.u, turn.v, 0.5 if turn.lobe is None else turn.lobe
        )
        reflectance, density = evaluate(at.surface, at.normal, at.outgoing, direction)
        factor = each(lambda r: r / jnp.where(density > 0, density, 1), reflectance)
    if at.surface.mirror is not None:
        on = any_of(at.surface.mirror)
        mirrored = reflected(at.normal, at.outgoing)
        direction, factor = where(on, (mirrored, at.surface.mirror), (direction, factor))
        density = jnp.where(on, jnp.inf, density)
    return direction, factor, density

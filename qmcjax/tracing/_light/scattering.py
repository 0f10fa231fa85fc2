"""Scattering at a surface: the next direction, random or mirrored."""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._light.interaction import SurfaceInteraction, any_of, mixed, scatters
from qmcjax.tracing._light.reflection import evaluate, reflected, sample_direction
from qmcjax.tracing._shapes.vectors import Vector, each
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
        direction = each(lambda m, a: jnp.where(on, m, a), mirrored, direction)
        factor = each(lambda m, a: jnp.where(on, m, a), at.surface.mirror, factor)
        density = jnp.where(on, jnp.inf, density)
    return direction, factor, density

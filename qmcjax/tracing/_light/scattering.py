"""Scattering at a surface: Lambertian, microfacets, or both; evaluation, and sampling of the next direction.

Directions and densities treat the material as constant: "detached sampling" [1]_. Directions that move with
the roughness would cross visibility edges, which derivatives of samples miss.

References
----------
.. [1] T. Zeltner, S. Speierer, I. Georgiev, W. Jakob, "Monte Carlo Estimators for Differential Light
   Transport", 2021.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.tracing._light.interaction import (
    Choice,
    SurfaceInteraction,
    any_of,
    choice_needs,
    has_random_lobes,
    has_two_lobes,
    sample_lights,
    visible,
)
from qmcjax.tracing._shapes.vectors import (
    Vector,
    around,
    dot,
    each,
    hemisphere,
    keep,
    minus,
    plus,
    tangents,
    times,
    unit,
    where,
)
from qmcjax.tracing._world.lights import Sample
from qmcjax.tracing._world.materials import Surface
from qmcjax.tracing._world.world import World


def evaluate(surface: Surface, normal: Vector, outgoing: Vector, incoming: Vector) -> tuple[Vector, Array]:
    """Return reflectances times the cosine, and the density of :func:`sample_direction`.

    ``outgoing`` are unit vectors back along the ray, on the side of ``normal``; ``incoming`` are unit vectors
    towards the light. Both results are 0 below the surface. The density is per solid angle, without mirrors.
    """
    cosine = dot(normal, incoming)
    above = cosine > 0
    cosine = jnp.where(above, cosine, 0)
    zero = jnp.zeros_like(cosine)
    value, density = (zero, zero, zero), zero
    fixed = jax.lax.stop_gradient(surface)
    rough = 0.0 if surface.glossy is None else _chance(fixed)
    if surface.diffuse is not None:
        value = times(cosine / np.pi, surface.diffuse)
        density = (1 - rough) * cosine / np.pi
    if surface.glossy is not None:
        out, into = _local(normal, outgoing), _local(normal, incoming)
        distribution, fresnel, masked, _ = _facets(surface.roughness, out, into)
        gloss = each(lambda c: (c + (1 - c) * fresnel) * distribution * masked, surface.glossy)
        lit = jnp.any(jnp.stack(jnp.broadcast_arrays(*surface.glossy)) > 0, axis=0) & above
        value = plus(value, keep(lit, gloss))
        distribution, _, _, share = _facets(fixed.roughness, out, into)
        density = density + jnp.where(lit, rough * distribution * share, 0)
    return value, density


def sample_direction(surface: Surface, normal: Vector, outgoing: Vector, u: Any, v: Any, lobe: Any) -> Vector:
    """Return incoming directions, unit vectors; those below the surface contribute nothing."""
    local = None
    surface = jax.lax.stop_gradient(surface)
    if surface.diffuse is not None:
        local, _ = hemisphere(u, v)
    if surface.glossy is not None:
        rough = _visible(surface.roughness, _local(normal, outgoing), u, v)
        if local is None:
            local = rough
        else:
            local = where(lobe < _chance(surface), rough, local)
    if local is None:
        return each(jnp.zeros_like, normal)
    return unit(around(local, normal))


def mirror_direction(normal: Vector, outgoing: Vector) -> Vector:
    """Return the mirrored directions."""
    return minus(times(2 * dot(normal, outgoing), normal), outgoing)


def _chance(surface: Surface) -> Array:
    """Return the probability of sampling the microfacets."""
    rough = sum(surface.glossy) if surface.glossy is not None else 0
    if surface.diffuse is None:
        return jnp.ones_like(rough)
    total = rough + sum(surface.diffuse)
    return rough / jnp.where(total > 0, total, 1)


def _local(normal: Vector, vector: Vector) -> Vector:
    one, other = tangents(normal)
    return dot(one, vector), dot(other, vector), dot(normal, vector)


def _facets(alpha: Any, out: Vector, into: Vector) -> tuple[Array, Array, Array, Array]:
    """Return the factors of the microfacet model for two directions of the upper hemisphere.

    The distribution D of half vectors; Fresnel's growth towards 1; G_2 / 4 over the cosine of ``out``, with
    height-correlated masking; and the density of :func:`_visible` over D.
    """
    x, y, z = unit(plus(out, into))
    # z^2 (alpha^2 - 1) + 1 would cancel near z = 1.
    spread = (x * x + y * y) + alpha * alpha * (z * z)
    spread = jnp.where(spread > 0, spread, 1)
    distribution = alpha * alpha / (np.pi * spread * spread)
    meeting = jnp.clip(dot(out, (x, y, z)), 0, 1)
    fresnel = (1 - meeting) ** 5
    cos_out, cos_in = jnp.maximum(out[2], 0), jnp.maximum(into[2], 0)
    slope_out, slope_in = (jnp.sqrt(alpha * alpha + (1 - alpha * alpha) * c * c) for c in (cos_out, cos_in))
    both = cos_out * slope_in + cos_in * slope_out
    masked = 0.5 * cos_in / jnp.where(both > 0, both, 1)
    return distribution, fresnel, masked, 0.5 / (cos_out + slope_out)


def _visible(alpha: Any, out: Vector, u: Any, v: Any) -> Vector:
    """Return directions mirrored at normals sampled by their visibility from ``out`` [1]_.

    References
    ----------
    .. [1] J. Dupuy, A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023.
    """
    x, y, z = unit((alpha * out[0], alpha * out[1], out[2]))
    height = (1 - v) * (1 + z) - z
    radius = jnp.sqrt(jnp.maximum(1 - height * height, 0.01 * jnp.finfo(height.dtype).eps))
    angle = 2 * np.pi * u
    cap = radius * jnp.cos(angle) + x, radius * jnp.sin(angle) + y, height + z
    normal = unit((alpha * cap[0], alpha * cap[1], jnp.maximum(cap[2], 0)))
    return mirror_direction(normal, out)


class Turn(NamedTuple):
    """Coordinates that choose a direction; None if nothing is random."""

    u: Array | None = None
    v: Array | None = None
    lobe: Array | None = None

    @classmethod
    def of(cls, coordinates: dict[str, Array], name: str) -> "Turn":
        """Return the choice by the coordinates of a name."""
        return cls(*(coordinates.get(f"{name}_{part}") for part in cls._fields))


def turn_needs(world: World, name: str) -> tuple[str, ...]:
    """Return the names of the coordinates that choose a direction."""
    parts = (("u", "v") if has_random_lobes(world) else ()) + (("lobe",) if has_two_lobes(world) else ())
    return tuple(f"{name}_{part}" for part in parts)


def bounce_needs(world: World, bounces: int, roulette: int | None = None) -> tuple[str, ...]:
    """Return the names of the coordinates of paths: of lights, and of each bounce."""
    choice = choice_needs(world)
    needs = list(choice)
    for k in range(1, bounces + 1):
        needs += turn_needs(world, f"bounce{k}")
        needs += [f"roulette{k}"] if roulette is not None and k >= roulette else []
        needs += [name.replace("light", f"light{k}", 1) for name in choice]
    return tuple(needs)


def reflect_lights(
    world: World,
    choice: Choice,
    at: SurfaceInteraction,
    time: Array,
    gain: Callable[[Sample, Vector, Array], Vector],
) -> Vector:
    """Return the direct light that surfaces scatter back along their rays.

    ``gain`` computes it, if unoccluded, from the sample of a light and the result of :func:`evaluate`.
    """
    if not world.lights:
        return each(jnp.zeros_like, at.normal)
    light = sample_lights(world, choice, at.hit.point, at.normal)
    gained = gain(light, *evaluate(at.surface, at.normal, at.outgoing, light.direction))
    return keep(visible(world, light, at.hit.point, time, at.hit.valid & any_of(gained)), gained)


def scatter(at: SurfaceInteraction, turn: Turn) -> tuple[Vector, Vector, Array]:
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
        mirrored = mirror_direction(at.normal, at.outgoing)
        direction, factor = where(on, (mirrored, at.surface.mirror), (direction, factor))
        density = jnp.where(on, jnp.inf, density)
    return direction, factor, density

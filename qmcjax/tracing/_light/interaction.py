"""Surface interactions: the surface that a ray hits, its material and the emitted radiance."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.plug_ins import unwrap
from qmcjax.tracing._light.illumination import shining
from qmcjax.tracing._search.intersection import Intersection, coordinates, intersect
from qmcjax.tracing._shapes.object import Object
from qmcjax.tracing._shapes.vectors import Vector, dot, each, plus, where
from qmcjax.tracing._world.materials import Surface
from qmcjax.tracing._world.world import World

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
    """Return the surface at each hit; all its values are 0 where nothing, or a light, is hit."""
    textured = [_textured(item.material) for item, _ in world.numbered()]
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
    radiance, density = shining(world, at.hit, origin, normal, direction)
    if at.surface.emission is not None:
        radiance = plus(radiance, at.surface.emission)
    return radiance, density


def any_of(color: Vector) -> Array:
    """Return where a colour is not black."""
    return (color[0] > 0) | (color[1] > 0) | (color[2] > 0)


def scatters(world: World) -> bool:
    """Whether any surface scatters light in random directions."""
    return any(kind.diffuse is not None or kind.glossy is not None for kind in kinds(*world.objects))


def mixed(world: World) -> bool:
    """Whether any surface has two lobes."""
    return any(kind.diffuse is not None and kind.glossy is not None for kind in kinds(*world.objects))


def kinds(*objects: Object) -> list[Surface]:
    """Return which components the surfaces of objects may have; None is for those they never have."""
    number = jax.ShapeDtypeStruct((1,), jnp.float32)
    return [jax.eval_shape(partial(_at, item.material), number, number, number) for item in objects]


def _textured(material: Any) -> bool:
    """Whether a material may depend on coordinates."""
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

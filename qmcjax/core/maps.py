"""Area-preserving maps from the unit square to the disc and to cones of directions, and their inverses.

Coordinates are arrays of one shape, one for each axis. Derivatives are finite everywhere: roots and quotients
are guarded where they would be infinite or 0 / 0.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.bits import below_one


def disc(u: Any, v: Any) -> tuple[Array, Array]:
    """Return points of the unit disc: squares map to rings [1]_.

    References
    ----------
    .. [1] P. Shirley, K. Chiu, "A Low Distortion Map Between Disk and Square", 1997.
    """
    a, b = 2 * u - 1, 2 * v - 1
    wide = abs(a) > abs(b)
    radius, other = jnp.where(wide, a, b), jnp.where(wide, b, a)
    turned = np.pi / 4 * other / jnp.where(radius == 0, 1, radius)
    x, y = radius * jnp.cos(turned), radius * jnp.sin(turned)
    return jnp.where(wide, x, y), jnp.where(wide, y, x)


def disc_inverse(x: Array, y: Array) -> tuple[Array, Array]:
    """Invert :func:`disc`."""
    wide = abs(x) > abs(y)
    most, least = jnp.where(wide, x, y), jnp.where(wide, y, x)
    length = jnp.sqrt(jnp.maximum(x * x + y * y, jnp.finfo(x.dtype).tiny))
    radius = jnp.where(most < 0, -length, length)
    other = radius * (4 / np.pi * jnp.arctan(least / jnp.where(most == 0, 1, most)))
    return to_cube((jnp.where(wide, radius, other) + 1) / 2), to_cube(
        (jnp.where(wide, other, radius) + 1) / 2
    )


def cone(u: Any, v: Any, lost: Any) -> tuple[Array, Array, Array]:
    """Return unit vectors uniformly in a cone around z; ``lost`` is one minus the cosine of its half angle.

    v = 1 maps to its edge. With ``lost`` 2 the cone is the sphere.
    """
    below = v * lost
    radius = jnp.sqrt(jnp.maximum(below * (2 - below), jnp.finfo(below.dtype).tiny))
    angle = 2 * np.pi * u
    return radius * jnp.cos(angle), radius * jnp.sin(angle), 1 - below


def sphere_inverse(x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """Invert :func:`cone` for the sphere; 1 - z would lose the digits of v at the pole."""
    squared = x * x + y * y
    polar = squared == 0
    turn = jnp.arctan2(jnp.where(polar, 0, y), jnp.where(polar, 1, x)) / (2 * np.pi)
    half = squared / (2 * (1 + abs(z)))
    return to_cube(jnp.where(turn < 0, turn + 1, turn)), to_cube(jnp.where(z < 0, 1 - half, half))


def to_cube(coordinate: Array) -> Array:
    """Clamp a coordinate that rounding moved out of [0, 1) to the nearest number in it."""
    return jnp.clip(coordinate, 0, below_one(coordinate.dtype))

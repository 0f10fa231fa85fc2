"""Area-preserving maps of the unit square: to lenses, hemispheres and cones."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.tracing._shapes.vectors import Vector, plus, tangents, times


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


def polygon(u: Any, v: Any, sides: int) -> tuple[Array, Array]:
    """Return points of the regular polygon inscribed in the unit circle, with a corner at (0, 1).

    u goes around and v outward: the triangles of the sides get equal parts of u, and the layers of a triangle
    an area in proportion to v.
    """
    place = u * sides
    side = jnp.floor(place)
    along, radius = place - side, jnp.sqrt(v)

    def corner(number: Any) -> tuple[Any, Any]:
        angle = 2 * np.pi / sides * number
        return jnp.sin(angle), jnp.cos(angle)

    (x0, y0), (x1, y1) = corner(side), corner(side + 1)
    return radius * (x0 + along * (x1 - x0)), radius * (y0 + along * (y1 - y0))


def hemisphere(u: Any, v: Any) -> tuple[Vector, Array]:
    """Return unit vectors around z with density cos / pi, and their cosines [Malley]."""
    x, y = disc(u, v)
    # On the rim the derivative of a root of 0 would be infinite.
    z = jnp.sqrt(jnp.maximum(1 - x * x - y * y, jnp.finfo(u.dtype).eps))
    return (x, y, z), z


def cone(u: Any, v: Any, lost: Any) -> Vector:
    """Return unit vectors uniformly in a cone around z; ``lost`` is one minus the cosine of its half angle.

    v = 1 maps to its edge.
    """
    below = v * lost
    radius = jnp.sqrt(jnp.maximum(below * (2 - below), jnp.finfo(below.dtype).tiny))
    angle = 2 * np.pi * u
    return radius * jnp.cos(angle), radius * jnp.sin(angle), 1 - below


def around(local: Vector, normal: Vector) -> Vector:
    """Rotate vectors from around z to around a unit vector."""
    one, other = tangents(normal)
    return plus(plus(times(local[0], one), times(local[1], other)), times(local[2], normal))

"""Maps of the unit square to lenses and hemispheres; those to the disc and to cones are in the core."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.maps import disc
from qmcjax.tracing._shapes.vectors import Vector, plus, tangents, times


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
    # The cosine divides radiance: next to the rim it is kept away from 0, and the root from its pole.
    z = jnp.sqrt(jnp.maximum(1 - x * x - y * y, jnp.finfo(u.dtype).eps))
    return (x, y, z), z


def around(local: Vector, normal: Vector) -> Vector:
    """Rotate vectors from around z to around a unit vector."""
    one, other = tangents(normal)
    return plus(plus(times(local[0], one), times(local[1], other)), times(local[2], normal))

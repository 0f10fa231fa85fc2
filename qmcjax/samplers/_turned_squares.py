"""The square in coordinates in which it turns: maps of the unit square to itself that keep areas.

The points at the same distance from the centre, the largest of both coordinates' distances, are the outline
of a square. A turn moves all of them along their outline by the same part of its length. It is continuous,
keeps areas and neighbourhoods, and a turn by a quarter is a rotation.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.bits import high_product

_HALF = np.uint32(2**31)


def to_outlines(points: Any) -> tuple[Any, Any]:
    """Return the half sides of the outlines, and the places on them, in [0, 1], of points (..., 2).

    NumPy or JAX arrays; differentiable.
    """
    xp: Any = np if isinstance(points, np.ndarray) else jnp
    a, b = 2 * points[..., 0] - 1, 2 * points[..., 1] - 1
    radius = xp.maximum(xp.abs(a), xp.abs(b))
    right, above, left = a >= xp.abs(b), b > xp.abs(a), -a >= xp.abs(b)
    along = xp.select([right, above, left], [b, -a, -b], a) / xp.where(radius > 0, radius, 1)
    return radius, (xp.select([right, above, left], [0, 1, 2], 3) + (along + 1) / 2) / 4


def from_outlines(radius: Any, place: Any) -> Any:
    """Return points (..., 2) from half sides in [0, 1], and places on outlines modulo 1; differentiable."""
    xp: Any = np if isinstance(radius, np.ndarray) else jnp
    turned = 4 * (place - xp.floor(place))
    quarter = xp.floor(turned)
    along = (2 * (turned - quarter) - 1) * radius
    x = xp.select([quarter == 0, quarter == 1, quarter == 2], [radius, -along, -radius], along)
    y = xp.select([quarter == 0, quarter == 1, quarter == 2], [along, radius, -along], -radius)
    return (xp.stack([x, y], axis=-1) + 1) / 2


def coordinate(area: Array, place: Array, axis: int) -> Array:
    """Return one coordinate of points, all as uint32 fractions, rounded down.

    A square root of float64 is the only operation that is not one of integers: the same bits everywhere.
    """
    with jax.enable_x64(True):
        radius = jnp.sqrt(area.astype(jnp.float64) * np.float64(2.0**32)).astype(jnp.uint32)
    quarter, along = place >> 30, place << 2
    half = radius >> 1
    # On the outline's side of the axis, or along the outline; the opposite sides mirror them.
    side = _HALF + half
    inner = (_HALF - half) + high_product(radius, along)
    one = jnp.where((quarter & np.uint32(1)) == np.uint32(axis), side, inner)
    negative = (quarter == 2) | (quarter == (np.uint32(1), np.uint32(3))[axis])
    return jnp.where(negative, ~one, one)

"""Vectors of space as tuples of their three components.

Arrays with a last axis of 3 do not fill SIMD registers; three arrays do, and computations with them fuse into
one loop over rays.
"""

from collections.abc import Callable
from functools import partial, reduce
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.maps import disc

Vector = tuple[Any, Any, Any]


def components(array: Array) -> Vector:
    """Return the components of vectors, shape (..., 3)."""
    return array[..., 0], array[..., 1], array[..., 2]


def stacked(a: Vector) -> Array:
    """Return vectors as one array of shape (..., 3)."""
    return jnp.stack(jnp.broadcast_arrays(*a), axis=-1)


def each(function: Callable[..., Any], *vectors: Vector) -> Vector:
    """Apply a function to corresponding components."""
    x, y, z = zip(*vectors, strict=True)
    return function(*x), function(*y), function(*z)


def where(here: Any, one: Any, other: Any) -> Any:
    """Return one of two pytrees where a condition holds, else the other."""
    return jax.tree.map(partial(jnp.where, here), one, other)


def keep(here: Any, a: Vector) -> Vector:
    """Return vectors where a condition holds, else 0."""
    return each(lambda part: jnp.where(here, part, 0), a)


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def times(factor: Any, a: Vector) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def along(origin: Vector, distance: Any, direction: Vector) -> Vector:
    """Return points of rays."""
    return plus(origin, times(distance, direction))


def dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def largest(a: Vector) -> Any:
    """Return the largest absolute value of a component."""
    return jnp.maximum(jnp.maximum(abs(a[0]), abs(a[1])), abs(a[2]))


def length(a: Vector) -> Any:
    return jnp.sqrt(dot(a, a))


def scaled(*vectors: Vector) -> tuple[Array, list[Vector]]:
    """Return a power of two, and vectors times it, with the largest component in [1, 2).

    Fourth powers of these are in the range of floats. Results have the same mantissas as without scaling.
    """
    size = jnp.asarray(jax.lax.stop_gradient(reduce(jnp.maximum, map(largest, vectors))))
    integer, one = (np.uint32, 0x3F800000) if size.dtype == jnp.float32 else (np.uint64, 0x3FF << 52)
    least = one & -one
    # Exponents of subnormal numbers, and of those with a subnormal inverse, are clamped.
    bits = jax.lax.bitcast_convert_type(size, integer) & integer(2 * one + least)
    bits = jnp.clip(bits, integer(least), integer(2 * one - least))
    scale = jax.lax.bitcast_convert_type(integer(2 * one) - bits, size.dtype)
    return scale, [times(scale, a) for a in vectors]


def unit(a: Vector) -> Vector:
    """Return vectors of length 1; zero vectors stay zero."""
    squared = dot(a, a)
    return times(1 / jnp.sqrt(jnp.where(squared > 0, squared, 1)), a)


def tangents(normal: Vector) -> tuple[Vector, Vector]:
    """Return two unit vectors that form a right-handed frame with a unit vector [Duff et al. 2017]."""
    x, y, z = normal
    sign = jnp.where(z >= 0, 1, -1).astype(z.dtype)
    a = -1 / (sign + z)
    b = x * y * a
    return (1 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)


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


def duals(u: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Return the dual vectors of two edges: product 1 with one edge, 0 with the other and the normal."""
    normal = cross(u, v)
    squared = dot(normal, normal)
    squared = 1 / jnp.where(squared > 0, squared, 1)
    return times(squared, cross(v, normal)), times(squared, cross(normal, u))


def shares(start: Vector, u: Vector, v: Vector) -> tuple[Array, Array]:
    """Return the coefficients of two edges in a vector, apart from its component along the normal."""
    one, other = duals(u, v)
    return dot(start, one), dot(start, other)


def turn(a: Any, b: Any) -> Any:
    """Return the angle of (a, b) in turns, in [0, 1]; 0, with no derivative, for (0, 0)."""
    nowhere = (a == 0) & (b == 0)
    angle = jnp.arctan2(jnp.where(nowhere, 0, b), jnp.where(nowhere, 1, a)) / (2 * jnp.pi)
    return jnp.where(angle < 0, angle + 1, angle)

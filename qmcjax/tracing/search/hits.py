"""The nearest hit of rays, differentiable, and tests for any hit."""

from __future__ import annotations

from functools import reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import floats
from qmcjax.core.pytrees import jit
from qmcjax.tracing._shapes.vectors import components, scaled, stacked
from qmcjax.tracing._world.world import World, as_world
from qmcjax.tracing.search.intersection import in_dtype, intersect, search


class Hit(NamedTuple):
    """The nearest hits of rays."""

    distance: Array
    """(...): in units of the direction's length, inf without a hit."""
    shape: Array
    """int32 (...): the number of the primitive, -1 without a hit."""
    normal: Array
    """(..., 3): unit vectors, outward for closed shapes; zeros without a hit."""
    point: Array
    """(..., 3): on the surface up to the rounding of its own coordinates, at any distance; the origin without
    a hit."""


def nearest_hit(world: World, origin: ArrayLike, direction: ArrayLike, time: ArrayLike = 0.0) -> Hit:
    """Find the nearest hits of rays.

    A ray that starts on a surface, up to about 16 units of rounding of its coordinates (also in object
    space), does not hit it there: use ``hit.point`` as the origin of the next ray. In float32, keep objects
    larger than about 1/1000 of their distance from the coordinate origin: at that size about 2 % of the rays
    into a mesh miss its other side, and more for smaller boxes and cylinders. Rays with non-finite numbers or
    a zero direction hit nothing. Directions must be at least 1e-30 long, in float64 1e-292; shorter ones
    raise an error. While a program is traced, the length is unknown: small components of shorter directions
    count as 0.

    Parameters
    ----------
    world : World
    origin, direction : float ArrayLike, shape (..., 3)
        Directions need not be normalized.
    time : float ArrayLike, shape (...)
        In [0, 1], from the opening to the closing of the shutter. Shapes are broadcast.

    Returns
    -------
    Hit
        Distance, normal and point have the dtype of ``origin``, float32 or float64, and first derivatives
        with respect to rays and world; the choice of the primitive has no derivative.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> ball = tracing.world([tracing.sphere([0, 0, 5], 1.0)])
    >>> hit = nearest_hit(ball, [0.0, 0, 0], [0.0, 0, 1])
    >>> print(hit.distance, hit.shape, hit.normal)
    4.0 0 [ 0.  0. -1.]
    """
    shape, rays = flat_rays(world, origin, direction, time)
    hit = _nearest(world, *rays)
    return Hit(*(a.reshape(*shape, *a.shape[1:]) for a in hit))


def any_hit(
    world: World, origin: ArrayLike, direction: ArrayLike, time: ArrayLike = 0.0, limit: ArrayLike = jnp.inf
) -> Array:
    """Return whether rays hit anything before a limit.

    Parameters
    ----------
    world : World
    origin, direction : float ArrayLike, shape (..., 3)
    time : float ArrayLike, shape (...)
    limit : float ArrayLike, shape (...)
        In units of the direction's length; a hit at the limit does not count.

    Returns
    -------
    bool Array, shape (...)

    Examples
    --------
    >>> from qmcjax import tracing
    >>> ball = tracing.world([tracing.sphere([0, 0, 5], 1.0)])
    >>> print(any_hit(ball, [0.0, 0, 0], [0.0, 0, 1], 0.0, jnp.array([3.0, 5.0])))
    [False  True]
    """
    shape, rays = flat_rays(world, origin, direction, time, limit)
    return _any(world, *rays).reshape(shape)


def flat_rays(
    world: Any, origin: Any, direction: Any, *others: Any
) -> tuple[tuple[int, ...], tuple[Array, ...]]:
    """Return the shape of rays, and their numbers in one dtype and shape: (n, 3) twice, (n,)."""
    as_world(world)
    given = {"origin": origin, "direction": direction, **dict(zip(("time", "limit"), others, strict=False))}
    last = {"origin": (3,), "direction": (3,)}
    arrays = {name: floats(name, value, last.get(name, ()), finite=False) for name, value in given.items()}
    dtype = arrays["origin"].dtype
    _check_lengths(direction, dtype)
    leading = {name: a.shape[: a.ndim - (name in last)] for name, a in arrays.items()}
    try:
        shape = jnp.broadcast_shapes(*leading.values())
    except ValueError:
        raise ValueError(f"shapes of rays must broadcast, got {leading}") from None
    flat = (
        jnp.broadcast_to(a, (*shape, *a.shape[len(leading[name]) :]))
        .astype(dtype)
        .reshape(-1, *a.shape[len(leading[name]) :])
        for name, a in arrays.items()
    )
    return shape, tuple(flat)


def _check_lengths(direction: Any, dtype: np.dtype) -> None:
    """Raise a ValueError if a direction is known to be too long, or so short that programs lose components.

    Programs flush subnormal numbers to 0.
    """
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(direction)):
        return
    # Component by component: the last axis is short.
    size = reduce(np.maximum, (abs(np.asarray(direction)[..., j]) for j in range(3)))
    least, most = np.finfo(dtype).tiny / np.finfo(dtype).eps, np.finfo(dtype).max
    if np.any((size > 0) & (size < least) | (size > most) & (size < np.inf)):
        raise ValueError(
            f"direction must have a largest component in [{least:.3g}, {most:.3g}], or be 0, got "
            f"{checks.shown(direction)}"
        )


@jit()
def _any(world: World, origin: Array, direction: Array, time: Array, limit: Array) -> Array:
    scale, (vector,) = scaled(components(direction))
    rays = components(origin), vector, time, limit / scale
    return search(in_dtype(world, origin.dtype), *jax.lax.stop_gradient(rays), True)[1] >= 0


@jit()
def _nearest(world: World, origin: Array, direction: Array, time: Array) -> Hit:
    scale, (vector,) = scaled(components(direction))
    at = intersect(in_dtype(world, origin.dtype), components(origin), vector, time)
    distance = jnp.where(at.valid, at.distance * scale, jnp.inf)
    point = jnp.where(at.valid[:, None], stacked(at.point), origin)
    return Hit(distance, at.number, stacked(at.normal), point)

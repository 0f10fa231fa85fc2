"""The nearest hit of rays, differentiable, and whether there is any."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import cast
from qmcjax.core.pytrees import jit
from qmcjax.tracing._object import Frame, Object, identity
from qmcjax.tracing._search import search
from qmcjax.tracing._vectors import Vector, along, components, dot, each, minus, plus, stacked, times, unit
from qmcjax.tracing._world import World, merged


class Hit(NamedTuple):
    """What rays hit first."""

    distance: Array
    """(...): in lengths of the direction, inf where nothing is hit."""
    shape: Array
    """int32 (...): the number of the primitive, -1 where nothing is hit."""
    normal: Array
    """(..., 3): unit vectors, to the outside of closed shapes; zeros where nothing is hit."""
    point: Array
    """(..., 3): on the surface up to the rounding of its own coordinates, however far the origin is; the
    origin where nothing is hit."""


def nearest_hit(world: World, origin: ArrayLike, direction: ArrayLike, time: ArrayLike = 0.0) -> Hit:
    """Find what rays hit first.

    An origin that is on a surface, up to about 16 units of rounding of its coordinates (also of those in the
    space of the object), does not hit it there: ``hit.point`` can be the origin of the next ray. In float32
    that wants objects no smaller than about a thousandth of their distance from the origin of coordinates:
    there about 2 % of the rays into a mesh miss its other side, and of smaller boxes and cylinders more.
    Rays whose numbers are not finite, and those with a direction of zero length, hit nothing.

    Parameters
    ----------
    world : World
    origin, direction : float ArrayLike, shape (..., 3)
        Directions need no unit length.
    time : float ArrayLike, shape (...)
        In [0, 1], from when the shutter opens to when it closes. Shapes are broadcast.

    Returns
    -------
    Hit
        Distance, normal and point have the dtype of ``origin``, float32 or float64, and first derivatives in
        all numbers of rays and world; those of which primitive is hit are zero.

    Raises
    ------
    TypeError
        If an argument has another type.
    ValueError
        If shapes do not fit.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> ball = tracing.world([tracing.sphere([0, 0, 5], 1.0)])
    >>> hit = nearest_hit(ball, [0.0, 0, 0], [0.0, 0, 1])
    >>> print(hit.distance, hit.shape, hit.normal)
    4.0 0 [ 0.  0. -1.]
    """
    shape, rays = _rays(world, origin, direction, time)
    hit = _nearest(world, *rays)
    return Hit(*(a.reshape(*shape, *a.shape[1:]) for a in hit))


def any_hit(
    world: World, origin: ArrayLike, direction: ArrayLike, time: ArrayLike = 0.0, limit: ArrayLike = jnp.inf
) -> Array:
    """Tell whether rays hit anything before a limit.

    Parameters
    ----------
    world : World
    origin, direction : float ArrayLike, shape (..., 3)
    time : float ArrayLike, shape (...)
    limit : float ArrayLike, shape (...)
        In lengths of the direction; a hit at the limit does not count.

    Returns
    -------
    bool Array, shape (...)

    Raises
    ------
    TypeError
        If an argument has another type.
    ValueError
        If shapes do not fit.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> ball = tracing.world([tracing.sphere([0, 0, 5], 1.0)])
    >>> print(any_hit(ball, [0.0, 0, 0], [0.0, 0, 1], 0.0, jnp.array([3.0, 5.0])))
    [False  True]
    """
    shape, rays = _rays(world, origin, direction, time, limit)
    return _any(world, *rays).reshape(shape)


def _rays(world: Any, origin: Any, direction: Any, *others: Any) -> tuple[tuple[int, ...], tuple[Array, ...]]:
    """Return the shape of rays, and their numbers in one dtype and shape: (n, 3) twice, (n,)."""
    if not isinstance(world, World):
        raise TypeError(f"world must be made by qmcjax.tracing.world, got {checks.shown(world)}")
    given = {"origin": origin, "direction": direction, **dict(zip(("time", "limit"), others, strict=False))}
    arrays = {name: _floats(name, value) for name, value in given.items()}
    for name in ("origin", "direction"):
        if arrays[name].shape[-1:] != (3,):
            raise ValueError(f"{name} must have shape (..., 3), got {arrays[name].shape}")
    dtype = arrays["origin"].dtype
    leading = {name: a.shape[: a.ndim - (name in ("origin", "direction"))] for name, a in arrays.items()}
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


def _floats(name: str, value: Any) -> Array:
    try:
        array = jnp.asarray(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be real numbers, got {checks.shown(value)}") from None
    if jnp.issubdtype(array.dtype, jnp.integer):
        array = array.astype(jnp.float32)
    if array.dtype not in (jnp.float32, jnp.float64):
        raise TypeError(f"{name} must be float32 or float64, got {checks.shown(value)}")
    return array


def _in(world: World, dtype: Any) -> World:
    """Return a world with the numbers of shapes in a dtype."""
    objects = (Object(cast(item.shapes, dtype), item.motion, None) for item in world.objects)
    return World(tuple(objects), ())


@jit()
def _any(world: World, origin: Array, direction: Array, time: Array, limit: Array) -> Array:
    rays = components(origin), components(direction), time, limit
    return search(_in(world, origin.dtype), *jax.lax.stop_gradient(rays), True)[1] >= 0


@jit()
def _nearest(world: World, origin: Array, direction: Array, time: Array) -> Hit:
    world = _in(world, origin.dtype)
    start, way = components(origin), components(direction)
    fixed = jax.lax.stop_gradient((world, start, way, time, jnp.full_like(time, jnp.inf)))
    distance, number = search(*fixed, False)
    hit = number >= 0
    # Rays that hit nothing, also those of NaN, go on as rays without numbers that could disturb derivatives.
    start, way = (each(lambda a: jnp.where(hit, a, 0), vector) for vector in (start, way))
    at, distance = jnp.where(hit, time, 0), jnp.where(hit, distance, 0)
    frame = _frame(world, number, at)
    if frame is not None:
        start, way = frame.inside(minus(start, frame.translation)), frame.inside(way)
    surface = partial(_surface, world, number, at)
    # A Newton step: the value is 0 but for rounding, and its derivatives are those of the distance.
    value, gradient = surface(along(start, distance, way))
    slope = dot(gradient, way)
    step = value / jnp.where(slope == 0, 1, slope)
    distance = distance - (step - jax.lax.stop_gradient(step))
    # To the surface on the shortest way: no farther from it than its coordinates are rounded.
    point = along(start, distance, way)
    value, gradient = surface(point)
    squared = dot(gradient, gradient)
    point = minus(point, times(value / jnp.where(squared == 0, 1, squared), gradient))
    if frame is not None:
        point, gradient = plus(frame.outside(point), frame.translation), frame.normal(gradient)
    distance = jnp.where(hit, distance, jnp.inf)
    normal = stacked(unit(gradient))
    return Hit(distance, number, normal, jnp.where(hit[:, None], stacked(point), origin))


def _frame(world: World, number: Array, time: Array) -> Frame | None:
    """Return for each ray the map to the world of the object that it hits; None if all are still."""
    chosen = None
    for item, first in world.numbered():
        frame = item.frame(time)
        if frame is not None:
            here = (number >= first) & (number < first + item.count)
            chosen = identity(time) if chosen is None else chosen
            chosen = jax.tree.map(partial(jnp.where, here), frame, chosen)
    return chosen


def _surface(world: World, number: Array, time: Array, point: Vector) -> tuple[Array, Vector]:
    """Return the functions and gradients of the surfaces of each ray's primitive; zeros if it has none."""
    shapes = [shape for shape, _ in world.batches()]
    if not shapes:
        return jnp.zeros_like(time), each(jnp.zeros_like, point)
    starts = np.array([start for _, start in world.batches()], np.int32)
    batch = jnp.searchsorted(starts, number, side="right") - 1
    value, gradient = jnp.zeros_like(time), each(jnp.zeros_like, point)
    for shape, places in merged(shapes):
        # Rows of the merged shape minus numbers in the world, for batches of this kind.
        before = np.cumsum([0, *(shapes[place].count for place in places[:-1])])
        shift, mine = np.zeros(len(shapes), np.int32), np.zeros(len(shapes), bool)
        shift[places], mine[places] = before - starts[places], True
        here = (number >= 0) & jnp.asarray(mine)[batch]
        row = jnp.clip(number + jnp.asarray(shift)[batch], 0, shape.count - 1)
        new = shape.surface(row, point, time)
        value = jnp.where(here, new[0], value)
        gradient = each(partial(jnp.where, here), new[1], gradient)
    return value, gradient

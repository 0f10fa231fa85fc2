"""The walk through a tree of triangles as a loop for each ray, compiled by Numba for CPUs.

Tree, boxes and tests are those of :func:`qmcjax.tracing.search.program.walk`. There all rays of a tile wait
for the slowest; here each visits the nearer child of a node first, and keeps the other on a stack.

The call uses ``buffer_callback``, which passes the memory of the program. ``jax.pure_callback`` copies to a
device: that waits for a thread, and deadlocks if all threads run programs that wait for such calls (seen in
JAX 0.10 on one core, and where devices share a program). Threads take pieces of the rays as they become free.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numba  # pyright: ignore[reportMissingImports]
import numpy as np
from jax import Array
from jax.experimental.buffer_callback import buffer_callback

from qmcjax.tracing._shapes import vectors
from qmcjax.tracing._shapes.object import SLACK, Rays
from qmcjax.tracing.search.program import Walkable

_PIECE = 2048
"""Rays per piece of work of a thread."""

_DEPTH = 64
"""Maximum number of nodes on a path."""


def walk(tree: Walkable, rays: Rays, limit: Array, any_hit: bool) -> tuple[Array, Array]:
    """Return the distances of hits before the limits, and rows of sorted triangles; -1 without a hit."""
    result = jax.ShapeDtypeStruct(limit.shape, limit.dtype), jax.ShapeDtypeStruct(limit.shape, jnp.int32)
    corners = jnp.concatenate([vertices.reshape(-1, 9) for vertices in tree.vertices], axis=1)
    given = *rays.origin, *rays.direction, rays.time, rays.slack, limit
    call = buffer_callback(partial(_fill, any_hit), result, vmap_method="expand_dims")
    world = tree.boxes, corners, tree.skip, tree.start, tree.slack[None]
    return call(*jax.lax.stop_gradient((world, given)))


def _fill(any_hit: bool, context: Any, out: Any, world: Any, rays: Any) -> None:
    """Search; under vmap in each world."""
    distances, rows = map(np.asarray, out)
    mapped = distances.shape[:-1]

    def at(arrays: Any, axes: tuple[int, ...], index: tuple[int, ...]) -> tuple[Any, ...]:
        known = [(np.asarray(a), count) for a, count in zip(arrays, axes, strict=True)]
        return tuple(np.broadcast_to(a, mapped + a.shape[a.ndim - count :])[index] for a, count in known)

    for index in np.ndindex(mapped):
        tree, given = at(world, (2, 2, 1, 1, 1), index), at(rays, (1,) * 9, index)
        run = partial(_piece, tree, given, any_hit, distances[index], rows[index])
        pieces = range(0, distances.shape[-1], _PIECE)
        list(_pool().map(run, pieces) if len(pieces) > 1 else map(run, pieces))


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count(), "qmcjax")


def _piece(tree: Any, rays: Any, any_hit: bool, distances: Any, rows: Any, first: int) -> None:
    here, number = slice(first, first + _PIECE), distances.dtype.type
    constants = _Constants(number(0), number(1), number(np.inf), number(SLACK * np.finfo(number).eps))
    _search(tree, tuple(a[here] for a in rays), constants, any_hit, distances[here], rows[here])


def _compiled(**options: Any) -> Any:
    """Compile at the first call, and cache the result on disk where possible.

    Products and sums are not contracted: watertight triangles depend on it.
    """

    def decorate(function: Any) -> Any:
        try:
            return numba.njit(cache=True, error_model="numpy", **options)(function)
        except RuntimeError:  # No writable folder for it.
            return numba.njit(error_model="numpy", **options)(function)

    return decorate


_inlined = _compiled(forceinline=True, _nrt=False)
_minus, _times, _dot, _cross = map(_inlined, (vectors.minus, vectors.times, vectors.dot, vectors.cross))


class _Constants(NamedTuple):
    """In the type of the rays: a literal would make the rest double."""

    zero: Any
    one: Any
    never: Any
    unit: Any
    """The slack of a coordinate of 1."""


class _Ray(NamedTuple):
    """A ray with what all tests share."""

    inverse: Any
    """Reciprocals of the direction's components."""
    near: Any
    """Columns of the planes of a box that the ray meets first."""
    over: Any
    """From where it meets them, and the others: the origin, which is as wide as rounding."""
    under: Any
    axes: Any
    """Rotated so that the largest component of the direction is the last; so are origin and shear."""
    origin: Any
    shear: Any
    time: Any
    slack: Any


@_inlined
def _ray(rays, i, wider, c):
    ox, oy, oz, dx, dy, dz, times, slacks, _ = rays
    origin, direction = (ox[i], oy[i], oz[i]), (dx[i], dy[i], dz[i])
    # Not -inf for -0: then the nearest plane would be the farthest.
    inverse = (
        c.one / direction[0] if direction[0] != 0 else c.never,
        c.one / direction[1] if direction[1] != 0 else c.never,
        c.one / direction[2] if direction[2] != 0 else c.never,
    )
    near = 0 if inverse[0] > 0 else 3, 1 if inverse[1] > 0 else 4, 2 if inverse[2] > 0 else 5
    aside = (
        wider if near[0] == 0 else -wider,
        wider if near[1] == 1 else -wider,
        wider if near[2] == 2 else -wider,
    )
    over = origin[0] + aside[0], origin[1] + aside[1], origin[2] + aside[2]
    x, y, z = abs(direction[0]), abs(direction[1]), abs(direction[2])
    axes, turned, shear = (
        (0, 1, 2),
        origin,
        (-direction[0] * inverse[2], -direction[1] * inverse[2], inverse[2]),
    )
    if not (z >= x and z >= y):
        if x >= y:
            axes, turned = (1, 2, 0), (origin[1], origin[2], origin[0])
            shear = -direction[1] * inverse[0], -direction[2] * inverse[0], inverse[0]
        else:
            axes, turned = (2, 0, 1), (origin[2], origin[0], origin[1])
            shear = -direction[2] * inverse[1], -direction[0] * inverse[1], inverse[1]
    return _Ray(inverse, near, over, _minus(origin, aside), axes, turned, shear, times[i], slacks[i])


@_inlined
def _number(table, row, column, half, time, c):
    """Return a number of a table; those of the end of the shutter, if any, are in its right half."""
    if table.shape[1] == half:
        return table[row, column]
    return (c.one - time) * table[row, column] + time * table[row, half + column]


@_inlined
def _enter(boxes, node, ray, limit, c):
    """Return where a ray enters a box before a limit; infinity if it does not. NaN is between planes."""
    enter, leave, slower = c.zero, limit * (c.one + c.unit), c.one + c.unit
    near = (_number(boxes, node, ray.near[0], 6, ray.time, c) - ray.over[0]) * ray.inverse[0]
    far = (_number(boxes, node, 3 - ray.near[0], 6, ray.time, c) - ray.under[0]) * ray.inverse[0]
    enter, leave = near if near > enter else enter, far if far < leave else leave
    near = (_number(boxes, node, ray.near[1], 6, ray.time, c) - ray.over[1]) * ray.inverse[1]
    far = (_number(boxes, node, 5 - ray.near[1], 6, ray.time, c) - ray.under[1]) * ray.inverse[1]
    enter, leave = near if near > enter else enter, far if far < leave else leave
    near = (_number(boxes, node, ray.near[2], 6, ray.time, c) - ray.over[2]) * ray.inverse[2]
    far = (_number(boxes, node, 7 - ray.near[2], 6, ray.time, c) - ray.under[2]) * ray.inverse[2]
    enter, leave = near if near > enter else enter, far if far < leave else leave
    # The products are rounded, too.
    return enter if enter <= leave * slower else c.never


@_inlined
def _corner(corners, row, k, ray, c):
    """Return a corner with rotated axes."""
    return (
        _number(corners, row, 3 * k + ray.axes[0], 9, ray.time, c),
        _number(corners, row, 3 * k + ray.axes[1], 9, ray.time, c),
        _number(corners, row, 3 * k + ray.axes[2], 9, ray.time, c),
    )


@_inlined
def _distance(corners, row, ray, limit, c):
    """Return the distance of a hit before a limit, else infinity: ``Triangles.distance``."""
    one, two, three = (
        _corner(corners, row, 0, ray, c),
        _corner(corners, row, 1, ray, c),
        _corner(corners, row, 2, ray, c),
    )
    a, b, d = _minus(one, ray.origin), _minus(two, ray.origin), _minus(three, ray.origin)
    x, y, z = ray.shear
    ax, ay, az = a[0] + x * a[2], a[1] + y * a[2], z * a[2]
    bx, by, bz = b[0] + x * b[2], b[1] + y * b[2], z * b[2]
    dx, dy, dz = d[0] + x * d[2], d[1] + y * d[2], z * d[2]
    u0, u1, v0, v1, w0, w1 = dx * by, dy * bx, ax * dy, ay * dx, bx * ay, by * ax
    u, v, w = u0 - u1, v0 - v1, w0 - w1
    total = u + v + w
    inside = (u0 >= u1 and v0 >= v1 and w0 >= w1) or (u0 <= u1 and v0 <= v1 and w0 <= w1)
    if not inside or total == 0:
        return c.never
    distance = min(max((u * az + v * bz + w * dz) / total, min(az, bz, dz)), max(az, bz, dz))
    if not (distance > 0 and distance < limit) or _is_on(one, two, three, a, ray.slack, c):
        return c.never
    return distance


@_inlined
def _size(a):
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@_inlined
def _is_on(one, two, three, start, slack, c):
    """Return whether the origin is on a triangle: ``triangles._origin_on``."""
    side, across = _minus(two, one), _minus(three, one)
    size = max(_size(side), _size(across))
    if not size > 0:
        return False
    scale = c.one / size
    slack = scale * (slack + c.unit * (_size(one) + _size(two) + _size(three)))
    side, across, start = _times(scale, side), _times(scale, across), _times(scale, start)
    normal = _cross(side, across)
    squared, height = _dot(normal, normal), _dot(normal, start)
    if not (squared > 0 and height * height <= slack * slack * squared):
        return False
    p, q = _cross(across, normal), _cross(normal, side)
    u, v = -_dot(start, p) / squared, -_dot(start, q) / squared
    wider = slack * (np.sqrt(_dot(p, p)) + np.sqrt(_dot(q, q))) / squared
    return u >= -wider and v >= -wider and u + v <= c.one + wider


@_inlined
def _walk(tree, ray, limit, any_hit, stack, ahead, c):
    """Return distance and row of the first hit in a tree; the limit and -1 without a hit."""
    boxes, corners, skip, start, _ = tree
    node, waiting, found = 0, 0, -1
    while True:
        if skip[node] != node + 1:
            one, other = node + 1, skip[node + 1]
            near, far = _enter(boxes, one, ray, limit, c), _enter(boxes, other, ray, limit, c)
            if near > far:
                one, other, near, far = other, one, far, near
            if near < c.never:
                if far < c.never:
                    stack[waiting], ahead[waiting] = other, far
                    waiting += 1
                node = one
                continue
        else:
            for row in range(start[node], start[node + 1]):
                distance = _distance(corners, row, ray, limit, c)
                if distance < limit:
                    limit, found = distance, row
                    if any_hit:
                        return limit, found
        while waiting > 0 and not ahead[waiting - 1] < limit * (c.one + c.unit):
            waiting -= 1
        if waiting == 0:
            return limit, found
        waiting -= 1
        node = stack[waiting]


@_compiled(nogil=True)
def _search(tree, rays, c, any_hit, distances, rows):
    stack, ahead = np.empty(_DEPTH, np.int64), np.empty(_DEPTH, distances.dtype)
    for i in range(len(distances)):
        distances[i], rows[i] = rays[8][i], -1
        if rays[7][i] < c.never and distances[i] > 0:
            ray = _ray(rays, i, rays[7][i] + tree[4][0], c)
            distances[i], rows[i] = _walk(tree, ray, distances[i], any_hit, stack, ahead, c)

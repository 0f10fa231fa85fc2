"""The walk through a tree as loops that Numba compiles: what programs for CPUs call.

Each ray goes to the nearer child first and keeps the other on a stack. The test of a triangle is that of
:class:`qmcjax.tracing.Triangles`, step by step, and without contraction of products and sums; why it is
watertight is told there. Constants have the type of the rays: a literal would make the rest double.
"""

from collections.abc import Callable
from typing import Any

import numba  # pyright: ignore[reportMissingImports]
import numpy as np

_BLOCK = 256
"""Rays that a thread takes at a time."""

_STACK = 128
"""More than the depth of any tree."""


def _compiled(**options: Any) -> Callable[[Any], Any]:
    """Compile at the first call, and keep the result on disk where there is a place for it."""

    def decorate(function: Any) -> Any:
        try:
            return numba.njit(cache=True, error_model="numpy", **options)(function)
        except RuntimeError:  # No folder for it can be written.
            return numba.njit(error_model="numpy", **options)(function)

    return decorate


@_compiled()
def prepare(vertices, order, skip, start):
    """Return triangles in the order of the tree, and for each inner node the boxes of both children.

    ``vertices`` has the shape (n, 9). Boxes come in pairs, (nodes, 12): low and high of the first child, then
    of the second. The last result is the largest absolute coordinate.
    """
    used = skip[0]
    faces = vertices[order]
    boxes = np.empty((used, 6), vertices.dtype)
    pairs = np.empty((used, 12), vertices.dtype)
    for node in range(used - 1, -1, -1):
        other = skip[node + 1]
        for j in range(3):
            if skip[node] > node + 1:
                a, b = boxes[node + 1], boxes[other]
                pairs[node, j], pairs[node, 3 + j] = a[j], a[3 + j]
                pairs[node, 6 + j], pairs[node, 9 + j] = b[j], b[3 + j]
                low, high = min(a[j], b[j]), max(a[3 + j], b[3 + j])
            else:
                low = high = faces[start[node], j]
                for place in range(start[node], start[node + 1]):
                    for k in range(j, 9, 3):
                        low, high = min(low, faces[place, k]), max(high, faces[place, k])
            boxes[node, j], boxes[node, 3 + j] = low, high
    return faces, pairs, np.abs(boxes[0]).max()


@_compiled()
def _at(numbers, close, row, j, time):
    """Return a number at a time between both ends of the shutter."""
    if close is None:
        return numbers[row, j]
    return (numbers.dtype.type(1) - time) * numbers[row, j] + time * close[row, j]


@_compiled()
def _slab(pairs, close, node, j, k, below, above, inverse, time, enter, leave):
    """Narrow where a ray is in a box to where it is between two planes; NaN is between them."""
    one = (_at(pairs, close, node, j + k, time) - above[k]) * inverse[k]
    other = (_at(pairs, close, node, j + k + 3, time) - below[k]) * inverse[k]
    return max(enter, min(one, other)), min(leave, max(one, other))


@_compiled()
def _box(pairs, close, node, j, below, above, inverse, time, limit):
    """Return where a ray enters and leaves the box whose numbers begin at j."""
    zero = pairs.dtype.type(0)
    enter, leave = _slab(pairs, close, node, j, 0, below, above, inverse, time, zero, limit)
    enter, leave = _slab(pairs, close, node, j, 1, below, above, inverse, time, enter, leave)
    return _slab(pairs, close, node, j, 2, below, above, inverse, time, enter, leave)


@_compiled()
def _corner(faces, close, place, j, time, origin):
    """Return a vertex as it is seen from an origin."""
    return (
        _at(faces, close, place, j, time) - origin[0],
        _at(faces, close, place, j + 1, time) - origin[1],
        _at(faces, close, place, j + 2, time) - origin[2],
    )


@_compiled()
def _sheared(corner, shear):
    """Return a vertex with the direction of the ray as third axis."""
    axis, x, y, z = shear
    if axis == 0:
        forth, one, other = corner
    elif axis == 1:
        other, forth, one = corner
    else:
        one, other, forth = corner
    return one + x * forth, other + y * forth, z * forth


@_compiled()
def _distance(faces, close, place, time, origin, shear, slack, unit):
    """Return the distance of a hit, a negative number without one: ``Triangles.distance``."""
    none = faces.dtype.type(-1)
    a, b, c = (
        _corner(faces, close, place, 0, time, origin),
        _corner(faces, close, place, 3, time, origin),
        _corner(faces, close, place, 6, time, origin),
    )
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = _sheared(a, shear), _sheared(b, shear), _sheared(c, shear)
    u0, u1, v0, v1, w0, w1 = cx * by, cy * bx, ax * cy, ay * cx, bx * ay, by * ax
    if not ((u0 >= u1 and v0 >= v1 and w0 >= w1) or (u0 <= u1 and v0 <= v1 and w0 <= w1)):
        return none
    u, v, w = u0 - u1, v0 - v1, w0 - w1
    total = u + v + w
    if total == 0:
        return none
    distance = (u * az + v * bz + w * cz) / total
    distance = min(max(distance, min(az, bz, cz)), max(az, bz, cz))
    if distance > 0 and _starts_on(faces, close, place, time, a, slack, unit):
        return none
    return distance


@_compiled()
def _starts_on(faces, close, place, time, seen, slack, unit):
    """Tell whether the ray starts on the triangle, whose first vertex it sees: ``_triangles._on``."""
    zero = faces.dtype.type(0)
    a, b, c = (
        _corner(faces, close, place, 0, time, (zero, zero, zero)),
        _corner(faces, close, place, 3, time, (zero, zero, zero)),
        _corner(faces, close, place, 6, time, (zero, zero, zero)),
    )
    size = _largest(a) + _largest(b) + _largest(c)
    slack = slack + unit * size
    side, other = _minus(b, a), _minus(c, a)
    normal = _cross(side, other)
    squared = _dot(normal, normal)
    height = _dot(normal, seen)
    if not (squared > 0 and height * height <= slack * slack * squared):
        return False
    p, q = _cross(other, normal), _cross(normal, side)
    u, v = -_dot(seen, p) / squared, -_dot(seen, q) / squared
    wider = slack * (np.sqrt(_dot(p, p)) + np.sqrt(_dot(q, q))) / squared
    return u >= -wider and v >= -wider and u + v <= faces.dtype.type(1) + wider


@_compiled()
def _largest(a):
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@_compiled()
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@_compiled()
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_compiled()
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_compiled()
def _shear(d, one):
    """Return the axis that is most along a ray, and the numbers of ``Triangles.prepare``."""
    x, y, z = abs(d[0]), abs(d[1]), abs(d[2])
    if z >= x and z >= y:
        return 2, -d[0] * (one / d[2]), -d[1] * (one / d[2]), one / d[2]
    if x >= y:
        return 0, -d[1] * (one / d[0]), -d[2] * (one / d[0]), one / d[0]
    return 1, -d[2] * (one / d[1]), -d[0] * (one / d[1]), one / d[1]


@_compiled()
def _walk(
    faces,
    close,
    pairs,
    other_pairs,
    skip,
    start,
    stack,
    ahead,
    origin,
    d,
    time,
    slack,
    limit,
    size,
    unit,
    any_hit,
):
    """Return distance and place of one ray's hit, the limit and -1 without one."""
    one = faces.dtype.type(1)
    place, depth, node = -1, 0, 0
    shear, inverse = _shear(d, one), (one / d[0], one / d[1], one / d[2])
    # The products in slabs are rounded, too, and so are the sums here.
    wider = slack + unit * size
    below = origin[0] - wider, origin[1] - wider, origin[2] - wider
    above = origin[0] + wider, origin[1] + wider, origin[2] + wider
    slower = one + unit
    while True:
        if skip[node] == node + 1:
            for p in range(start[node], start[node + 1]):
                distance = _distance(faces, close, p, time, origin, shear, slack, unit)
                if distance > 0 and distance < limit:
                    limit, place = distance, p
                    if any_hit:
                        return limit, place
        else:
            near, far = node + 1, skip[node + 1]
            enter, leave = _box(pairs, other_pairs, node, 0, below, above, inverse, time, limit * slower)
            other, last = _box(pairs, other_pairs, node, 6, below, above, inverse, time, limit * slower)
            first, second = enter <= leave * slower, other <= last * slower
            if first and second:
                if other < enter:
                    near, far, other = far, near, enter
                stack[depth], ahead[depth] = far, other
                depth += 1
                node = near
                continue
            if first or second:
                node = near if first else far
                continue
        while depth > 0 and ahead[depth - 1] >= limit * slower:
            depth -= 1
        if depth == 0:
            return limit, place
        depth -= 1
        node = stack[depth]


@_compiled(parallel=True)
def walk(
    faces,
    close,
    pairs,
    other_pairs,
    order,
    skip,
    start,
    origin,
    direction,
    time,
    slack,
    limit,
    size,
    unit,
    any_hit,
):
    """Return the distances of the hits of all rays, the limits without one, and the triangles, or -1.

    ``size`` is twice the largest coordinate of a vertex, ``unit`` the slack of a coordinate of 1. With
    ``any_hit`` the first hit that is found counts.
    """
    count = len(time)
    distances, numbers = np.empty(count, limit.dtype), np.empty(count, np.int32)
    for block in numba.prange((count + _BLOCK - 1) // _BLOCK):
        stack, ahead = np.empty(_STACK, np.int32), np.empty(_STACK, limit.dtype)
        for i in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
            distances[i], numbers[i] = limit[i], -1
            if limit[i] > 0 and slack[i] < np.inf:
                o = origin[0][i], origin[1][i], origin[2][i]
                d = direction[0][i], direction[1][i], direction[2][i]
                distances[i], place = _walk(
                    faces,
                    close,
                    pairs,
                    other_pairs,
                    skip,
                    start,
                    stack,
                    ahead,
                    o,
                    d,
                    time[i],
                    slack[i],
                    limit[i],
                    size,
                    unit,
                    any_hit,
                )
                if place >= 0:
                    numbers[i] = order[place]
    return distances, numbers

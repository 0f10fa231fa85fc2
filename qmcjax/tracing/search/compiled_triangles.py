"""Ray-triangle tests, one or eight triangles at a time, for loops compiled by Numba.

A block of eight triangles is 9 rows: the coordinates of their first corners, then the second, then the third.
"""

from qmcjax.tracing.search.compiled_tests import cross, dot, largest, length, minus, power, times, vector
from qmcjax.tracing.search.lanes import inlined, larger, load, smaller

BLOCK = 9
"""Rows of a block."""


@inlined
def shear(d, inverse):
    """Return the axis of the ray's largest component, and the numbers of ``Triangles.prepare``."""
    x, y, z = abs(d[0]), abs(d[1]), abs(d[2])
    if z >= x and z >= y:
        return 2, -d[0] * inverse[2], -d[1] * inverse[2], inverse[2]
    if x >= y:
        return 0, -d[1] * inverse[0], -d[2] * inverse[0], inverse[0]
    return 1, -d[2] * inverse[1], -d[0] * inverse[1], inverse[1]


@inlined
def turn_axis(a, axis):
    """Return a vector rotated so that a given axis is the third."""
    if axis == 0:
        return a[1], a[2], a[0]
    if axis == 1:
        return a[2], a[0], a[1]
    return a


@inlined
def between(one, other, weights):
    """Interpolate numbers, or lanes, between both ends of the shutter."""
    return weights[0] * one + weights[1] * other


@inlined
def _cross(a, b, c, shear):
    """Return the distances of triangles, with turned corners relative to the origin, and which are hit."""
    _, x, y, z = shear
    ax, ay, az = a[0] + x * a[2], a[1] + y * a[2], z * a[2]
    bx, by, bz = b[0] + x * b[2], b[1] + y * b[2], z * b[2]
    cx, cy, cz = c[0] + x * c[2], c[1] + y * c[2], z * c[2]
    u0, u1, v0, v1, w0, w1 = cx * by, cy * bx, ax * cy, ay * cx, bx * ay, by * ax
    inside = ((u0 >= u1) & (v0 >= v1) & (w0 >= w1)) | ((u0 <= u1) & (v0 <= v1) & (w0 <= w1))
    u, v, w = u0 - u1, v0 - v1, w0 - w1
    total = u + v + w
    distance = (u * az + v * bz + w * cz) / total
    distance = larger(distance, smaller(smaller(az, bz), cz))
    distance = smaller(distance, larger(larger(az, bz), cz))
    return distance, inside & (total != 0)


@inlined
def triangle(rows, k, ends, moves, ray, limit):
    """Return the distance of a hit of a triangle before a limit: ``Triangles.distance``."""
    none, axis = rows.dtype.type(-1), ray.shear[0]
    one, other, third = vector(rows, k, 0), vector(rows, k, 3), vector(rows, k, 6)
    if moves:
        one = _corner_at(one, vector(ends, k, 0), ray.weights)
        other = _corner_at(other, vector(ends, k, 3), ray.weights)
        third = _corner_at(third, vector(ends, k, 6), ray.weights)
    distance, hit = _cross(
        turn_axis(minus(one, ray.origin), axis),
        turn_axis(minus(other, ray.origin), axis),
        turn_axis(minus(third, ray.origin), axis),
        ray.shear,
    )
    if not (hit and distance > 0 and distance < limit):
        return none
    return none if _starts_on(one, other, third, ray) else distance


@inlined
def _corner_at(a, b, weights):
    return between(a[0], b[0], weights), between(a[1], b[1], weights), between(a[2], b[2], weights)


@inlined
def eight(blocks, row, last, moves, ray, origin, limit):
    """Return the distances of a block of triangles, and which a ray hits before a limit.

    The origin is turned. :func:`leaves` checks whether the ray starts on a triangle.
    """
    axis = ray.shear[0]
    # A block has coordinates x, y, z as they are.
    x, y, z = row + (axis + 1) % 3, row + (axis + 2) % 3, row + axis
    a = _relative(blocks, x, y, z, last, moves, ray.weights, origin)
    b = _relative(blocks, x + 3, y + 3, z + 3, last, moves, ray.weights, origin)
    c = _relative(blocks, x + 6, y + 6, z + 6, last, moves, ray.weights, origin)
    distance, hit = _cross(a, b, c, ray.shear)
    return distance, hit & (distance > 0) & (distance < limit)


@inlined
def _relative(blocks, x, y, z, last, moves, weights, origin):
    one, other, third = load(blocks, x), load(blocks, y), load(blocks, z)
    if moves:
        one = between(one, load(last, x), weights)
        other = between(other, load(last, y), weights)
        third = between(third, load(last, z), weights)
    return one - origin[0], other - origin[1], third - origin[2]


@inlined
def leaves(blocks, row, lane, last, moves, ray):
    """Whether a ray starts off all triangles of a block."""
    one = _corner(blocks, row, lane, last, moves, ray.weights)
    other = _corner(blocks, row + 3, lane, last, moves, ray.weights)
    third = _corner(blocks, row + 6, lane, last, moves, ray.weights)
    return not _starts_on(one, other, third, ray)


@inlined
def _corner(blocks, row, lane, last, moves, weights):
    a = blocks[row, lane], blocks[row + 1, lane], blocks[row + 2, lane]
    if moves:
        return _corner_at(a, (last[row, lane], last[row + 1, lane], last[row + 2, lane]), weights)
    return a


@inlined
def _starts_on(one, other, third, ray):
    """Whether a ray starts on a triangle: ``triangles._on``."""
    unit = ray.unit
    slack = ray.slack + unit * (largest(one) + largest(other) + largest(third))
    side, across, start = minus(other, one), minus(third, one), minus(one, ray.origin)
    scale = power(max(largest(side), largest(across)), unit / unit)
    side, across, start, slack = times(scale, side), times(scale, across), times(scale, start), scale * slack
    normal = cross(side, across)
    squared = dot(normal, normal)
    height = dot(normal, start)
    if not (squared > 0 and height * height <= slack * slack * squared):
        return False
    p, q = cross(across, normal), cross(normal, side)
    u, v = -dot(start, p) / squared, -dot(start, q) / squared
    wider = slack * (length(p) + length(q)) / squared
    return u >= -wider and v >= -wider and u + v - wider <= 1

"""Intersection tests for single primitives, for loops compiled by Numba: those of the shapes, step by step.

Each primitive is a row of 16 precomputed numbers that do not depend on the ray. Distances of misses are
negative. Constants have the type of the rays: a literal would make the rest double.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from qmcjax.tracing._shapes import vectors
from qmcjax.tracing.search.lanes import inlined

PLANE, RECTANGLE, DISC, BOX, SPHERE, CYLINDER, TRIANGLE, MOVING = range(8)
"""Kinds of primitives; triangles move if their vertices do."""

WIDTH = 16


class Ray(NamedTuple):
    """A ray in object space, with precomputed values for tests."""

    origin: Any
    direction: Any
    squared: Any
    """Squared length of the direction."""
    inverse: Any
    """Reciprocals of the direction's components."""
    slack: Any
    shear: Any
    """``compiled_triangles.shear``."""
    weights: Any
    """Of the opening and the closing of the shutter."""
    unit: Any
    """The slack of a coordinate of 1."""


plus, minus, times, dot, cross = map(
    inlined, (vectors.plus, vectors.minus, vectors.times, vectors.dot, vectors.cross)
)


@inlined
def largest(a):
    """Return the largest absolute component."""
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@inlined
def length(a):
    """Return the length of a vector."""
    return np.sqrt(dot(a, a))


@inlined
def _along(origin, distance, direction):
    return plus(origin, times(distance, direction))


@inlined
def power(size, one):
    """Return the power of two that takes a size to [1, 2): see ``vectors.scaled``."""
    share, _ = math.frexp(size)
    return (share + share) / size if size > 0 else one


@inlined
def vector(rows, k, j):
    """Return the vector at column j of row k."""
    return rows[k, j], rows[k, j + 1], rows[k, j + 2]


@inlined
def _put(rows, k, j, a):
    rows[k, j], rows[k, j + 1], rows[k, j + 2] = a


@inlined
def fill(rows, k, kind, given, m, unit):
    """Fill row k from the numbers of a shape, row m; ``unit`` is the slack of a coordinate of 1.

    ====================  ====================================================================================
    all                   0-2 the point, base, centre or first corner; 15 the slack of the coordinates
    plane, disc           3-5 normal; 6 radius; 12 squared length of the normal
    rectangle             3-5 normal; 6-8, 9-11 vectors with product 1 with one edge, 0 with the other;
                          12 squared length of the normal; 13, 14 lengths of the two vectors
    box                   3-5 the other corner
    sphere                3 radius
    cylinder              3-5 unit axis; 6 height; 7 radius
    triangle              3-8 the other corners
    ====================  ====================================================================================
    """
    one = given.dtype.type(1)
    start, other, third = vector(given, m, 0), vector(given, m, 3), vector(given, m, 6)
    _put(rows, k, 0, start)
    _put(rows, k, 3, other)
    scale = largest(start)
    if kind == PLANE or kind == DISC:
        other = times(power(largest(other), one), other)
        _put(rows, k, 3, other)
        rows[k, 12] = dot(other, other)
        if kind == DISC:
            rows[k, 6] = given[m, 6]
            scale += given[m, 6]
    elif kind == RECTANGLE:
        scale += length(other) + length(third)
        factor = power(max(largest(other), largest(third)), one)
        other, third = times(factor, other), times(factor, third)
        normal = cross(other, third)
        squared = dot(normal, normal)
        inverse = factor / squared if squared > 0 else factor
        p, q = cross(third, normal), cross(normal, other)
        p, q = times(inverse, p), times(inverse, q)
        _put(rows, k, 3, normal)
        _put(rows, k, 6, p)
        _put(rows, k, 9, q)
        rows[k, 12], rows[k, 13], rows[k, 14] = squared, length(p), length(q)
    elif kind == BOX:
        scale += largest(other)
    elif kind == SPHERE:
        scale += given[m, 3]
    elif kind == CYLINDER:
        tall = length(other)
        inverse = one / tall if tall > 0 else one
        _put(rows, k, 3, times(inverse, other))
        rows[k, 6], rows[k, 7] = tall, given[m, 6]
        scale += given[m, 6] + tall
    else:
        _put(rows, k, 6, third)
        scale += largest(other) + largest(third)
    rows[k, 15] = unit * scale


@inlined
def distance(kind, rows, k, ray):
    """Return the distance of the first hit of a primitive that is not a triangle."""
    slack = ray.slack + rows[k, 15]
    if kind == BOX:
        return _box(rows, k, ray, slack)
    if kind == SPHERE:
        start = minus(ray.origin, vector(rows, k, 0))
        near, far = _crossings(start, ray.direction, ray.squared, rows[k, 3], slack)
        return _first(near, far, ray.squared, slack)
    if kind == CYLINDER:
        return _cylinder(rows, k, ray.origin, ray.direction, ray.squared, slack)
    return _flat(kind, rows, k, ray.origin, ray.direction, slack)


@inlined
def _flat(kind, rows, k, origin, direction, slack):
    none, one = rows.dtype.type(-1), rows.dtype.type(1)
    point, normal = vector(rows, k, 0), vector(rows, k, 3)
    height, slope = dot(normal, minus(point, origin)), dot(normal, direction)
    if not (height * height > slack * slack * rows[k, 12] and slope != 0):
        return none
    distance = height / slope
    if kind == PLANE or not distance > 0:
        return distance
    start = minus(_along(origin, distance, direction), point)
    if kind == DISC:
        reach = rows[k, 6] + slack
        return distance if dot(start, start) <= reach * reach else none
    # Enlarged by rounding: rays do not slip between rectangles that share an edge.
    u, wider = dot(start, vector(rows, k, 6)), slack * rows[k, 13]
    v, higher = dot(start, vector(rows, k, 9)), slack * rows[k, 14]
    inside = u >= -wider and u <= one + wider and v >= -higher and v <= one + higher
    return distance if inside else none


@inlined
def _ahead(distance, squared, slack):
    return distance > 0 and distance * distance * squared > slack * slack


@inlined
def _first(near, far, squared, slack):
    if _ahead(near, squared, slack):
        return near
    return far if _ahead(far, squared, slack) else -abs(far)


@inlined
def _relative(corner, origin, slack):
    """Return a coordinate of a face relative to the origin; 0 if the origin is on the face."""
    start = corner - origin
    return start - start if abs(start) <= slack else start


@inlined
def _slab(rows, k, j, ray, slack):
    """Return where a line enters and leaves a slab; NaN chooses the second number: see ``_lower``."""
    one = _relative(rows[k, j], ray.origin[j], slack) * ray.inverse[j]
    other = _relative(rows[k, j + 3], ray.origin[j], slack) * ray.inverse[j]
    return one if one < other else other, other if other > one else one


@inlined
def _box(rows, k, ray, slack):
    enter, leave = _slab(rows, k, 0, ray, slack)
    near, far = _slab(rows, k, 1, ray, slack)
    enter, leave = enter if enter > near else near, leave if leave < far else far
    near, far = _slab(rows, k, 2, ray, slack)
    enter, leave = enter if enter > near else near, leave if leave < far else far
    if not enter <= leave:
        return rows.dtype.type(-1)
    return _first(enter, leave, ray.squared, slack)


@inlined
def _crossings(start, direction, squared, radius, slack):
    """Return where a line crosses the sphere, or the circle, of a radius about 0: ``shape_batches.roots``."""
    b, c = dot(start, direction), dot(start, start) - radius * radius
    foot = _along(start, -b / squared, direction)
    chord = radius * radius - dot(foot, foot)
    root = np.sqrt(squared * chord)
    q = -(b + root) if b > 0 else -(b - root)
    near = q / squared
    if abs(c) <= slack * (radius + radius + slack):
        near, far = -(b + b) / squared, c - c
    else:
        far = c / q if q != 0 else c
    return (near, far) if near < far else (far, near)


@inlined
def _cylinder(rows, k, origin, direction, squared, slack):
    none = rows.dtype.type(-1)
    up, tall = vector(rows, k, 3), rows[k, 6]
    start = minus(origin, vector(rows, k, 0))
    height, climb = dot(start, up), dot(direction, up)
    across = _along(direction, -climb, up)
    around = dot(across, across)
    if not around > 0:
        return none
    near, far = _crossings(_along(start, -height, up), across, around, rows[k, 7], slack)
    # Enlarged by rounding: rays do not slip between the side and a disc at its end.
    at = height + near * climb
    if at >= -slack and at <= tall + slack and _ahead(near, squared, slack):
        return near
    at = height + far * climb
    if at >= -slack and at <= tall + slack and _ahead(far, squared, slack):
        return far
    return none

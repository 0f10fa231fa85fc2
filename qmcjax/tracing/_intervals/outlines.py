"""Where the rays of a fan hit primitives: their outlines, and the spans between edges.

Relative to the apex an edge (a, b) crosses the ray where ``det(a, b, d(t)) = 0``, linear in t; a plane is met
at the distance ``num / den(t)``; and all that is said of a round surface is a quadratic in t. So spans are
found as those in time are (``spans``), and the same steps resolve overlaps.

Polynomials on [0, 1] are in Bernstein form, with coefficients along the first axis of arrays.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.fans import Fan
from qmcjax.tracing._intervals.spans import NOWHERE, Depth, Spans, crossings, restrict
from qmcjax.tracing._shapes.object import Shape, rounding, row
from qmcjax.tracing._shapes.primitives import Cylinder, Disc, Plane, Rectangle, Sphere
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import (
    Vector,
    along,
    cross,
    dot,
    each,
    largest,
    length,
    minus,
    plus,
    scaled,
    times,
    unit,
)

KINDS = Triangles, Rectangle, Plane, Disc, Sphere, Cylinder


class Layer(NamedTuple):
    """The part of a surface that rays meet first or last: distances ``(num + side sqrt(squared)) / den``."""

    num: Array
    """(3, n)."""
    den: Array
    """(3, n)."""
    squared: Array
    """(3, n)."""
    side: int
    present: Callable[[Array], Array]
    """Whether there is a hit at t, (..., n)."""


class Outline(NamedTuple):
    """A primitive as a fan sees it."""

    edges: Array
    """(3, m, n): quadratics in t. Its spans end where one of them changes its sign."""
    layers: list[Layer]


def outline(shape: Shape, number: Any, fan: Fan) -> Outline:
    """Return the outline of primitives: one number for all rays, or one per ray."""
    if isinstance(shape, Sphere | Cylinder):
        return _round(shape, number, fan)
    flat = _flat(shape, number, fan)
    edges = linear = _raised(flat.edges)
    if flat.rim is not None:
        edges = jnp.concatenate([edges, flat.rim[:, None]], axis=1)

    def present(t: Array) -> Array:
        values = [value(edge, t) for edge in jnp.moveaxis(linear, 1, 0)]
        above, below = (reduce(jnp.logical_and, [side * a > 0 for a in values]) for side in (1, -1))
        inside = above | below
        return inside if flat.rim is None else inside & (value(flat.rim, t) > 0)

    zero = jnp.zeros_like(edges[:, 0])
    return Outline(edges, [Layer(_raised(flat.num), _raised(flat.den), zero, 1, present)])


def may_hit(shape: Shape, number: Any, fan: Fan) -> Array:
    """Return False where edges show that rays of a fan miss a primitive."""
    if isinstance(shape, Sphere | Cylinder):
        return folded(jnp.maximum, _round(shape, number, fan).edges[:, 0]) > 0
    edges = _flat(shape, number, fan).edges
    least, most = folded(jnp.minimum, edges), folded(jnp.maximum, edges)
    return ~(folded(jnp.logical_or, least > 0) & folded(jnp.logical_or, most < 0))


def folded(operation: Callable[[Array, Array], Array], a: Array) -> Array:
    """Reduce the first axis of an array, which is short.

    XLA reduces what it has stacked ten times as slowly.
    """
    return reduce(operation, list(a))


def value(a: Array, t: Array) -> Array:
    """Return quadratics (3, ..., n) at t, (n,) or as many."""
    zero, one, two = a
    if t.ndim > zero.ndim:
        zero, one, two = zero[None], one[None], two[None]
    elif t.ndim < zero.ndim:
        t = t[None]
    return (1 - t) * ((1 - t) * zero + 2 * t * one) + t * t * two


def _raised(a: Array) -> Array:
    """Return linear functions as quadratics."""
    return jnp.stack([a[0], 0.5 * (a[0] + a[1]), a[1]])


def _squares(one: Vector, other: Vector) -> Array:
    """Return the squared length of a vector that is linear in t."""
    return jnp.stack([dot(one, one), dot(one, other), dot(other, other)])


class _Flat(NamedTuple):
    edges: Array
    """(2, m, n): linear functions of one sign inside."""
    rim: Array | None
    """(3, n): positive inside a disc."""
    num: Array
    """(2, n): distances are num / den, ..."""
    den: Array
    """(2, n)."""
    noise: Array
    """... with this error of den."""


def _flat(shape: Shape, number: Any, fan: Fan) -> _Flat:
    ends = fan.first, fan.last
    rim = None
    edges: list[list[Array]] = []
    if isinstance(shape, Triangles | Rectangle):
        if isinstance(shape, Triangles):
            corners = shape._corners(number, fan.time)
        else:
            base, u, v = (row(part, number) for part in (shape.corner, shape.edge_u, shape.edge_v))
            corners = [base, plus(base, u), plus(plus(base, u), v), plus(base, v)]
        reach = sum(map(largest, corners[:3]), jnp.zeros_like(fan.slack))
        corners = [minus(corner, fan.apex) for corner in corners]
        edges = _edges(corners, ends)
        point = corners[0]
        normal = cross(*scaled(minus(corners[1], point), minus(corners[-1], point))[1])
    elif isinstance(shape, Plane | Disc):
        center = shape.point if isinstance(shape, Plane) else shape.center
        point = row(center, number)
        reach, point = jnp.broadcast_to(largest(point), fan.slack.shape), minus(point, fan.apex)
        normal = scaled(row(shape.axis, number))[1][0]
    else:
        raise TypeError(
            f"lines need {', '.join(kind.__name__ for kind in KINDS)} or Box, got {type(shape).__name__}"
        )
    height, den = dot(normal, point), [dot(normal, d) for d in ends]
    if isinstance(shape, Disc):
        # The hit is at the distance height / den: its vector from the centre, times den.
        out = [minus(times(height, d), times(slope, point)) for d, slope in zip(ends, den, strict=True)]
        rim = _less(_mixed(*den), _squares(*out), jnp.broadcast_to(shape.radius[number], height.shape))
    size = jnp.broadcast_to(length(normal), height.shape)
    # An apex where rays start is not hit: without height all edges vanish.
    off = (abs(height) > (fan.slack + rounding(reach)) * size) | (fan.begin < 0)
    off = off.astype(height.dtype)
    num = [height - fan.begin * slope for slope in den]
    noise = (4 * jnp.finfo(height.dtype).eps) * size * jnp.maximum(*map(length, ends))
    ends_there = jnp.isfinite(fan.limit)
    limit = jnp.where(ends_there, fan.limit, 0)
    short = [jnp.where(ends_there, limit * d - n, d) for d, n in zip(den, num, strict=True)]
    limits = [jnp.stack([off * part for part in edge]) for edge in (*edges, num, den, short)]
    return _Flat(jnp.stack(limits, axis=1), rim, jnp.stack(num), jnp.stack(den), noise)


def _mixed(one: Array, other: Array) -> Array:
    """Return the square of a function that is linear in t."""
    return jnp.stack([one * one, one * other, other * other])


def _less(a: Array, b: Array, radius: Array) -> Array:
    """Return ``radius^2 a - b`` of quadratics."""
    return (radius * radius)[None] * a - b


def _edges(corners: list[Vector], ends: tuple[Vector, Vector]) -> list[list[Array]]:
    """Return ``det(a, b, d)`` of the edges, (2, n) each.

    The ends of an edge are sorted first: polygons that share it compute the same numbers, for any fused
    multiply-adds, and no gap opens between them.
    """
    found = []
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        more, same = jnp.zeros_like(a[0], bool), jnp.ones_like(a[0], bool)
        for mine, other in zip(a, b, strict=True):
            more, same = more | (same & (mine > other)), same & (mine == other)
        low = each(lambda p, q, more=more: jnp.where(more, q, p), a, b)
        high = each(lambda p, q, more=more: jnp.where(more, p, q), a, b)
        across = cross(low, high)
        sign = jnp.where(same, 0, jnp.where(more, -1, 1)).astype(a[0].dtype)
        found.append([sign * dot(across, d) for d in ends])
    return found


def _round(shape: Sphere | Cylinder, number: Any, fan: Fan) -> Outline:
    """Return the outline of spheres and of the sides of cylinders."""
    one, ends = jnp.ones_like(fan.time), (fan.first, fan.last)
    radius = shape.radius[number] * one
    rims: list[Array] = []
    tall, foot, climb = one, 0 * one, [0 * one, 0 * one]
    if isinstance(shape, Sphere):
        center = row(shape.center, number)
        size = largest(center) + radius
        center = minus(center, fan.apex)
    else:
        base, axis = row(shape.base, number), row(shape.axis, number)
        tall, up = length(axis) * one, unit(axis)
        size = largest(base) + radius + tall
        center = minus(base, fan.apex)
        foot, climb = dot(center, up), [dot(d, up) for d in ends]
        center = along(center, -foot, up)
        ends = along(ends[0], -climb[0], up), along(ends[1], -climb[1], up)
        for level in (foot, foot + tall):
            out = [minus(times(level, d), times(k, center)) for d, k in zip(ends, climb, strict=True)]
            rims.append(_less(_mixed(*climb), _squares(*out), radius))
    slack = fan.slack + rounding(size)
    squared, round_ = _squares(*ends), (radius * radius)[None]
    chord = _less(squared, _squares(cross(center, ends[0]), cross(center, ends[1])), radius)
    middle = _raised(jnp.stack([dot(center, d) for d in ends]))
    off = dot(center, center) - radius * radius
    on = (abs(off) <= slack * (2 * radius + slack)) & (fan.begin == 0)
    num = middle - fan.begin[None] * squared

    def outside(reach: Array) -> Array:
        """Return the height of points of rays above the surface, as a quadratic."""
        return _squares(*(minus(times(reach, d), center) for d in ends)) - round_

    starts = outside(fan.begin) * jnp.where(on, 0, one)[None]
    # A ray may end inside.
    ends_there = jnp.isfinite(fan.limit)
    stops = outside(jnp.where(ends_there, fan.limit + fan.begin, 0)) * jnp.where(ends_there, one, 0)[None]

    def there(t: Array, side: int) -> Array:
        def fit(a: Array) -> Array:
            return a if a.ndim == t.ndim else a[None]

        half, size, ahead = value(chord, t), value(squared, t), value(num, t)
        distance = (ahead + side * jnp.sqrt(jnp.maximum(half, 0))) / jnp.where(size > 0, size, 1)
        hit = (half > 0) & (size > 0) & (distance <= fit(fan.limit))
        if isinstance(shape, Cylinder):
            height = (distance + fit(fan.begin)) * value(_raised(jnp.stack(climb)), t) - fit(foot)
            hit = hit & (height >= -fit(slack)) & (height <= fit(tall + slack))
        if side < 0:
            return hit & ~fit(on) & (value(starts, t) > 0) & (ahead > 0)
        if isinstance(shape, Sphere):
            return hit & jnp.where(fit(on), ahead > 0, value(starts, t) < 0)
        return hit & (distance > 0) & (~fit(on) | (ahead > 0))

    edges = [chord, *rims, starts, num, stops]
    layers = [Layer(num, squared, chord, side, lambda t, side=side: there(t, side)) for side in (-1, 1)]
    return Outline(jnp.stack(edges, axis=1), layers)


def find_spans(shape: Shape, number: Any, fan: Fan) -> Spans:
    """Return where rays of a fan hit primitives."""
    if isinstance(shape, Sphere | Cylinder):
        return _round_spans(_round(shape, number, fan))
    return _flat_spans(_flat(shape, number, fan))


def _flat_spans(flat: _Flat) -> Spans:
    """Return the spans of a convex figure, seen from the front or from behind."""
    found = []
    for side in (1, -1):
        zero, one = side * flat.edges[0], side * flat.edges[1]
        root = zero / jnp.where(zero == one, 1, zero - one)
        start = jnp.where((zero < 0) & (one > 0), root, 0).max(axis=0)
        end = jnp.where((zero > 0) & (one < 0), root, 1).min(axis=0)
        out = ((zero <= 0) & (one <= 0) & ((zero < 0) | (one < 0))).any(axis=0)
        out = out | ((zero == 0) & (one == 0)).all(axis=0)
        end = jnp.where(out, start, end)
        if flat.rim is not None:
            first, second, sign = crossings(flat.rim)
            first, second = jnp.minimum(first, 1), jnp.minimum(second, 1)
            pieces = [(first, second), (0 * first, 0 * first)], [(0 * first, first), (second, 0 * first + 1)]
            best_start, best_end = start, start
            for inner, outer in zip(*pieces, strict=True):
                low, high = (jnp.where(sign > 0, o, i) for i, o in zip(inner, outer, strict=True))
                low, high = jnp.maximum(low, start), jnp.minimum(high, end)
                better = high - low > best_end - best_start
                best_start, best_end = jnp.where(better, low, best_start), jnp.where(better, high, best_end)
            start, end = best_start, best_end
        found.append((start, end, jnp.full_like(start, side)))
    start, end, side = (jnp.stack(part) for part in zip(*found, strict=True))
    num, den = (side[None] * _raised(part)[:, None] for part in (flat.num, flat.den))
    return _spans(start, end, num, den, jnp.zeros_like(num), jnp.ones_like(start), flat.noise)


def _round_spans(seen: Outline) -> Spans:
    """Return the spans of all layers: intervals between the roots of all edges."""
    first, second, _ = crossings(seen.edges)
    points = jnp.sort(
        jnp.minimum(jnp.concatenate([first, second, 0 * first[:1], 0 * first[:1] + NOWHERE]), 1), axis=0
    )
    left, right = points[:-1], points[1:]
    found = []
    for layer in seen.layers:
        here = layer.present(0.5 * (left + right))
        side = jnp.full_like(left, layer.side)
        parts = [jnp.broadcast_to(part[:, None], (3, *left.shape)) for part in layer[:3]]
        found.append((left, jnp.where(here, right, left), *parts, side))
    start, end, num, den, squared, side = (
        jnp.concatenate(part, axis=part[0].ndim - 2) for part in zip(*found, strict=True)
    )
    noise = 4 * jnp.finfo(den.dtype).eps * jnp.max(den[:, 0], axis=0)
    return _spans(start, end, num, den, squared, side, noise)


def _spans(
    start: Array, end: Array, num: Array, den: Array, squared: Array, side: Array, noise: Array
) -> Spans:
    """Return spans with their distances, from quadratics (3, s, n)."""
    inner, noise = end - start > 0, jnp.broadcast_to(noise, start.shape)
    one = jnp.where(inner, end, start)
    num, den, squared = (
        restrict(jnp.broadcast_to(a, (3, *start.shape)), start, one) for a in (num, den, squared)
    )
    reach = jnp.sqrt(jnp.maximum(squared, 0).max(axis=0))
    tiny = jnp.finfo(start.dtype).tiny
    most, least = den.max(axis=0), den.min(axis=0)
    low = num.min(axis=0) + jnp.where(side < 0, -reach, 0)
    high = num.max(axis=0) + jnp.where(side > 0, reach, 0)
    low = jnp.where(low > 0, low / jnp.where(most > 0, most, 1), tiny)
    high = jnp.where(least > noise, high / jnp.where(least > 0, least, 1), jnp.inf)
    size = jnp.where(noise > 0, abs(num).max(axis=0) + reach, 0)
    cubic = jnp.stack([num[0], (num[0] + 2 * num[1]) / 3, (2 * num[1] + num[2]) / 3, num[2]])
    scale = jnp.where(most > 0, most, 1)
    depth = Depth(
        cubic,
        den,
        squared,
        side,
        noise,
        size / scale,
        jnp.maximum(low, tiny),
        jnp.maximum(high, tiny),
    )
    return Spans(start, end, depth)

"""Where the rays of a fan hit primitives: their outlines, and the spans between edges.

Relative to the apex an edge (a, b) crosses the ray where ``det(a, b, d(t)) = 0``, linear in t; a plane is met
at the distance ``num / den(t)``; and all that is said of a round surface is a quadratic in t. So spans are
found as those in time are (``spans``), and the same steps resolve overlaps.

Polynomials on [0, 1] are lists of Bernstein coefficients. Those of a pyramid follow: values of a symmetric
bilinear form at two of its ends. All values lie between coefficients.
"""

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.candidates import at_places
from qmcjax.tracing._intervals.fans import Fan
from qmcjax.tracing._intervals.spans import NOWHERE, Depth, Spans, crossings, restrict, sort_short_axis
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


Coefficients = list[Array]
"""(n,) each."""


class Layer(NamedTuple):
    """The part of a surface that rays meet first or last: distances ``(num + side sqrt(squared)) / den``."""

    num: Coefficients
    den: Coefficients
    squared: Coefficients
    side: int
    present: Callable[[Array], Array]
    """Whether there is a hit at t, (..., n)."""


class Outline(NamedTuple):
    """A primitive as a fan sees it."""

    edges: list[Coefficients]
    """Quadratics in t. Its spans end where one of them changes its sign."""
    layers: list[Layer]


def outline(shape: Shape, number: Any, fan: Fan) -> Outline:
    """Return the outline of primitives: one number for all rays, or one per ray."""
    if isinstance(shape, Sphere | Cylinder):
        return _round(shape, number, fan)
    flat = _flat(shape, number, fan)
    edges = linear = [_raised(edge) for edge in flat.edges]
    if flat.rim is not None:
        edges = [*linear, flat.rim]

    def present(t: Array) -> Array:
        values = [value(edge, t) for edge in linear]
        above, below = (reduce(jnp.logical_and, [side * a > 0 for a in values]) for side in (1, -1))
        inside = above | below
        return inside if flat.rim is None else inside & (value(flat.rim, t) > 0)

    zero = [jnp.zeros_like(fan.time)] * len(edges[0])
    return Outline(edges, [Layer(_raised(flat.num), _raised(flat.den), zero, 1, present)])


def may_hit(shape: Shape, number: Any, fan: Fan) -> Array:
    """Return False where edges show that rays of a fan miss a primitive."""
    if isinstance(shape, Sphere | Cylinder):
        edges = _round(shape, number, fan).edges
        chord, (starts, ahead) = edges[0], edges[-3:-1]
        leaves = (reduce(jnp.minimum, starts) >= 0) & (reduce(jnp.maximum, ahead) <= 0)
        return (reduce(jnp.maximum, chord) > 0) & ~leaves
    edges = _flat(shape, number, fan).edges
    above = [reduce(jnp.minimum, edge) > 0 for edge in edges]
    below = [reduce(jnp.maximum, edge) < 0 for edge in edges]
    # All vanish where rays start on the figure.
    away = reduce(jnp.logical_and, [a == 0 for edge in edges for a in edge])
    return ~((reduce(jnp.logical_or, above) & reduce(jnp.logical_or, below)) | away)


def value(a: Any, t: Array) -> Array:
    """Return quadratics at t, (..., n)."""
    zero, one, two = (_fit(part, t) for part in a[:3])
    return (1 - t) * ((1 - t) * zero + 2 * t * one) + t * t * two


def _fit(a: Array, t: Array) -> Array:
    """Return numbers of rays, (n,), for several t of each."""
    return a if a.ndim == t.ndim else a[None]


def _raised(a: Coefficients) -> Coefficients:
    """Return linear functions as quadratics."""
    return _pairs(lambda one, other: 0.5 * (one + other), a)


def _pairs(form: Callable[[Any, Any], Array], ends: Sequence[Any]) -> Coefficients:
    """Return a symmetric form of all pairs of ends; those of the first two come first."""
    return [form(ends[i], ends[j]) for j in range(len(ends)) for i in range(j + 1)]


def _squares(ends: Sequence[Vector]) -> Coefficients:
    """Return the squared length of a vector that is linear in t."""
    return _pairs(dot, ends)


class _Flat(NamedTuple):
    edges: list[Coefficients]
    """Linear functions of one sign inside."""
    rim: Coefficients | None
    """Positive inside a disc."""
    num: Coefficients
    """Distances are num / den, ..."""
    den: Coefficients
    noise: Array
    """... with this error of den."""


def _flat(shape: Shape, number: Any, fan: Fan) -> _Flat:
    ends, rim = fan.ends, None
    edges: list[Coefficients] = []
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
        rim = _less(_mixed(den), _squares(out), jnp.broadcast_to(shape.radius[number], height.shape))
    size = jnp.broadcast_to(length(normal), height.shape)
    # An apex where rays start is not hit, nor the plane where they do: without height all edges vanish.
    slack, beyond = fan.slack + rounding(reach), []
    off = (abs(height) > slack * size) | (fan.begin < 0)
    if fan.plane is not None:
        across, level = fan.plane
        pairs = list(zip(_slopes(across, ends), den, strict=True))
        beyond = [[height * slope - level * d for slope, d in pairs]]
        noise = [slack * (size * abs(slope) + length(across) * abs(d)) for slope, d in pairs]
        off = off & reduce(jnp.logical_or, [abs(a) > b for a, b in zip(beyond[0], noise, strict=True)])
    off = off.astype(height.dtype)
    num = [height - fan.begin * slope for slope in den]
    noise = (4 * jnp.finfo(height.dtype).eps) * size * reduce(jnp.maximum, map(length, ends))
    ends_there = jnp.isfinite(fan.limit)
    limit = jnp.where(ends_there, fan.limit, 0)
    short = [jnp.where(ends_there, limit * d - n, d) for d, n in zip(den, num, strict=True)]
    limits = [[off * part for part in edge] for edge in (*edges, *beyond, num, den, short)]
    return _Flat(limits, rim, num, den, noise)


def _slopes(normal: Vector, ends: Sequence[Vector]) -> Coefficients:
    """Return how fast rays approach a plane: a linear function."""
    return [dot(normal, d) for d in ends]


def _mixed(ends: Coefficients) -> Coefficients:
    """Return the square of a function that is linear in t."""
    return _pairs(lambda one, other: one * other, ends)


def _less(a: Coefficients, b: Coefficients, radius: Array) -> Coefficients:
    """Return ``radius^2 a - b`` of quadratics."""
    return [radius * radius * one - other for one, other in zip(a, b, strict=True)]


def _edges(corners: list[Vector], ends: tuple[Vector, ...]) -> list[Coefficients]:
    """Return ``det(a, b, d)`` of the edges.

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
    one, ends = jnp.ones_like(fan.time), fan.ends
    radius = shape.radius[number] * one
    rims: list[Coefficients] = []
    tall, foot, climb = one, 0 * one, [0 * one for _ in ends]
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
        ends = tuple(along(d, -k, up) for d, k in zip(ends, climb, strict=True))
        for level in (foot, foot + tall):
            out = [minus(times(level, d), times(k, center)) for d, k in zip(ends, climb, strict=True)]
            rims.append(_less(_mixed(climb), _squares(out), radius))
    slack = fan.slack + rounding(size)
    squared = _squares(ends)
    chord = _less(squared, _squares([cross(center, d) for d in ends]), radius)
    ahead = [dot(center, d) for d in ends]
    middle = _raised(ahead)
    off = dot(center, center) - radius * radius
    on = (abs(off) <= slack * (2 * radius + slack)) & (fan.begin == 0)
    num = [a - fan.begin * b for a, b in zip(middle, squared, strict=True)]

    def outside(reach: Array, wanted: Array) -> Coefficients:
        """Return the height of points of rays above the surface, as a quadratic; 0 where not wanted."""
        heights = _squares([minus(times(reach, d), center) for d in ends])
        return [jnp.where(wanted, a - radius * radius, 0) for a in heights]

    starts, before = outside(fan.begin, ~on), num
    if fan.plane is not None:
        slopes, level = _slopes(fan.plane[0], fan.ends), fan.plane[1]
        on, both = jnp.zeros_like(on), list(zip(ends, ahead, slopes, strict=True))
        # The start of a ray is at the distance level / slope: all is relative to the centre, times slope.
        out = [minus(times(level, d), times(slope, center)) for d, _, slope in both]
        starts = [-a for a in _less(_mixed(slopes), _squares(out), radius)]
        before = _pairs(lambda a, b: 0.5 * (a[2] * b[1] + b[2] * a[1]) - level * dot(a[0], b[0]), both)
    # A ray may end inside.
    ends_there = jnp.isfinite(fan.limit)
    stops = outside(jnp.where(ends_there, fan.limit + fan.begin, 0), ends_there)

    def there(t: Array, side: int) -> Array:
        half, size, forward = value(chord, t), value(squared, t), value(before, t)
        distance = (value(num, t) + side * jnp.sqrt(jnp.maximum(half, 0))) / jnp.where(size > 0, size, 1)
        hit = (half > 0) & (size > 0) & (distance <= _fit(fan.limit, t))
        if isinstance(shape, Cylinder):
            height = (distance + _fit(fan.begin, t)) * value(_raised(climb), t) - _fit(foot, t)
            hit = hit & (height >= -_fit(slack, t)) & (height <= _fit(tall + slack, t))
        if side < 0:
            return hit & ~_fit(on, t) & (value(starts, t) > 0) & (forward > 0)
        if isinstance(shape, Sphere):
            return hit & jnp.where(_fit(on, t), forward > 0, value(starts, t) < 0)
        return hit & ((value(starts, t) < 0) | (forward > 0))

    edges = [chord, *rims, starts, before, stops]
    layers = [Layer(num, squared, chord, side, lambda t, side=side: there(t, side)) for side in (-1, 1)]
    return Outline(edges, layers)


def find_spans(shape: Shape, number: Any, fan: Fan) -> tuple[Array, Callable[[Array], Spans]]:
    """Return which of (s, n) spans rays of a fan have, and what makes those of places (n,)."""
    if isinstance(shape, Sphere | Cylinder):
        return _round_spans(_round(shape, number, fan))
    return _flat_spans(_flat(shape, number, fan))


def _flat_spans(flat: _Flat) -> tuple[Array, Callable[[Array], Spans]]:
    """Return the spans of a convex figure, seen from the front or from behind."""
    found = []
    ends = [jnp.stack(values) for values in zip(*flat.edges, strict=True)]
    for side in (1, -1):
        zero, one = side * ends[0], side * ends[1]
        root = zero / jnp.where(zero == one, 1, zero - one)
        start = jnp.where((zero < 0) & (one > 0), root, 0).max(axis=0)
        end = jnp.where((zero > 0) & (one < 0), root, 1).min(axis=0)
        out = ((zero <= 0) & (one <= 0) & ((zero < 0) | (one < 0))).any(axis=0)
        out = out | ((zero == 0) & (one == 0)).all(axis=0)
        end = jnp.where(out, start, end)
        if flat.rim is not None:
            first, second, sign = crossings(jnp.stack(flat.rim))
            first, second = jnp.minimum(first, 1), jnp.minimum(second, 1)
            pieces = [(first, second), (0 * first, 0 * first)], [(0 * first, first), (second, 0 * first + 1)]
            best_start, best_end = start, start
            for inner, outer in zip(*pieces, strict=True):
                low, high = (jnp.where(sign > 0, o, i) for i, o in zip(inner, outer, strict=True))
                low, high = jnp.maximum(low, start), jnp.minimum(high, end)
                better = high - low > best_end - best_start
                best_start, best_end = jnp.where(better, low, best_start), jnp.where(better, high, best_end)
            start, end = best_start, best_end
        found.append((start, end))
    start, end = (jnp.stack(part) for part in zip(*found, strict=True))

    def spans_at(place: Array) -> Spans:
        side = 1 - 2 * place.astype(start.dtype)
        num, den = (side[None] * jnp.stack(_raised(part)) for part in (flat.num, flat.den))
        first, last = at_places((start, end), place)
        return _spans(first, last, num, den, jnp.zeros_like(num), jnp.ones_like(side), flat.noise)

    return start < end, spans_at


def _round_spans(seen: Outline) -> tuple[Array, Callable[[Array], Spans]]:
    """Return the spans of both layers: runs of intervals between the roots of all edges."""
    first, second, _ = crossings(jnp.stack([jnp.stack(edge) for edge in seen.edges], axis=1))
    ends = 0 * first[:1], 0 * first[:1] + NOWHERE
    points = sort_short_axis(jnp.minimum(jnp.concatenate([first, second, *ends]), 1))
    left, right = points[:-1], points[1:]
    here = jnp.stack([layer.present(0.5 * (left + right)) for layer in seen.layers])
    begins = here & ~jnp.concatenate([jnp.zeros_like(here[:, :1]), here[:, :-1]], axis=1)
    stops = [jnp.broadcast_to(right[-1], here[:, 0].shape)]
    for k in reversed(range(len(left) - 1)):
        stops.append(jnp.where(here[:, k + 1], stops[-1], right[k][None]))
    end = jnp.stack(stops[::-1], axis=1)
    start = jnp.broadcast_to(left[None], end.shape)
    some, start, end = (a.reshape(-1, a.shape[-1]) for a in (begins & (start < end), start, end))

    def spans_at(place: Array) -> Spans:
        second = place >= len(left)

        def of_layer(one: Coefficients, other: Coefficients) -> Array:
            return jnp.stack([jnp.where(second, b, a) for a, b in zip(one, other, strict=True)])

        near, far = seen.layers
        num, den, squared = map(of_layer, near[:3], far[:3])
        side = jnp.where(second, far.side, near.side).astype(left.dtype)
        noise = 4 * jnp.finfo(den.dtype).eps * den.max(axis=0)
        first, last = at_places((start, end), place)
        return _spans(first, last, num, den, squared, side, noise)

    return some, spans_at


def _spans(
    start: Array, end: Array, num: Array, den: Array, squared: Array, side: Array, noise: Array
) -> Spans:
    """Return spans with their distances, from quadratics (3, n)."""
    num, den, squared = (restrict(a, start, jnp.maximum(start, end)) for a in (num, den, squared))
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

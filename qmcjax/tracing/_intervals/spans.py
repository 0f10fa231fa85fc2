"""Times and distances at which a ray hits a linearly moving primitive (thesis, Sect. 3.2.1).

Seen along a ray, an edge that moves linearly sweeps a bilinear patch. The area between its ends and the ray
is a quadratic in time, and the ray crosses the patch at its roots. So a polygon is hit while all its
quadratics have the same sign, and a sphere while three are positive: the squared half chord, the distance of
the origin outside, and minus the distance to the foot of the centre.

Polynomials on [0, 1] are in Bernstein form, with coefficients along the first axis of arrays: values lie
between the smallest and the largest coefficient.
"""

from math import comb
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._shapes.object import meets
from qmcjax.tracing._shapes.vectors import Vector, components, cross, dot, each, minus

NOWHERE = 2
"""Replaces a root in (0, 1) that does not exist."""


def product(a: Array, b: Array) -> Array:
    """Return the coefficients of a product."""
    m, n = len(a) - 1, len(b) - 1
    scaled, other = a * _binomials(m, a), b * _binomials(n, b)
    rest = [(0, 0)] * (a.ndim - 1)
    terms = [jnp.pad(scaled * other[j][None], [(j, n - j), *rest]) for j in range(n + 1)]
    return sum(terms[1:], terms[0]) / _binomials(m + n, a)


def restrict(a: Array, start: Array, end: Array) -> Array:
    """Return the coefficients of the same polynomial with [start, end] mapped to [0, 1]."""
    degree = len(a) - 1
    result = []
    for last in range(degree + 1):
        # The blossom at `start` degree - last times, and at `end` last times.
        values = a
        for step in range(degree):
            at = (end if step < last else start)[None]
            values = (1 - at) * values[:-1] + at * values[1:]
        result.append(values)
    return jnp.concatenate(result)


def middle(a: Array) -> Array:
    """Return the value at 1/2."""
    return jnp.sum(a * _binomials(len(a) - 1, a), axis=0) / 2 ** (len(a) - 1)


def _binomials(degree: int, like: Array) -> Array:
    numbers = jnp.asarray([comb(degree, k) for k in range(degree + 1)], like.dtype)
    return numbers.reshape(-1, *(1,) * (like.ndim - 1))


def crossings(a: Array) -> tuple[Array, Array, Array]:
    """Return where quadratics change sign in (0, 1), in order, and their signs before that.

    ``r = s / (1 - s)`` is a root of ``a[0] + 2 a[1] r + a[2] r^2``, with unchanged coefficients, and s is a
    quotient of numbers of the same sign: nothing cancels [1]_ except a discriminant near 0, and the degree
    may drop. Signs agree with the returned roots: after all of them the sign is that of ``a[2]``.

    Returns
    -------
    first, second : Array
        ``NOWHERE`` without a root; both are equal at a double root.
    sign : Array
        -1, 0 or 1; 0 only where all coefficients are 0.

    References
    ----------
    .. [1] W. Kahan, "On the Cost of Floating-Point Computation Without Extra-Precise Arithmetic", 2004.
    """
    largest = jnp.maximum(jnp.maximum(abs(a[0]), abs(a[1])), abs(a[2]))
    inverse = 1 / jnp.where(largest > 0, largest, 1)
    zero, one, two = a[0] * inverse, a[1] * inverse, a[2] * inverse
    squared = one * one - zero * two
    root = jnp.sqrt(jnp.maximum(squared, 0))
    sum_ = -(one + jnp.where(one >= 0, root, -root))

    def between(numerator: Array, denominator: Array) -> Array:
        same = ((numerator > 0) & (denominator > 0)) | ((numerator < 0) & (denominator < 0))
        total = jnp.where(same, numerator + denominator, 1)
        return jnp.where(same & (squared >= 0), numerator / total, NOWHERE)

    ends = between(sum_, two), between(zero, sum_)
    sign = jnp.sign(jnp.where(zero != 0, zero, jnp.where(one != 0, one, two)))
    return jnp.minimum(*ends), jnp.maximum(*ends), sign


class ShearedRays(NamedTuple):
    """Rays, components (n,), and linear maps from their directions to (0, 0, 1)."""

    origin: Vector
    direction: Vector
    x: Vector
    y: Vector
    z: Vector

    def meets(self, low: Vector, high: Vector, limit: Array) -> Array:
        """Return whether rays may hit boxes, given relative to their origins, up to a limit."""
        return meets(low, high, self.direction, limit)


class Depth(NamedTuple):
    """Distances along rays from the start to the end of a span: (num + side sqrt(squared)) / den."""

    num: Array
    """(4, ...): Bernstein coefficients."""
    den: Array
    """(3, ...): positive up to rounding, see ``noise``."""
    squared: Array
    """(3, ...): zeros without a square root."""
    side: Array
    """1 or -1."""
    noise: Array
    """Error of ``den``; that of ``num`` is ``far`` times larger."""
    far: Array
    low: Array
    """Lower bound of distances."""
    high: Array
    """Upper bound of distances."""


class Spans(NamedTuple):
    """Times at which a primitive is hit, in order: (s, n) for s spans and n rays."""

    start: Array
    end: Array
    """A value not above ``start`` means no span."""
    depth: Depth


class Polygons(NamedTuple):
    """Triangles or parallelograms, one in each row, each on one linear segment of its motion."""

    begin: Array
    """(rows,): start of the segment's time."""
    finish: Array
    vertices: Array
    """(rows, 2, corners, 3): at the start and the end of the segment."""

    def seen(self, row: Any, view: ShearedRays) -> tuple[Vector, Array]:
        """Return vertices relative to rays, components (2, corners, n), and which rays may hit them.

        The same instructions in one loop compute all vertices: shared vertices have the same bits in all
        polygons.
        """
        corners = minus(
            each(lambda v: v[:, :, None], components(self.vertices[row])),
            each(lambda o: o[None, None, :], view.origin),
        )
        maps = (each(lambda m: m[None, None, :], axis) for axis in (view.x, view.y, view.z))
        x, y, z = (dot(axis, corners) for axis in maps)
        around = [(a.min(axis=(0, 1)) <= 0) & (a.max(axis=(0, 1)) >= 0) for a in (x, y)]
        return (x, y, z), around[0] & around[1] & (z.max(axis=(0, 1)) > 0)

    def nearest(self, seen: Vector) -> Array:
        """Return a lower bound of distances."""
        return seen[2].min(axis=(0, 1))

    def spans(self, row: Any, view: ShearedRays) -> Spans:
        """Return when rays hit the polygon of a row."""
        (x, y, z), _ = self.seen(row, view)
        begin, finish = self.begin[row], self.finish[row]
        start, end, side = _same_signs(_edges(x, y), both=True)
        # Of a parallelogram, the triangle without the opposite vertex.
        chosen = 0, 1, x.shape[1] - 1
        (ax, bx, cx), (ay, by, cy), (az, bz, cz) = ([a[:, corner] for corner in chosen] for a in (x, y, z))
        weights = _area(bx, by, cx, cy), _area(cx, cy, ax, ay), _area(ax, ay, bx, by)
        den = weights[0] + weights[1] + weights[2]
        num = product(weights[0], az) + product(weights[1], bz) + product(weights[2], cz)
        heights = [(1 - s) * z[0][:, None] + s * z[1][:, None] for s in (start[None], end[None])]
        far = abs(z).max(axis=(0, 1))
        size = abs(x).max(axis=(0, 1)) * abs(y).max(axis=(0, 1))
        count = len(start)
        depth = Depth(
            side[None] * restrict(num[:, None], start, end),
            side[None] * restrict(den[:, None], start, end),
            jnp.zeros((3, *start.shape), start.dtype),
            jnp.ones_like(start),
            _spread(2 * jnp.finfo(size.dtype).eps * size, count),
            _spread(far, count),
            jnp.minimum(*(h.min(axis=0) for h in heights)),
            jnp.maximum(*(h.max(axis=0) for h in heights)),
        )
        return Spans(_time(start, begin, finish), _time(end, begin, finish), depth)


class Balls(NamedTuple):
    """Spheres, or ellipsoids of constant shape, one in each row."""

    begin: Array
    finish: Array
    center: Array
    """(rows, 2, 3)."""
    inverse: Array
    """(rows, 3, 3): maps them to unit spheres."""

    def _inside(self, row: Any, view: ShearedRays) -> tuple[list[Vector], Vector]:
        """Return rays in the space of unit spheres: origins at both times, and directions."""
        rows = [components(self.inverse[row, j]) for j in range(3)]
        from_center = [minus(view.origin, components(self.center[row, end])) for end in range(2)]
        direction = dot(rows[0], view.direction), dot(rows[1], view.direction), dot(rows[2], view.direction)
        return [(dot(rows[0], o), dot(rows[1], o), dot(rows[2], o)) for o in from_center], direction

    def seen(self, row: Any, view: ShearedRays) -> tuple[Any, Array]:
        """Return rays in the space of unit spheres, and which of them may hit."""
        origins, direction = self._inside(row, view)
        chord = _chord(origins, direction)
        return (origins, direction), chord.max(axis=0) > 0

    def nearest(self, seen: Any) -> Array:
        """Return a lower bound of distances."""
        origins, direction = seen
        squared = dot(direction, direction)
        inverse = 1 / jnp.where(squared > 0, squared, 1)
        feet = [-inverse * dot(origin, direction) for origin in origins]
        return jnp.minimum(*feet) - jnp.sqrt(inverse)

    def spans(self, row: Any, view: ShearedRays) -> Spans:
        """Return when rays hit the sphere of a row: from outside, or from inside."""
        origins, direction = self._inside(row, view)
        begin, finish = self.begin[row], self.finish[row]
        chord = _chord(origins, direction)
        outside = _products(*origins) - 1
        ahead = [-dot(origin, direction) for origin in origins]
        ahead = jnp.stack([ahead[0], 0.5 * (ahead[0] + ahead[1]), ahead[1]])
        near = _same_signs(jnp.stack([chord, outside, ahead], axis=1), both=False)
        far = _same_signs(-outside[:, None], both=False)
        start, end = (jnp.concatenate(parts) for parts in zip(near[:2], far[:2], strict=True))
        sides = [-jnp.ones_like(near[0]), jnp.ones_like(far[0])]
        squared = dot(direction, direction)
        inverse = 1 / jnp.where(squared > 0, squared, 1)
        foot = [inverse * ahead[0], inverse * ahead[2]]
        num = jnp.stack([foot[0] + (foot[1] - foot[0]) * (k / 3) for k in range(4)])
        reach = jnp.sqrt(inverse)
        side = jnp.concatenate(sides)
        count = len(start)
        tiny = jnp.finfo(reach.dtype).tiny
        low = jnp.where(side < 0, jnp.minimum(*foot) - reach, jnp.minimum(*foot))
        high = jnp.where(side < 0, jnp.maximum(*foot), jnp.maximum(*foot) + reach)
        depth = Depth(
            restrict(num[:, None], start, end),
            jnp.ones((3, *start.shape), start.dtype),
            restrict((inverse * inverse)[None, None] * chord[:, None], start, end),
            side,
            jnp.full_like(start, 2 * jnp.finfo(start.dtype).eps),
            _spread(jnp.maximum(abs(foot[0]), abs(foot[1])) + reach, count),
            # All hits are ahead.
            jnp.maximum(low, tiny),
            jnp.maximum(high, tiny),
        )
        return Spans(_time(start, begin, finish), _time(end, begin, finish), depth)


def _spread(a: Array, count: int) -> Array:
    return jnp.broadcast_to(a[None], (count, *a.shape))


def _time(share: Array, begin: Array, finish: Array) -> Array:
    """Return times; ends of segments are exact, so spans continue in the next segment."""
    inner = begin + share * (finish - begin)
    return jnp.where(share <= 0, begin, jnp.where(share >= 1, finish, jnp.minimum(inner, finish)))


def _area(px: Array, py: Array, qx: Array, qy: Array) -> Array:
    """Return the quadratic p x q of points that move from p[0] to p[1], q[0] to q[1]."""
    first, last = (px[k] * qy[k] - qx[k] * py[k] for k in range(2))
    mixed = 0.5 * ((px[0] * qy[1] - qx[1] * py[0]) + (px[1] * qy[0] - qx[0] * py[1]))
    return jnp.stack([first, mixed, last])


def _edges(x: Array, y: Array) -> Array:
    """Return the quadratics of the edges of polygons, (3, corners, n).

    The ends of an edge are sorted first: polygons that share it compute the same roots, for any fused
    multiply-adds, and no gap in time opens between them.
    """
    after = [jnp.roll(a, -1, axis=1) for a in (x, y)]
    more, same = jnp.zeros(x.shape[1:], bool), jnp.ones(x.shape[1:], bool)
    for mine, other in ((x, after[0]), (y, after[1])):
        for end in range(2):
            more = more | (same & (mine[end] > other[end]))
            same = same & (mine[end] == other[end])
    first = [jnp.where(more[None], b, a) for a, b in zip((x, y), after, strict=True)]
    last = [jnp.where(more[None], a, b) for a, b in zip((x, y), after, strict=True)]
    # An edge of zero length, seen along the ray, decides nothing.
    sign = jnp.where(same, 0, jnp.where(more, -1, 1)).astype(x.dtype)
    return sign[None] * _area(*first, *last)


def _products(a: Vector, b: Vector) -> Array:
    return jnp.stack([dot(a, a), dot(a, b), dot(b, b)])


def _chord(origins: list[Vector], direction: Vector) -> Array:
    """Return the quadratic of the squared half chord in a unit sphere, times the squared ray length."""
    across = (cross(origin, direction) for origin in origins)
    return dot(direction, direction)[None] - _products(*across)


def _same_signs(quadratics: Array, both: bool) -> tuple[Array, Array, Array]:
    """Return when all quadratics, (3, m, n), are positive, or with ``both`` have the same sign.

    Starts and ends in [0, 1] and signs (0: none), of shape (m + 1, n). Each quadratic is a step function with
    the steps that :func:`crossings` returns: polygons that share one agree on its sign at all times. With
    ``both``, a quadratic that is 0 throughout has both signs; not all of them may.
    """
    first, second, sign = crossings(quadratics)
    count, rays = first.shape
    zero = jnp.zeros((1, rays), first.dtype)
    points = jnp.minimum(sort_short_axis(jnp.concatenate([first, second])), 1)
    points = jnp.concatenate([zero, points, zero + 1])
    place = jnp.arange(count + 1, dtype=jnp.int32)[:, None]

    def turn(state: Any, ends: tuple[Array, Array]) -> tuple[Any, None]:
        (start, end, side), number, before = state
        left, right = ends
        odd = (first <= left[None]) ^ (second <= left[None])
        now = jnp.where(odd, -sign, sign)
        if both:
            plus, minus = (now > 0).any(axis=0), (now < 0).any(axis=0)
            here = (plus & ~minus).astype(left.dtype) - (minus & ~plus).astype(left.dtype)
        else:
            here = (now > 0).all(axis=0).astype(left.dtype)
        here = jnp.where(right > left, here, before)
        begins = (here != 0) & (here != before)
        number = number + begins.astype(jnp.int32)
        mine = place == number[None]
        start = jnp.where(mine & begins[None], left[None], start)
        side = jnp.where(mine & begins[None], here[None], side)
        end = jnp.where(mine & (here != 0)[None], right[None], end)
        return ((start, end, side), number, here), None

    ones = jnp.ones((count + 1, rays), first.dtype)
    state = (ones, ones, jnp.zeros_like(ones)), jnp.full(rays, -1, jnp.int32), zero[0]
    return jax.lax.scan(turn, state, (points[:-1], points[1:]))[0][0]


def sort_short_axis(values: Array) -> Array:
    """Sort numbers along the short first axis by counting smaller ones."""
    place = jnp.arange(len(values), dtype=jnp.int32)[:, None, None]
    one, other = values[:, None], values[None]
    before = (other < one) | ((other == one) & (place.reshape(1, -1, 1) < place))
    rank = jnp.sum(before, axis=1, dtype=jnp.int32)
    return jnp.sum(jnp.where(rank[None] == place, values[None], 0), axis=1)

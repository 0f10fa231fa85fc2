"""Rational curves by arc length, with an error bound.

A curve is cut into Bezier pieces, and these into halves until the length of each is known within rounding. If
the speed is analytic around a piece, Gauss-Legendre quadrature gives the length, with an error bound [1]_;
otherwise it is between the chord and the control polygon. No weight is negative, so halving cuts corners,
which shortens the polygon, and its limit is the curve [2]_. A piece is stored as weights and differences of
control points. Differences of halves are sums of parts of the differences: their total rounding error is
proportional to the length of the polygon, for any weights.

References
----------
.. [1] L. N. Trefethen, "Approximation Theory and Approximation Practice", 2013, Theorem 19.3.
.. [2] G. Farin, "Curves and Surfaces for CAGD", 2002, Chapter 13.
"""

from dataclasses import field
from functools import cache
from itertools import count
from math import comb
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, floats
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing.motion._paths import bounding_box, rows_at

_NODES, _SHARES = np.polynomial.legendre.leggauss(16)
"""Gauss-Legendre quadrature on [-1, 1]."""

_EPS = 2.0**-52

_MOST = 2**16
"""Pieces of a curve."""


@frozen_pytree
class ArcLength:
    """Chords between points at equal arc lengths along a curve."""

    points: Any
    """(segments + 1, d)."""

    length: float = field(metadata={"static": True, "derived": True})
    """Of the whole curve."""

    bound: float = field(metadata={"static": True, "derived": True})
    """Maximum distance of a point from that of the curve at the same fraction of its length."""

    pieces: int = field(metadata={"static": True, "derived": True})
    """Of the curve, whose lengths are integrated with 16 nodes each."""

    def __call__(self, part: ArrayLike) -> Array:
        """Return points (..., d) by the travelled fraction of the curve's length, in constant time.

        ``part`` has shape (...), is clamped to [0, 1] and determines the dtype.
        """
        part = floats("part", part)
        points = cast(self.points, part.dtype)
        count = points.shape[0] - 1
        place = jnp.clip(part, 0, 1) * count
        index = jnp.minimum(place.astype(jnp.int32), count - 1)
        share = place - index.astype(part.dtype)
        ends = zip(rows_at(points[:-1], index), rows_at(points[1:], index), strict=True)
        return jnp.stack([a + share * (b - a) for a, b in ends], axis=-1)

    def bounds(self) -> tuple[Array, Array]:
        """Return a box of all points: low and high, (d,)."""
        return bounding_box(self.points)


class _Pieces(NamedTuple):
    """Bezier pieces of a curve, in order."""

    start: NDArray[Any]
    """(n, d): first control points."""
    steps: NDArray[Any]
    """(n, degree, d): differences of successive control points."""
    weights: NDArray[Any]
    """(n, degree + 1)."""
    smooth: NDArray[Any]
    """Whether quadrature gives the length of the piece and of each part of it."""

    def rows(self, which: NDArray) -> "_Pieces":
        """Return some pieces, with weights up to 1."""
        start, steps, weights, smooth = (part[which] for part in self)
        return _Pieces(start, steps, weights / weights.max(axis=1, keepdims=True), smooth)


def by_arc_length(
    control: NDArray, weights: NDArray, knots: NDArray, degree: int, segments: int
) -> ArcLength:
    """Divide a rational B-spline into segments of equal arc length.

    A point of an arc of length h and the point of its chord c at the same fraction are at most
    ``sqrt(h**2 - c**2) / 2`` apart: at the fraction a, Stewart's theorem bounds the squared distance by
    ``a (1 - a) (h**2 - c**2)``, since no point of the arc is farther from an end than along the arc.
    """
    segments = checks.integer("segments", segments, 1, 2**16)
    # In units of the curve's size, and with weights as large as possible: no product overflows or underflows.
    shape = control - control[0]
    size = np.ldexp(1.0, int(np.frexp(np.abs(shape).max())[1]))
    weights = np.ldexp(weights, 1000 - int(np.frexp(weights.max())[1]))
    pieces, unknown = _divide(_bezier(shape / size, weights, knots, degree))
    lengths = np.linalg.norm(pieces.steps, axis=2).sum(axis=1)
    rough = ~pieces.smooth
    chords = np.linalg.norm(pieces.steps.sum(axis=1), axis=1)
    unknown += 0.5 * (lengths - chords)[rough].sum() + lengths[rough].max(initial=0)
    lengths[rough] = 0.5 * (lengths + chords)[rough]
    of_smooth = pieces.rows(pieces.smooth)
    lengths[pieces.smooth], _ = _arcs(of_smooth, np.ones(len(of_smooth.start)))
    ends = np.append(0.0, np.cumsum(lengths))
    length = ends[-1]
    unknown += len(lengths) * _EPS * length
    if not length > 0:
        raise ValueError(f"the curve must not be a single point, got the length {length * size}")
    wanted = np.linspace(0, length, segments + 1)
    number = np.clip(np.searchsorted(ends, wanted, side="right") - 1, 0, len(lengths) - 1)
    of_each = pieces.rows(number)
    rest, whole = wanted - ends[number], lengths[number]
    t = np.clip(np.divide(rest, whole, out=np.zeros_like(rest), where=whole > 0), 0, 1)
    t[~of_each.smooth] = 0.5
    # Newton's method: the speed of a smooth piece varies by a factor of 2.1 at most.
    of_smooth, rest = of_each.rows(of_each.smooth), rest[of_each.smooth]
    missed = 0.0
    for _ in range(8):
        arcs, speed = _arcs(of_smooth, t[of_each.smooth])
        missed = np.abs(arcs - rest).max(initial=0)
        if missed <= _EPS * length:
            break
        t[of_each.smooth] = np.clip(t[of_each.smooth] - (arcs - rest) / speed, 0, 1)
    unknown += missed
    points = _points(of_each, t)
    arc, chord = length / segments + 2 * unknown, np.linalg.norm(np.diff(points, axis=0), axis=1).min()
    bound = 0.5 * np.sqrt(max(arc**2 - chord**2, 0.0)) + 2 * unknown
    return ArcLength(
        control[0] + size * points, float(size * length), float(size * bound), int(pieces.smooth.sum())
    )


def _bezier(control: NDArray, weights: NDArray, knots: NDArray, degree: int) -> _Pieces:
    """Return the pieces between knots: their control points are blossoms at the knots at both ends."""
    begin = np.flatnonzero(np.diff(knots))
    near = begin[:, None] + np.arange(-degree, 1)
    around = knots[begin[:, None] + np.arange(1 - degree, degree + 1)]
    blossoms = []
    for j in range(degree + 1):
        points, of_points = control[near], weights[near]
        for r in range(degree):
            at = knots[begin + (r < j)][:, None]
            low, high = around[:, r:degree], around[:, degree : 2 * degree - r]
            before = (high - at) / (high - low) * of_points[:, :-1]
            after = (at - low) / (high - low) * of_points[:, 1:]
            one, other = _shares(before, after)
            points, of_points = one * points[:, :-1] + other * points[:, 1:], before + after
        blossoms.append((points[:, 0], of_points[:, 0]))
    points, weights = (np.stack(part, axis=1) for part in zip(*blossoms, strict=True))
    # A control point without a weight is arbitrary: it gets the place of the previous one.
    place = np.maximum.accumulate(np.where(weights > 0, np.arange(degree + 1), 0), axis=1)
    points = np.take_along_axis(points, place[..., None], axis=1)
    return _Pieces(points[:, 0], np.diff(points, axis=1), weights, np.zeros(len(points), bool))


def _shares(before: NDArray, after: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the shares of weights (n, k) in their sums, (n, k, 1); halves where both are 0."""
    none = before + after == 0
    both = np.where(none, 2, before + after)
    one, other = (np.where(none, 1, part) / both for part in (before, after))
    return one[..., None], other[..., None]


def _divide(pieces: _Pieces) -> tuple[_Pieces, float]:
    """Halve pieces until all are smooth, or of length 0, and bound the rounding error of the length.

    Weights of pieces that are halved k times have a relative error of ``k (degree + 1)`` roundings, their
    shares twice that, and each of the ``degree`` rows of the algorithm adds as much times the polygon.
    """
    number, degree, dims = pieces.steps.shape
    rounding = 16 * degree**2 * np.sqrt(dims) * _EPS * number
    going = np.ones(len(pieces.start), bool)
    for level in count(1):
        polygons = np.linalg.norm(pieces.steps, axis=2).sum(axis=1)
        rounding += (degree + 4) * (level * degree + 6) * _EPS * polygons[going].sum()
        pieces.smooth[going] = _smooth(pieces.rows(going))
        going &= ~pieces.smooth & (polygons > _EPS * polygons.sum())
        if not going.any():
            break
        if len(going) + going.sum() > _MOST:
            raise ValueError(f"the length of the curve must take at most {_MOST} pieces, got more")
        halves = _halve(pieces.rows(going))
        times = 1 + going
        pieces, going = _Pieces(*(np.repeat(part, times, axis=0) for part in pieces)), np.repeat(going, times)
        for part, half in zip(pieces, halves, strict=True):
            part[going] = half
    return pieces, rounding


def _halve(pieces: _Pieces) -> _Pieces:
    """Return both halves of pieces, one after another, by de Casteljau's algorithm."""
    steps, weights = pieces.steps, pieces.weights
    first, last, left, right = [weights[:, 0]], [weights[:, -1]], [], []
    for _ in range(steps.shape[1]):
        one, other = _shares(weights[:, :-1], weights[:, 1:])
        before, after = other * steps, one * steps
        steps, weights = after[:, :-1] + before[:, 1:], 0.5 * (weights[:, :-1] + weights[:, 1:])
        left.append(before[:, 0])
        right.append(after[:, -1])
        first.append(weights[:, 0])
        last.append(weights[:, -1])
    steps, weights = (
        np.stack([np.stack(part, axis=1) for part in both], axis=1)
        for both in ((left, right[::-1]), (first, last[::-1]))
    )
    start = np.stack([pieces.start, pieces.start + steps[:, 0].sum(axis=1)], axis=1)
    halves = start, steps, weights, np.stack([pieces.smooth, pieces.smooth], axis=1)
    return _Pieces(*(part.reshape(-1, *part.shape[2:]) for part in halves))


def _numerator(pieces: _Pieces) -> NDArray[np.float64]:
    """Return Bernstein coefficients, (n, 2 degree - 1, d), of the derivative times the squared denominator.

    With weights w and points P, it is the sum over i < j of ``(j - i) B_i B_j w_i w_j (P_j - P_i) / t / (1 -
    t)``: a sum of products of positive numbers and differences.
    """
    count, degree, dims = pieces.steps.shape
    result = np.zeros((count, 2 * degree - 1, dims))
    for i in range(degree):
        apart = np.zeros((count, dims))
        for j in range(i + 1, degree + 1):
            apart = apart + pieces.steps[:, j - 1]
            share = (j - i) * comb(degree, i) * comb(degree, j) / comb(2 * degree - 2, i + j - 1)
            result[:, i + j - 1] += (share * pieces.weights[:, i] * pieces.weights[:, j])[:, None] * apart
    return result


def _smooth(pieces: _Pieces) -> NDArray[np.bool_]:
    """Return where speeds are analytic, and nearly constant, in a disc around the middle of pieces.

    In the disc of twice the radius, where s = 2 t - 1 is at most 2, numerator and denominator differ by no
    more than 0.3 of their values in the middle from these. So the speed is at most 2.7 times that there. The
    disc holds the ellipse with foci -1 and 1 and ``rho = 2 + sqrt(3)``, and that of each part that starts at
    -1: 16 nodes have an error below ``64 / 15 * 2.7 * rho**-30 / (1 - rho**-2) < 1e-16`` of that speed.
    """
    result = np.ones(len(pieces.start), bool)
    for given in (pieces.weights[..., None], _numerator(pieces)):
        powers = _powers(given.shape[1] - 1)
        sizes = np.linalg.norm(powers @ given, axis=2) * 2.0 ** np.arange(len(powers))
        result &= sizes[:, 1:].sum(axis=1) < 0.3 * sizes[:, 0]
    return result


@cache
def _powers(degree: int) -> NDArray[np.float64]:
    """Return the matrix from Bernstein coefficients in t to coefficients of powers of 2 t - 1."""
    up, down = np.polynomial.Polynomial([0.5, 0.5]), np.polynomial.Polynomial([0.5, -0.5])
    basis = (comb(degree, k) * up**k * down ** (degree - k) for k in range(degree + 1))
    return np.stack([np.asarray(one.coef, np.float64) for one in basis], axis=1)


def _arcs(pieces: _Pieces, t: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return arc lengths of smooth pieces from 0 to t, and speeds at t."""
    at = np.concatenate([0.5 * t[:, None] * (1 + _NODES), t[:, None]], axis=1)
    speeds = np.linalg.norm(_sum(_numerator(pieces), at) / _sum(pieces.weights[..., None], at) ** 2, axis=2)
    return 0.5 * t * (speeds[:, :-1] @ _SHARES), speeds[:, -1]


def _points(pieces: _Pieces, t: NDArray) -> NDArray[np.float64]:
    from_start = np.cumsum(np.pad(pieces.steps, ((0, 0), (1, 0), (0, 0))), axis=1)
    weights, t = pieces.weights[..., None], t[:, None]
    above, below = _sum(from_start * weights, t), _sum(weights, t)
    return pieces.start + (above / below)[:, 0]


def _sum(coefficients: NDArray, t: NDArray) -> NDArray[np.float64]:
    """Return polynomials of Bernstein coefficients (n, degree + 1, d) at t, (n, m): (n, m, d)."""
    degree = coefficients.shape[1] - 1
    result = np.zeros((*t.shape, coefficients.shape[2]))
    for k in range(degree + 1):
        result += (comb(degree, k) * t**k * (1 - t) ** (degree - k))[..., None] * coefficients[:, None, k]
    return result

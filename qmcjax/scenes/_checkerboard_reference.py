r"""Exact pixel means of the checkerboards seen in perspective and from above.

**In perspective**: with ``S(t) = (-1)**floor(t)`` the scene is ``(1 + S(X) S(Z)) / 2`` at depth ``Z = s/y``,
``X = c Z``, ``c = x - 1/2``. Write ``v = y/s = 1/Z``. Along a scan line ``S`` integrates to ``T``, the
distance to the nearest even integer. So the mean over a pixel between the column edges ``c0 < c1`` is

    1/2 + width height / 2 (G(c1) - G(c0)),    G(c) = s \int S(1/v) v T(c/v) dv

over the pixel's rows. Two facts make ``G`` a finite sum.

*Away from the horizon* it is a sum of trapezoids: ``S(1/v)`` is constant between ``1/(n+1)`` and ``1/n``, and
there ``v T(c/v)`` is linear in ``v`` except for one kink, since ``|c| <= 1/2``.

*At the horizon* there are infinitely many of them, but in ``u = 1/v`` the integrand is ``F(u) u**-3`` with
``F(u) = S(u) T(c u)``, and ``F`` is periodic: a column edge is a rational number, ``2 width c`` an integer.
All periods are summed at once,

    \int_N^\infty F(u) u**-3 du = \int_N^{N+P} F(u) zeta(3, u/P) P**-3 du

with the Hurwitz zeta function as a weight, so smooth that four terms of its Taylor series about the
centre of each square ``n <= u < n+1`` are exact in double precision.

**From above**, at any angle, with derivatives: in coordinates (X, Y) of the board, with the side of a square
as unit, the scene is ``(1 + S(X) S(Y)) / 2`` with ``S(t) = (-1)**floor(t)``. Let ``T`` be the integral of
``S`` from 0: the distance to the nearest even integer. By Green's theorem, for any constant ``C``, the
integral over a pixel is

    \iint S(X) S(Y) dX dY = \oint (T(X) - C) S(Y) dY

along its four sides. On a side the integrand is linear between the crossings with lines of the board, which
gives a sum of trapezoids. With ``C = T(X)`` at the pixel's centre, the size of the pixel limits the effect of
a crossing displaced by rounding.
"""

import math
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from qmcjax.scenes._base import EPS
from qmcjax.scenes._edges import split_segments

Floats = NDArray[np.float64]

_HORIZON = 1024
"""Smallest ``u`` for the sum over periods: below it the Taylor series are too short."""

_CHUNK = 2**17
"""Number of (column edge, piece) pairs in memory at a time, to fit the cache."""


def pixel_means(
    squares: float, width: int, height: int, horizon: int = _HORIZON
) -> tuple[NDArray[np.float64], float]:
    """Return the means over all pixels, shape (height, width), and a bound on their errors.

    From ``u = horizon`` on, the pattern is summed by periods; the result does not depend on it.
    """
    period = (2 if width % 2 == 0 else 4) * width
    if squares * height > 2.0**52:  # then |mean - 1/2| <= the bound, by the second mean value theorem
        return np.full((height, width), 0.5), width * height * period / (2 * squares) / squares

    # F is even in c, and G(0) = 0.
    distances = np.arange(2 - width % 2, width + 1, 2)
    rows = np.arange(1, height + 1)
    # Rows with the horizon or more than two periods: the top ones.
    top = min(height, 1 + int(np.count_nonzero(2.0 * period * rows * (rows + 1) < squares * height)))
    edges = rows / (squares * height)
    halves = np.zeros((height, width // 2 + 1))
    columns = halves[:, 1 - width % 2 :]

    above = np.zeros(len(distances))
    for row in range(top):
        first = max(math.ceil(1 / edges[row]), horizon)
        strip = np.array([min(1 / first, edges[row]), edges[row]])
        below = _strips(distances, width, strip)[:, 0] + _to_horizon(distances, width, period, first)
        columns[row] = below - above
        above = below
    if top < height:
        columns[top:] = _strips(distances, width, edges[top - 1 :]).T

    scale = 0.5 * width * height * squares
    image = 0.5 + scale * np.diff(halves[:, abs(2 * np.arange(width + 1) - width) // 2], axis=1)
    return image, _bound(squares, width, height, max(1 / edges[top - 1], horizon))


def _strips(distances: NDArray[np.int64], width: int, edges: Floats) -> Floats:
    r"""Integrate ``S(1/v) v T(c/v)`` over each strip between two ``edges`` by trapezoids.

    In a piece ``c/v`` stays within 1 of ``k``, the integer nearest to it in the middle. There
    ``v T(c/v) = |c - k v|`` for even and ``v - |c - k v|`` for odd ``k``.
    """
    first, last = math.ceil(1 / edges[-1]), math.floor(1 / edges[0])
    borders = np.clip(1 / np.arange(max(first, 1), last + 1), edges[0], edges[-1])
    v = np.sort(np.concatenate([edges, borders]))
    starts = np.searchsorted(v, edges[:-1])
    low, high = v[:-1], v[1:]
    middle = 0.5 * (low + high)
    weight = (high - low) * parity(np.floor(1 / middle))

    sums = np.empty((len(distances), len(starts)))
    for part in _chunks(len(distances), len(low)):
        c = (distances[part] / (2 * width))[:, None]
        k = np.rint(c / middle)
        at_low, at_high = c - k * low, c - k * high
        total = abs(at_low) + abs(at_high)
        kink = np.maximum(-at_low * at_high, 0) / np.maximum(total, np.finfo(float).tiny)
        sign = parity(k)
        mean = 0.5 * (1 - sign) * middle + sign * (0.5 * total - kink)
        sums[part] = np.add.reduceat(weight * mean, starts, axis=1)
    return sums


def _to_horizon(distances: NDArray[np.int64], width: int, period: int, first: int) -> Floats:
    r"""Integrate ``F(u) u**-3`` from ``first`` to infinity, over one period with the Hurwitz zeta function.

    With ``u = n + 1/2 + x``, ``|x| <= 1/2``, and ``k`` the integer nearest to ``c (n + 1/2)``, ``T(c u)`` is
    ``c |x - kink|`` for even and ``1 - c |x - kink|`` for odd ``k``; its moments are polynomials in ``kink``.
    """
    from scipy.special import zeta

    centre = (first + np.arange(period) + 0.5) / period
    taylor = [
        (-1) ** j * math.comb(j + 2, 2) * zeta(3 + j, centre) / float(period) ** (3 + j) for j in range(4)
    ]
    numerator = 2 * (first % period + np.arange(period)) + 1
    square = parity(first + np.arange(period))

    sums = np.empty(len(distances))
    for part in _chunks(len(distances), period):
        distance = distances[part, None]
        product = (distance * numerator).astype(float)  # 4 width c (n + 1/2): exact
        k = np.floor((product + 2 * width) / (4 * width))
        kink = (4 * width * k - product) / (2 * distance)
        inside = np.clip(kink, -0.5, 0.5)
        outside = abs(kink - inside)
        squared = inside * inside
        moment = taylor[0] * (squared + 0.25 + outside)
        moment += taylor[1] * inside * (squared / 3 - 0.25)
        moment += taylor[2] * (squared * squared / 6 + 1 / 32 + outside / 12)
        moment += taylor[3] * inside * (squared * squared / 10 - 1 / 32)
        sign = parity(k)
        whole = 0.5 * (1 - sign) * (taylor[0] + taylor[2] / 12)
        sums[part] = np.sum(square * (whole + sign * distance / (2 * width) * moment), axis=1)
    return sums


def _bound(squares: float, width: int, height: int, first: float) -> float:
    """Bound the truncation of the Taylor series and the rounding.

    The first omitted term is at most ``15 n**-7 x**4`` on the square that starts at ``n``; integrated over
    all squares it is below ``0.04 first**-6``, for each of two column edges and at most two row edges.
    Rounding: the means are ``width`` times differences of terms with relative errors of a few units each.
    """
    truncation = 0.08 * width * height * squares * first**-6
    return truncation + 16 * width * EPS


def parity(integers: NDArray) -> Floats:
    """Return 1 for even and -1 for odd integers."""
    half = 0.5 * integers
    return 1 - 4 * (half - np.floor(half))


def _chunks(count: int, length: int) -> list[slice]:
    """Cut ``count`` rows of ``length`` entries into blocks of about ``_CHUNK`` entries."""
    step = max(1, _CHUNK // length)
    return [slice(i, i + step) for i in range(0, count, step)]


_PIECES = 2**18
"""Number of pieces of the borders of pixels in memory at a time."""


def flat_means(squares: float, angle: float, width: int, height: int) -> tuple[Floats, float]:
    """Return the means over all pixels, shape (height, width), and a bound on their errors.

    Positions on the image are off by a few EPS. A line displaced by that much changes the mean of a pixel by
    that much times ``width`` or ``height``, the inverse of its sides. A pixel of many squares has many lines,
    each with a smaller effect.
    """
    axis = squares * math.cos(angle), squares * math.sin(angle)
    columns, rows = np.arange(width + 1) / width - 0.5, np.arange(height + 1) / height - 0.5
    # Each border of pixels, from its first to its last corner.
    down = _along(_on_board(columns, -0.5, axis), _on_board(columns, 0.5, axis), height)
    right = _along(_on_board(-0.5, rows, axis), _on_board(0.5, rows, axis), width)
    # Around a pixel from x to y: right along its first row border, down its last column border, and back.
    weighted, plain = (np.diff(d, axis=0).T - np.diff(r, axis=0) for d, r in zip(down, right, strict=True))
    centre, _ = _on_board(0.5 * (columns[:-1] + columns[1:]), 0.5 * (rows[:-1] + rows[1:])[:, None], axis)
    integral = weighted - _zigzag(centre) * plain
    return 0.5 + 0.5 * width * height * integral / squares**2, 8 * EPS * max(width, height)


def flat_gradients(squares: float, angle: float, width: int, height: int) -> tuple[Floats, Floats, float]:
    """Return the derivatives with respect to ``squares`` and ``angle``, and a bound on their errors.

    A point ``s`` along the line ``X = k`` moves across it, towards larger X, by ``-k / squares**2`` and
    ``-s``; a point on ``Y = k`` by ``-k / squares**2`` and ``s``, if s is measured along X. The jump is the
    value before the line minus the value behind it. A pixel has at most ``many`` lines in each direction.
    """
    axes = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    half = 0.5 * squares * float(np.abs(axes[0]).sum())
    k = np.arange(1 - math.ceil(half), math.ceil(half))
    sizes, turns = np.zeros((height, width)), np.zeros((height, width))
    many, doubt = 2 + squares * (1 / width + 1 / height), EPS
    for across, onward, sense in ((axes[0], axes[1], -1), (axes[1], axes[0], 1)):
        crossings = 0.5 + 0.5 * np.arange(-math.ceil(squares), math.ceil(squares) + 1) / squares
        step = max(1, _PIECES // (width + height + len(crossings)))
        for lines in (k[i : i + step] for i in range(0, len(k), step)):
            feet = 0.5 + (lines / squares)[:, None] * across
            others = cast(Floats, np.tile(crossings, (len(lines), 1)))
            pieces = split_segments(feet - onward, feet + onward, width, height, others)
            doubt = max(doubt, pieces.doubt)
            line, along = lines[pieces.curve], 2 * pieces.middle - 1
            swept = -2 * pieces.length * parity(line + np.floor(squares * along))
            sizes += pieces.image(-swept * line / squares**2)
            turns += pieces.image(sense * swept * along)
    return sizes, turns, 4 * doubt * many**2 * max(1, 1 / squares) * width * height


def _on_board(x: Floats | float, y: Floats | float, axis: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return X and Y of points, given relative to the centre of the image."""
    cosine, sine = axis
    return np.asarray(x * cosine + y * sine), np.asarray(y * cosine - x * sine)


def _along(start: tuple[Floats, Floats], end: tuple[Floats, Floats], sides: int) -> tuple[Floats, Floats]:
    """Integrate ``T(X) S(Y) dY`` and ``S(Y) dY`` over each of ``sides`` equal parts of parallel segments.

    ``start``, ``end``: (X, Y), each an ndarray of shape (segments,). Returns ndarray, ndarray: shape
    (segments, sides).
    """
    spans = [float(b[0] - a[0]) for a, b in zip(start, end, strict=True)]
    counts = [math.ceil(abs(span)) for span in spans]
    step = max(1, _PIECES // (sides + sum(counts)))
    weighted: list[Any] = []
    plain: list[Any] = []
    for first in range(0, len(start[0]), step):
        origin = [a[first : first + step, None] for a in start]
        breaks: list[Floats] = [np.broadcast_to(np.arange(sides + 1) / sides, (len(origin[0]), sides + 1))]
        for at, span, count in zip(origin, spans, counts, strict=True):
            lines = np.ceil(np.minimum(at, at + span)) + np.arange(count, dtype=float)
            breaks.append((lines - at) / span if span else 0 * lines)
        t = np.sort(np.clip(np.concatenate(breaks, axis=1), 0, 1), axis=1)
        middle = 0.5 * (t[:, 1:] + t[:, :-1])
        signed = parity(np.floor(origin[1] + spans[1] * middle)) * spans[1] * np.diff(t, axis=1)
        height = _zigzag(origin[0] + spans[0] * t)
        part = np.minimum((middle * sides).astype(np.intp), sides - 1)
        part += sides * np.arange(len(t))[:, None]
        for sums, terms in ((weighted, 0.5 * (height[:, 1:] + height[:, :-1]) * signed), (plain, signed)):
            total = np.bincount(part.ravel(), terms.ravel(), sides * len(t))
            sums.append(total.reshape(len(t), sides))
    return np.concatenate(weighted), np.concatenate(plain)


def _zigzag(t: Floats) -> Floats:
    """Return the distance to the nearest even integer."""
    return np.abs(t - 2 * np.rint(0.5 * t))

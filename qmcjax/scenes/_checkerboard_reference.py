r"""Exact pixel means of the checkerboard seen in perspective.

With ``S(t) = (-1)**floor(t)`` the scene is ``(1 + S(X) S(Z)) / 2`` at depth ``Z = s/y``, ``X = c Z``,
``c = x - 1/2``. Write ``v = y/s = 1/Z``. Along a scan line ``S`` integrates to ``T``, the distance to the
nearest even integer. So the mean over a pixel between the column edges ``c0 < c1`` is

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
"""

import math

import numpy as np
from numpy.typing import NDArray

from qmcjax.scenes._base import EPS

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

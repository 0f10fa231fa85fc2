r"""Exact pixel means of a flat checkerboard at any angle, and their derivatives.

In coordinates (X, Y) of the board, with the side of a square as unit, the scene is ``(1 + S(X) S(Y)) / 2``
with ``S(t) = (-1)**floor(t)``. Let ``T`` be the integral of ``S`` from 0: the distance to the nearest even
integer. By Green's theorem, for any constant ``C``, the integral over a pixel is

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
from qmcjax.scenes._checkerboard_reference import parity
from qmcjax.scenes._edges import split_segments

Floats = NDArray[np.float64]

_CHUNK = 2**18
"""Number of pieces of the borders of pixels in memory at a time."""


def pixel_means(squares: float, angle: float, width: int, height: int) -> tuple[Floats, float]:
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


def pixel_gradients(squares: float, angle: float, width: int, height: int) -> tuple[Floats, Floats, float]:
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
        step = max(1, _CHUNK // (width + height + len(crossings)))
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
    step = max(1, _CHUNK // (sides + sum(counts)))
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

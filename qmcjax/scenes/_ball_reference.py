"""Exact pixel means of a disc that moves along a straight line, in NumPy and float64.

At any time the mean is the area of the disc within the pixel. Over time it is analytic except where the
circle passes a corner of the pixel or touches one of its edges; there it grows like the power 3/2 of the time
since. Between these times the substitution ``s**2 (3 - 2 s)`` removes these powers, and Gauss-Legendre
quadrature converges fast.
"""

import numpy as np
from numpy.typing import NDArray

from qmcjax.scenes._base import EPS
from qmcjax.scenes._circle_area import disc_in_boxes

Floats = NDArray[np.float64]

_NODES = 32
_CHUNK = 2**12
"""Number of pixels that are integrated at a time: fits the cache."""


def swept_means(
    start: Floats, way: Floats, radius: float, width: int, height: int, nodes: int = _NODES
) -> tuple[Floats, float]:
    """Return the means over time and pixels of a disc whose centre moves from ``start`` by ``way``."""
    size = 1 + float(abs(start).max() + abs(way).max()) + radius
    bound = 5e-13 + 8 * EPS * size * max(width, height)
    x, y = np.arange(width + 1) / width, np.arange(height + 1) / height
    if not way.any():
        areas = disc_in_boxes(start[0], start[1], radius, x[:-1], x[1:], y[:-1, None], y[1:, None])
        return width * height * areas, bound

    outside, inside = _sides(start, way, radius, x, y)
    image = inside.astype(float)
    rows, columns = np.nonzero(~outside & ~inside)
    for first in range(0, len(rows), _CHUNK):
        row, column = rows[first : first + _CHUNK], columns[first : first + _CHUNK]
        box = x[column], x[column + 1], y[row], y[row + 1]
        image[row, column] = width * height * _integrals(start, way, radius, box, nodes)
    return image, bound


def _integrals(start: Floats, way: Floats, radius: float, box: tuple[Floats, ...], nodes: int) -> Floats:
    """Integrate the area within each of some boxes over time."""
    cuts = np.sort(np.stack(_kinks(start, way, radius, box), axis=1), axis=1)
    length = np.diff(cuts, axis=1)
    which, piece = np.nonzero(length > 0)
    begin, length = cuts[which, piece], length[which, piece]
    box = tuple(side[which] for side in box)
    total = np.zeros(len(which))
    node, weight = np.polynomial.legendre.leggauss(nodes)
    for s, w in zip(0.5 * (1 + node), 0.5 * weight, strict=True):
        time = begin + length * (s * s * (3 - 2 * s))
        area = disc_in_boxes(start[0] + time * way[0], start[1] + time * way[1], radius, *box)
        total += w * 6 * s * (1 - s) * length * area
    return np.bincount(which, total, minlength=len(cuts)).astype(np.float64)


def _kinks(start: Floats, way: Floats, radius: float, box: tuple[Floats, ...]) -> list[Floats]:
    """Return all times in [0, 1] at which the circle passes corners or touches the lines of the edges."""
    x0, x1, y0, y1 = box
    squared = way @ way
    times = [np.zeros_like(x0), np.ones_like(x0)]
    for x in (x0, x1):
        for y in (y0, y1):
            dx, dy = x - start[0], y - start[1]
            along = (dx * way[0] + dy * way[1]) / squared
            beside = abs(dx * way[1] - dy * way[0]) / np.sqrt(squared)
            half = np.sqrt(np.maximum(radius - beside, 0) * (radius + beside) / squared)
            times += [along - half, along + half]
    for axis, edges in enumerate(((x0, x1), (y0, y1))):
        if way[axis]:
            times += [(edge + r - start[axis]) / way[axis] for edge in edges for r in (-radius, radius)]
    return [np.clip(time, 0, 1) for time in times]


def _sides(
    start: Floats, way: Floats, radius: float, x: Floats, y: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return pixels that the disc certainly never touches or always covers, by circles around them."""
    inside = np.ones((len(y) - 1, len(x) - 1), bool)
    for end in (start, start + way):
        dx, dy = abs(x - end[0]), abs(y - end[1])
        far = np.maximum(dx[:-1], dx[1:]) ** 2 + np.maximum(dy[:-1], dy[1:])[:, None] ** 2
        inside &= far <= radius * radius
    mx, my = 0.5 * (x[:-1] + x[1:]) - start[0], (0.5 * (y[:-1] + y[1:]) - start[1])[:, None]
    part = np.clip((mx * way[0] + my * way[1]) / (way @ way), 0, 1)
    near = np.hypot(mx - part * way[0], my - part * way[1])
    return near > radius + np.hypot(x[1] - x[0], y[1] - y[0]), inside

r"""Exact pixel means of a blurred half plane, in NumPy and float64.

With the unit vector ``n`` across the edge and a random displacement ``B``, the mean over a pixel is
the probability of ``n . p + B < offset`` for ``p`` uniform in the pixel. So it is

    \int f(s) C(d - s) ds,

where ``d`` is the offset from the pixel's centre, ``f`` the density of ``n . p`` about the centre, a
trapezoid, and ``C`` the distribution function of ``B``. On each piece between their kinks the integrand is
polynomial or analytic, and Gauss-Legendre quadrature exact. All terms are positive.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from qmcjax.scenes._base import EPS

Floats = NDArray[np.float64]


def smeared_by_box(
    angle: float, offset: float, widths: tuple[float, float], width: int, height: int, scale: float = 1.0
) -> tuple[Floats, float]:
    """Return the means for a ``B`` that is the sum of two uniform distributions of these widths about 0.

    The image is shrunk by ``scale`` about its centre.
    """
    large, small = max(widths), min(widths)
    nodes, weights = np.polynomial.legendre.leggauss(2)  # both factors are quadratic at most, one linear

    def means(d: Floats, across: float, down: float) -> Floats:
        kinks = d[:, None] + _corners(large, small)
        corners = np.broadcast_to(_corners(across, down), kinks.shape)
        reach = 0.5 * (across + down)
        ends = np.sort(np.clip(np.concatenate([corners, kinks], axis=1), -reach, reach), axis=1)
        total = np.zeros_like(d)
        for node, weight in zip(nodes, weights, strict=True):
            length = np.diff(ends, axis=1)
            s = ends[:, :-1] + 0.5 * (1 + node) * length
            below = _distribution(d[:, None] - s, large, small)
            total += np.sum(0.5 * weight * length * _density(s, across, down) * below, axis=1)
        return total

    return _image(means, angle, offset, 0.5 * (large + small), width, height, scale, large)


def smeared_by_disc(
    angle: float, offset: float, radius: float, width: int, height: int
) -> tuple[Floats, float]:
    """Return the means for a ``B`` that is a coordinate of a uniform point in a disc of this radius.

    With ``B = radius sin(phi)`` its distribution function is ``1/2 + (phi + sin(phi) cos(phi)) / pi``.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)  # an entire function on at most half a turn

    def means(d: Floats, across: float, down: float) -> Floats:
        ends = np.clip(d[:, None] - _corners(across, down)[::-1], -radius, radius)
        phi = np.arcsin(ends / radius)
        first, half = phi[:, :-1], 0.5 * np.diff(phi, axis=1)
        total = _distribution(d - radius, across, down)
        for node, weight in zip(nodes, weights, strict=True):
            at = first + (1 + node) * half
            below = 0.5 + (at + np.sin(at) * np.cos(at)) / math.pi
            s = d[:, None] - radius * np.sin(at)
            total += np.sum(weight * half * radius * np.cos(at) * _density(s, across, down) * below, axis=1)
        return total

    return _image(means, angle, offset, radius, width, height, 1.0, 0.0)


def _image(
    means: Callable[[Floats, float, float], Floats],
    angle: float,
    offset: float,
    reach: float,
    width: int,
    height: int,
    scale: float,
    spread: float,
) -> tuple[Floats, float]:
    """Return the means of the pixels that the blurred edge meets, and 0 and 1 elsewhere; and a bound.

    Distances are measured from the centre of the image, so that nothing is lost for small ``scale``. Their
    error is a few units of rounding, and that of means is the same times the largest density of ``n . p +
    B``: 1 over the width of a pixel, or over ``spread``, that of ``B``.
    """
    normal = math.cos(angle), math.sin(angle)
    sides = scale * abs(normal[0]) / width, scale * abs(normal[1]) / height
    x, y = 0.5 - (np.arange(width) + 0.5) / width, 0.5 - (np.arange(height) + 0.5) / height
    d = offset - 0.5 * (normal[0] + normal[1]) + scale * (normal[0] * x + normal[1] * y[:, None])
    image = (d > 0).astype(float)
    met = abs(d) < 0.5 * sum(sides) + reach
    image[met] = means(d[met], max(sides), min(sides))
    density = max(1.0, 1 / max(scale / max(width, height), spread))
    return image, 8 * EPS * density * (1 + abs(offset) + reach)


def _corners(large: float, small: float) -> Floats:
    """Return the kinks of the density of the sum of two uniform distributions about 0, in order."""
    outer, inner = 0.5 * (large + small), 0.5 * (large - small)
    return np.array([-outer, -inner, inner, outer])


def _density(s: Floats, large: float, small: float) -> Floats:
    """Return the density of the sum of two uniform distributions about 0, ``large >= small``."""
    inside = np.maximum(0.5 * (large + small) - abs(s), 0)
    return np.minimum(inside / max(small, _TINY), 1) / large


def _distribution(z: Floats, large: float, small: float) -> Floats:
    """Return the distribution function of the same sum; a step if both widths are 0."""
    m = abs(z)
    tail = np.maximum(0.5 * (large + small) - m, 0)
    curved = np.minimum(tail, small)
    upper = (0.5 * curved * (curved / max(small, _TINY)) + (tail - curved)) / max(large, _TINY)
    return np.where(z > 0, 1 - upper, upper)


_TINY = 1e-300

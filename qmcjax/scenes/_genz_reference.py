r"""Exact pixel means of Genz's six families, all without cancellation.

Four are products of functions of one coordinate with means in closed form, and the oscillatory family is
the real part of one. The mean of the corner peak is an alternating sum over the corners of the box,
which loses all digits in high dimensions or where ``a`` is small. Instead the peak is written as

    (1 + s)^{-(d+1)} = \int_0^\infty e^{-t (1+s)} t^d / d! dt,    s = \sum a_j x_j,

whose integrand is a product again and positive. In ``z = log t`` it is analytic up to a distance of
``pi / 2`` from the real axis and decays at both ends: the trapezoidal rule converges exponentially.
"""

import math

import numpy as np
from numpy.typing import NDArray

from qmcjax.scenes._base import EPS
from qmcjax.scenes._factors import bell_means, decay_means, separable

Floats = NDArray[np.float64]
Means = tuple[Floats, float]


def oscillatory(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> NDArray[np.complex128]:
        return np.exp(1j * a[j] * (low + 0.5 * length)) * np.sinc(a[j] * length / (2 * math.pi))

    waves = separable(mean, len(a), width, height) * np.exp(2j * math.pi * u[0])
    # All factors have modulus at most 1: only the rounded phases count, and a few units for each product.
    return waves.real, EPS * (8 * len(a) + 2 * float(a.sum()) + 7 * abs(float(u[0])))


def product_peak(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        left = a[j] * (low - u[j])
        right = a[j] * (low + length - u[j])
        # arctan(right) - arctan(left)
        return (a[j] / length) * np.arctan2(a[j] * length, 1 + left * right)

    return _relative(separable(mean, len(a), width, height), len(a), a * (1 + abs(u)))


def corner_peak(a: Floats, u: Floats, width: int, height: int) -> Means:
    del u
    dims, step = len(a), 0.125
    # Below t = 1 / (1 + sum a) the integrand falls like t**(d+1): a part of at most exp(-48) is left out.
    first = -16 - math.log1p(a.sum())
    z = first + step * np.arange(math.ceil((7 - first) / step))
    t = np.exp(z)
    weight = step * np.exp((dims + 1) * z - t - math.lgamma(dims + 1))
    for j in range(2, dims):
        weight *= decay_means(a[j], t)

    def mean(j: int, count: int) -> Floats:
        return np.exp(-a[j] * np.outer(np.arange(count) / count, t)) * decay_means(a[j], t / count)

    return _relative((mean(1, height) * weight) @ mean(0, width).T, dims, (dims + 1) * a)


def gaussian(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        return bell_means(a[j] * (low - u[j]), float(a[j]) * length)

    # Steepest at the peak's sides, or at the nearest end of [0, 1] if the peak is outside.
    slopes = 2 * a * (1 + abs(u)) * (1 + a * np.maximum(np.maximum(-u, u - 1), 0))
    return _relative(separable(mean, len(a), width, height), len(a), slopes)


def continuous(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        left = np.clip(u[j] - low, 0, length)
        right = length - left
        before = np.exp(-a[j] * np.maximum(u[j] - low - length, 0)) * left * decay_means(a[j], left)
        after = np.exp(-a[j] * np.maximum(low - u[j], 0)) * right * decay_means(a[j], right)
        return (before + after) / length

    return _relative(separable(mean, len(a), width, height), len(a), a * (1 + abs(u)))


def discontinuous(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        part = np.clip(u[j] - low, 0, length) if j < 2 else np.full_like(low, length)
        return np.exp(a[j] * (low + part)) * decay_means(a[j], part) * (part / length)

    image, bound = _relative(separable(mean, len(a), width, height), len(a), a)
    # The jump is known to one rounding.
    return image, bound + 2 * EPS * (width + height) * float(image.max())


def _relative(image: Floats, dims: int, slopes: Floats) -> Means:
    """Bound the rounding: a few units in each factor, and each coordinate's times the relative slope."""
    return image, EPS * (16 * dims + 2 * float(slopes.sum())) * float(image.max())

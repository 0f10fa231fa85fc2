"""Pixel means of products of functions of one coordinate each, in NumPy and float64."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def separable(mean: Callable[[int, Floats, float], NDArray], dims: int, width: int, height: int) -> NDArray:
    """Return the pixel means of a product of ``dims`` factors, shape (height, width).

    ``mean(j, low, length)`` gives the mean of factor ``j`` over each interval from ``low`` on.
    """
    across = mean(0, np.arange(width) / width, 1 / width)
    along = mean(1, np.arange(height) / height, 1 / height)
    others = 1.0
    for j in range(2, dims):
        others = others * mean(j, np.zeros(1), 1.0)[0]
    return np.outer(along * others, across)


def bell_means(low: Floats, length: float) -> Floats:
    """Return the means of ``exp(-z**2)`` from ``low`` to ``low + length``, relatively exact in the tails.

    Where the function changes by less than ``exp(6)``, differences of error functions lose digits, and 12
    Gauss-Legendre nodes are exact to 1e-17. On the far side of 0 the complementary function keeps them.
    """
    from scipy.special import erf, erfc

    high = low + length
    nodes, weights = np.polynomial.legendre.leggauss(12)
    z = low[:, None] + (0.5 * length) * (1 + nodes)
    short = np.exp(-z * z) @ (0.5 * weights)

    near, far = np.where(low + high > 0, (low, high), (-high, -low))
    integral = np.where(near > 0, erfc(np.maximum(near, 0)) - erfc(far), erf(far) - erf(near))
    steepness = length * (1 + 2 * far)
    return np.where(steepness <= 6, short, 0.5 * np.sqrt(np.pi) / length * integral)


def decay_means(rate: float, length: Floats) -> Floats:
    """Return the means of ``exp(-rate t)`` over ``0 <= t <= length``; 1 where the length is 0."""
    exponent = np.asarray(rate * length)
    whole = np.where(exponent == 0, 1.0, exponent)
    return np.where(exponent == 0, 1.0, -np.expm1(-whole) / whole)

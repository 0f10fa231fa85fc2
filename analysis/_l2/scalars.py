"""Numbers as sums of two float64, and the factors of kernels, one at a time: for loops that Numba compiles.

As `double_double` and `Kernel.factors`, which prove exactness. Unlike there, the second number of a
product may be a few times as large as the rounding errors of the first: sums reduce it again.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._loops import compiled, multiply_add

Scalars = tuple[float, float]
"""A number and its rounding error."""


@compiled
def two_sum(a: float, b: float) -> Scalars:
    high = a + b
    part = high - a
    return high, (a - (high - part)) + (b - part)


@compiled
def two_product(a: float, b: float) -> Scalars:
    high = a * b
    return high, multiply_add(a, b, -high)


@compiled
def add(a: float, b: float, c: float, d: float) -> Scalars:
    high, low = two_sum(a, c)
    low += b + d
    total = high + low
    return total, low - (total - high)


@compiled
def multiply(a: float, b: float, c: float, d: float) -> Scalars:
    high, low = two_product(a, c)
    return high, low + (a * d + b * c)


@compiled
def quadratic(x: float, offset: float, first: float, bend: float, second: float) -> Scalars:
    """Return offset + first x + bend |x - 1/2| + second x^2."""
    high, low = two_product(first, x)
    high, low = add(high, low, offset, 0.0)
    if bend != 0:
        a, b = two_product(bend, abs(x - 0.5))
        high, low = add(high, low, a, b)
    if second != 0:
        a, b = two_product(x, x)
        a, b = multiply(a, b, second, 0.0)
        high, low = add(high, low, a, b)
    return high, low


@compiled
def factor(x: float, numbers: NDArray[np.float64], upper: bool, r: int) -> Scalars:
    """Return L_r(x) or U_r(x)."""
    constant, linear, bend, distance, square = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    if upper and r == 0:
        return quadratic(x, constant, linear + distance, bend, square)
    if not upper and r == 1:
        return quadratic(x, 0.0, linear - distance, bend, square)
    if r == 2:
        return two_product(-2 * square, x) if upper else (x, 0.0)
    return 1.0, 0.0

"""Numbers as unevaluated sums of two float64, and sums without rounding errors.

The squared discrepancy of good points is smaller than the three sums it consists of by a factor of
about n^2: anything rounded off at 53 bits is missing from it.
"""

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce

import jax.numpy as jnp
import numpy as np
from jax import Array

Wide = tuple[Array, Array]
"""A float64 array and the error of rounding to it."""

_HALVES = 2.0**27 + 1


def constant(value: Fraction) -> Wide:
    high = float(value)
    return jnp.float64(high), jnp.float64(float(value - Fraction(high)))


def two_sum(x: Array, y: Array) -> Wide:
    """Return x + y exactly [Knuth, The Art of Computer Programming 2, Sect. 4.2.2, Theorem B]."""
    high = x + y
    part = high - x
    return high, (x - (high - part)) + (y - part)


def two_product(x: Array, y: Array) -> Wide:
    """Return x y exactly, from halves of 26 bits [Dekker, 1971]."""
    high = x * y
    (x0, x1), (y0, y1) = _halves(x), _halves(y)
    return high, ((x0 * y0 - high) + x0 * y1 + x1 * y0) + x1 * y1


def add(x: Wide, y: Wide) -> Wide:
    high, low = two_sum(x[0], y[0])
    return two_sum(high, low + (x[1] + y[1]))


def multiply(x: Wide, y: Wide) -> Wide:
    high, low = two_product(x[0], y[0])
    return two_sum(high, low + (x[0] * y[1] + x[1] * y[0]))


def product(factors: Sequence[Wide]) -> Wide:
    return reduce(multiply, factors)


def split(x: Array, bound: float) -> Wide:
    """Split into multiples of a power of two, with exact sums up to ``bound``, and the rest."""
    unit = 2.0 ** (int(np.ceil(np.log2(bound))) - 52)
    high = jnp.rint(x * (1 / unit)) * unit
    return high, x - high


def total(x: Wide, bound: float) -> Wide:
    """Sum over all elements; their absolute values sum to at most ``bound``."""
    high, low = split(x[0], bound)
    return two_sum(high.sum(), (low + x[1]).sum())


def _halves(x: Array) -> Wide:
    scaled = x * _HALVES
    high = scaled - (scaled - x)
    return high, x - high

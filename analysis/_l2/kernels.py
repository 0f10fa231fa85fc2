"""The kernels of the L2 discrepancies, in numbers of twice the digits of float64.

The squared discrepancy of good points is smaller than its three sums by a factor of about n^2, so rounding
them to 53 bits is too inaccurate.
"""

from dataclasses import dataclass
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.pytrees import pytree

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


@pytree
@dataclass(frozen=True)
class Kernel:
    """K(x, y) = constant + e(x) + e(y) + distance |x - y| + square (x - y)^2 in one dimension.

    There e(x) = linear x + bend |x - 1/2|. The squared discrepancy is the integral of the product of K
    over the dimensions, twice over the difference of the uniform measure and the points' [Hickernell,
    A generalized discrepancy and quadrature error bound, 1998]. With |x - y| for max and min, all
    discrepancies in use have a kernel of this form.

    The numbers are leaves, so one program serves all kernels. They are multiples of 1/8: sums of them, and of
    their halves and quarters, are exact.
    """

    constant: float
    linear: float = 0.0
    bend: float = 0.0
    distance: float = 0.0
    square: float = 0.0

    def mean(self) -> Wide:
        """Return the integral of K over both arguments."""
        return self._with_third(self.constant + self.linear + self.bend / 2, self.distance + self.square / 2)

    def own(self, x: Array) -> Array:
        """Return e(x)."""
        return self.linear * x + self.bend * jnp.abs(x - 0.5)

    def own_derivative(self, x: Array) -> Array:
        return self.linear + self.bend * jnp.sign(x - 0.5)

    def average(self, x: Array) -> Wide:
        """Return the integral of K(x, y) over y.

        |x - y| has the integral x^2 - x + 1/2 and (x - y)^2 has x^2 - x + 1/3.
        """
        dyadic = self.constant + self.linear / 2 + self.bend / 4 + self.distance / 2
        curve = self.distance + self.square
        return add(self._with_third(dyadic, self.square), self._quadratic(x, -curve, curve))

    def average_derivative(self, x: Array) -> Array:
        return self.own_derivative(x) + (self.distance + self.square) * (2 * x - 1)

    def _quadratic(self, x: Array, first: Array | float, second: Array | float) -> Wide:
        one = jnp.ones_like(x)
        line = two_product((self.linear + first) * one, x)
        bent = two_product(self.bend * one, jnp.abs(x - 0.5))
        curve = multiply(two_product(x, x), (second * one, 0 * one))
        return add(add(line, bent), curve)

    def _with_third(self, whole: Array | float, thirds: Array | float) -> Wide:
        one = jnp.ones(())
        return add((whole * one, 0 * one), multiply((thirds * one, 0 * one), constant(Fraction(1, 3))))


STAR = Kernel(1.0, linear=-1 / 2, distance=-1 / 2)
"""1 - max(x, y)."""

CENTERED = Kernel(1.0, bend=1 / 2, distance=-1 / 2)
SYMMETRIC = Kernel(2.0, distance=-2.0)
WRAPAROUND = Kernel(3 / 2, distance=-1.0, square=1.0)
PERIODIC = Kernel(1 / 2, distance=-1.0, square=1.0)
MIXTURE = Kernel(15 / 8, bend=-1 / 4, distance=-3 / 4, square=1 / 2)

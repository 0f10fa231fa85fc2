"""The kernels of the L2 discrepancies and their sums over pairs, in numbers of twice the digits of float64.

The squared discrepancy of good points is smaller than its three sums by a factor of about n^2, so rounding
them to 53 bits is too inaccurate. Pairs are summed in square tiles, each unordered pair once: both of its
points get their derivatives from the same product without one factor.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import partial

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

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


_TOGETHER = 4
"""Pairs that are added before they are split: saves operations, costs no accuracy."""

_TILE = 64
"""Points along the sides of tiles: a tile fits the L1 cache."""

_LEAST = 2.0**-200
"""Replaces factors of zero, by which one cannot divide."""


def pair_sum(points: Array, kernel: Kernel, gradient: bool) -> tuple[Wide, Array]:
    """Return the sum of the kernel over all ordered pairs, a point and itself included.

    ``points``: float64 Array, shape (n, d). ``gradient``: whether to return derivatives, shape (n, d);
    otherwise their shape is (0, d).
    """
    n, dims = points.shape
    side = min(_TILE, -(-n // _TOGETHER) * _TOGETHER)
    tiles = -(-n // side)
    x = jnp.zeros((dims, tiles * side)).at[:, :n].set(points.T)
    present = jnp.zeros(tiles * side).at[:n].set(1.0)
    own = kernel.own(x)
    ones = jnp.ones(side)

    def cut(array: Array, tile: Array) -> Array:
        return lax.dynamic_slice_in_dim(array, tile * side, side, array.ndim - 1)

    def factor(axis: tuple[Array, ...]) -> tuple[Array, Array]:
        """Return the differences in one dimension, and the kernel there."""
        a, b, own_a, own_b = axis
        delta = a[:, None] - b[None, :]
        distance = jnp.abs(delta)
        between = distance * (kernel.distance + kernel.square * distance)
        kernel_here = own_a[:, None] + (kernel.constant + own_b)[None, :] + between
        return delta, jnp.maximum(kernel_here, _LEAST)

    def step(i: Array, j: Array, sums: tuple[Array, ...]) -> tuple[Array, ...]:
        high, low, gradients = sums
        axes = cut(x, i), cut(x, j), cut(own, i), cut(own, j)
        weight = jnp.where(i == j, 1.0, 2.0) * cut(present, i)[:, None] * cut(present, j)[None, :]
        value, _ = lax.scan(lambda product, axis: (product * factor(axis)[1], None), weight, axes)
        few = value.reshape(_TOGETHER, -1, side).sum(axis=0)
        more_high, more_low = split(few, 2.0 ** (dims + 2) * n * n)
        if gradient:

            def derivative_sums(_: None, axis: tuple[Array, ...]) -> tuple[None, tuple[Array, Array]]:
                delta, kernel_here = factor(axis)
                others = value / kernel_here
                moved = others * (kernel.distance * jnp.sign(delta) + 2 * kernel.square * delta)
                both = jnp.concatenate([others, moved], axis=1)  # one matrix product each way
                rows = jnp.matmul(both.reshape(-1, side), ones).reshape(side, 2).T
                return None, (rows, jnp.matmul(ones, both).reshape(2, side))

            _, (rows, columns) = lax.scan(derivative_sums, None, axes)
            # A tile on the diagonal contains each pair in both orders; other tiles have weight 2.
            for tile, at, sums_at, sign in ((i, axes[0], rows, 1), (j, axes[1], columns, -1)):
                more = (kernel.own_derivative(at) * sums_at[:, 0] + sign * sums_at[:, 1]) / 2
                gradients = lax.dynamic_update_slice_in_dim(
                    gradients, cut(gradients, tile) + more, tile * side, 1
                )
        return high + more_high, low + more_low, gradients

    zeros = jnp.zeros((side // _TOGETHER, side))
    start = zeros, zeros, jnp.zeros((dims, tiles * side if gradient else 0))
    first, last = jnp.int32(0), jnp.int32(tiles)
    high, low, gradients = lax.fori_loop(
        first, last, lambda i, sums: lax.fori_loop(i, last, partial(step, i), sums), start
    )
    return two_sum(high.sum(), low.sum()), 2 * gradients[:, :n].T

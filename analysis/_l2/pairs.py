"""The sum of a product kernel over all pairs of points, and its derivatives.

Pairs are summed in square tiles, each unordered pair once: both of its points get their derivatives from the
same product without one factor.
"""

from functools import partial

import jax.numpy as jnp
from jax import Array, lax

from analysis._l2.kernels import Kernel, Wide, split, two_sum

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

"""The sum of a product kernel over all pairs of points, and its derivatives.

Every axis is cut into strips of equally many points. A pair in the same strip of some axis is summed
directly, at the first such axis. All other pairs are ordered in every axis by their strips alone; there
the kernel is a sum of products of functions of one point (`Kernel.factors`), and the contribution of all
points below or above a point is a prefix sum over cells of strips.

With one strip the pairs are summed in square tiles, each unordered pair once: both of its points get their
derivatives from the same product without one factor.
"""

import itertools
import math
import operator
from functools import partial

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from analysis._l2.kernels import Kernel, Wide, add, product, split, total, two_product, two_sum

_TOGETHER = 4
"""Pairs that are added before they are split: saves operations, costs no accuracy."""

_TILE = 64
"""Points along the sides of tiles: a tile fits the L1 cache."""

_LEAST = 2.0**-200
"""Replaces factors of zero, by which one cannot divide."""

Sums = tuple[Wide, Array]
"""A value, and its derivatives if wanted, shape (n, d), otherwise shape (0, d)."""


def pair_sum(points: Array, kernel: Kernel, strips: int, rank: int, gradient: bool) -> Sums:
    """Return the sum of the kernel over all ordered pairs, a point and itself included.

    ``points``: float64 Array, shape (n, d). ``strips``: number of strips per axis. ``rank``: rank of the
    kernel; no effect with one strip. ``gradient``: whether to return derivatives.
    """
    if strips == 1:
        value, gradients = _all_pairs(points, kernel, gradient)
        return value, 2 * gradients
    n, dims = points.shape
    width = -(-n // strips)
    order = jnp.argsort(points, axis=0)
    ranked = jnp.broadcast_to(jnp.arange(n, dtype=jnp.int32)[:, None] // width, (n, dims))
    strip = jnp.put_along_axis(jnp.zeros_like(ranked), order, ranked, axis=0, inplace=False)

    def axis_sums(sums: Sums, axis: tuple[Array, Array]) -> tuple[Sums, None]:
        return _plus(sums, _near(points, strip, *axis, (strips, width), kernel, gradient)), None

    zero = jnp.zeros(())
    start = (zero, zero), jnp.zeros((n if gradient else 0, dims))
    sums, _ = lax.scan(axis_sums, start, (jnp.arange(dims), order.T))
    sums = _plus(sums, _far(points, strip, strips, kernel, rank, gradient))
    return sums[0], 2 * sums[1]


def _all_pairs(points: Array, kernel: Kernel, gradient: bool) -> Sums:
    """Sum over all pairs, tile by tile and one dimension after the other."""
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
    return two_sum(high.sum(), low.sum()), gradients[:, :n].T


def _plus(sums: Sums, others: Sums) -> Sums:
    return add(sums[0], others[0]), sums[1] + others[1]


def _near(
    points: Array,
    strip: Array,
    axis: Array,
    order: Array,
    shape: tuple[int, int],
    kernel: Kernel,
    gradient: bool,
) -> Sums:
    """Sum over pairs in one strip of this axis, and of no previous axis."""
    n, dims = points.shape
    strips, width = shape
    padded = -(-width // _TOGETHER) * _TOGETHER
    place = np.arange(n) // width * padded + np.arange(n) % width

    def arrange(array: Array) -> Array:
        return jnp.zeros(strips * padded).at[place].set(array[order]).reshape(strips, padded)

    x = [arrange(points[:, j]) for j in range(dims)]
    # The strips of the previous axes. For the others NaN, which equals nothing.
    earlier = [
        arrange(jnp.where(axis > j, strip[:, j].astype(jnp.float64), jnp.nan)) for j in range(dims - 1)
    ]
    own = [kernel.own(c) for c in x]
    present = arrange(jnp.ones(n))

    def pairs(other: Array) -> list[Array]:
        """Return the kernel of each point with one other of its strip, and its derivatives."""

        def pick(array: Array) -> Array:
            return lax.dynamic_slice_in_dim(array, other, 1, 1)

        delta = [a - pick(a) for a in x]
        parts = []
        for d, e in zip(delta, own, strict=True):
            distance = jnp.abs(d)
            between = distance * (kernel.distance + kernel.square * distance)
            parts.append((e + (kernel.constant + pick(e))) + between)
        weight = pick(present)
        for cell in earlier:
            weight = jnp.where(cell == pick(cell), 0.0, weight)
        *before, value = itertools.accumulate(parts, operator.mul, initial=weight)
        found, after = [value], 1.0
        for j in reversed(range(dims if gradient else 0)):
            derivative = kernel.own_derivative(x[j]) + kernel.distance * jnp.sign(delta[j])
            derivative = derivative + 2 * kernel.square * delta[j]
            found.insert(1, derivative * (before[j] * after))
            after = parts[j] * after
        return found

    def step(k: Array, sums: tuple[Array, ...]) -> tuple[Array, ...]:
        value, *gradients = pairs(k * _TOGETHER)
        for i in range(1, _TOGETHER):
            more, *more_gradients = pairs(k * _TOGETHER + i)
            value = value + more
            gradients = [s + t for s, t in zip(gradients, more_gradients, strict=True)]
        high, low = split(value, 2.0 ** (dims + 2) * n * n)
        return tuple(s + t for s, t in zip(sums, (high, low, *gradients), strict=True))

    start = (jnp.zeros((strips, padded)),) * (2 + dims * gradient)
    high, low, *gradients = lax.fori_loop(0, padded // _TOGETHER, step, start)
    value = two_sum((high * present).sum(), (low * present).sum())
    if not gradient:
        return value, jnp.zeros((0, dims))
    found = jnp.stack([s.ravel()[place] for s in gradients], axis=1)
    return value, jnp.zeros((n, dims)).at[order].set(found)


def _far(points: Array, strip: Array, strips: int, kernel: Kernel, rank: int, gradient: bool) -> Sums:
    """Sum over pairs that share no strip.

    Term by term: a factor for each axis, with the other points below or above in each axis.
    """
    n, dims = points.shape
    table = [kernel.factors(points[:, j], rank) for j in range(dims)]
    factors = [jnp.array([[[f[part] for f in role] for role in axis] for axis in table]) for part in (0, 1)]
    gradients = jnp.array([kernel.factor_derivatives(points[:, j], rank) for j in range(dims)])
    # Pairs come in both orders: without derivatives one of them serves for both.
    sides = list(itertools.product((0, 1), repeat=dims))[: 2**dims if gradient else 2 ** (dims - 1)]
    terms = np.array(list(itertools.product(sides, itertools.product(range(rank), repeat=dims))), np.int32)
    bound = 2.0**dims * n

    def term(sums: Sums, choice: Array) -> tuple[Sums, None]:
        above, index = choice[0], choice[1]  # whether the others are the upper ones, and the factor

        def factor(role: Array, j: int) -> Wide:
            high, low = (f[j, role[j], index[j]] for f in factors)
            return high, low

        towards = jnp.where(above == 1, strips - 1 - strip, strip)  # others are those before, in every axis
        cell = jnp.ravel_multi_index(tuple(towards[:, j] for j in range(dims)), (strips,) * dims, mode="clip")
        weights = []
        for role in (above, 1 - above):
            high, low = product([factor(role, j) for j in range(dims)])
            multiple, rest = split(high, bound)
            weights += [multiple, rest + low]
        grid = jnp.zeros((strips**dims, 4)).at[cell].add(jnp.stack(weights, axis=1))
        before = grid[:, :2].reshape(*(strips,) * dims, 2)
        for j in range(dims):
            before = _exclusive_sums(before, j)
        before = before.reshape(-1, 2)
        high, low = two_product(before[:, 0], grid[:, 2])
        low = low + (before[:, 0] * grid[:, 3] + before[:, 1] * grid[:, 2])
        value, found = add(sums[0], total((high, low), bound**2)), sums[1]
        if gradient:
            others = before.sum(axis=1)[cell]
            own = [factor(1 - above, j)[0] for j in range(dims)]
            moved = [gradients[j, 1 - above[j], index[j]] for j in range(dims)]
            for j in range(dims):
                found = found.at[:, j].add(math.prod([*own[:j], moved[j], *own[j + 1 :]], start=others))
        return (value, found), None

    zero = jnp.zeros(())
    start = (zero, zero), jnp.zeros((n if gradient else 0, dims))
    (value, found), _ = lax.scan(term, start, jnp.asarray(terms))
    return value if gradient else (2 * value[0], 2 * value[1]), found


def _exclusive_sums(array: Array, axis: int) -> Array:
    """Return exclusive prefix sums along an axis."""
    rows = jnp.moveaxis(array, axis, 0)
    _, sums = lax.scan(lambda s, row: (s + row, s), jnp.zeros(rows.shape[1:], rows.dtype), rows)
    return jnp.moveaxis(sums, 0, axis)

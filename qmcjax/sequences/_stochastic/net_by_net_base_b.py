"""Scrambled sequences made net by net in base b: Halton's and Faure's."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.bits import high_product
from qmcjax.core.digits import word
from qmcjax.sequences._digital.prime_digital import PrimeDigital
from qmcjax.sequences._halton.halton import RadicalInverses
from qmcjax.sequences._scrambling.owen_exact_base_b import node_of, permuted, random_word_of
from qmcjax.sequences._stochastic.latin_hypercube import first_fraction

_DIGIT, _BEHIND = 2**15, 2**15 + 1
"""Used instead of the depth of a node: the first digit of a point, or the digits after the shared ones."""


def component(sequence: RadicalInverses | PrimeDigital, dim: int, seeds: Array, n: int) -> Array:
    """Return one coordinate of the first n points as 32-bit fractions, uint32 (n,)."""
    base = sequence.bases[dim]
    count = _resolved(base)
    if n > base**count:
        raise ValueError(f"n must be at most {base**count} in base {base}, got {n}")
    shifts = np.zeros((count, count), np.uint32)
    if isinstance(sequence, PrimeDigital):
        with jax.ensure_compile_time_eval():
            shifts = _to_earlier(sequence.matrix(dim)[:count, :count], base)
    return _component(jnp.asarray(shifts), seeds[dim], base, n)


def _resolved(base: int) -> int:
    """Return the number of digits of 32-bit fractions: the largest K with ``base**K <= 2**32``."""
    count = 1
    while base ** (count + 1) <= 2**32:
        count += 1
    return count


def _to_earlier(matrix: NDArray[np.uint32], base: int) -> NDArray[np.uint32]:
    """Return the summands of the lower k digits of an index for each unit of digit k, modulo the base.

    Point a * base**k + j shares its first k digits with the point of index j plus a times row k, digit by
    digit: U_k s = u for the upper left part U_k of the generator matrix and the k numbers u above the
    diagonal in its column k. Faure's matrices are upper triangular.

    ``matrix``: uint32 array, shape (K, K): upper triangular, ones on the diagonal. ``base``: a prime. Returns
    uint32 array, shape (K, K): row k has k numbers, followed by zeros.
    """
    shifts = np.zeros(matrix.shape, np.int64)
    for k in range(len(matrix)):
        rest = matrix[:, k].astype(np.int64)
        for row in range(k - 1, -1, -1):
            shifts[k, row] = rest[row]
            rest[:k] = (rest[:k] - rest[row] * matrix[:k, row].astype(np.int64)) % base
    return shifts.astype(np.uint32)


@partial(jax.jit, static_argnames=("base", "n"))
def _component(shifts: Array, seeds: Array, base: int, n: int) -> Array:
    """Return one coordinate, uint32 (n,)."""
    count = _resolved(base)
    index = jax.lax.iota(jnp.uint32, n)

    def drawn(which: int, number: int) -> Array:
        random = random_word_of(node_of(index, seeds), jnp.uint32(which), jnp.uint32(0), seeds)
        return high_product(random, jnp.full_like(random, np.uint32(number)))

    behind = drawn(_BEHIND, base ** (count - 1))
    # The digits of all points, as integers below base**count.
    points = drawn(_DIGIT, base)[:1] * word(base ** (count - 1)) + behind[:1]
    size = 1
    for k in range(count):
        if size >= n:
            break
        total = min(size * (base - 1), n - size)
        top = np.uint32(1) + jax.lax.iota(jnp.uint32, -(-total // size))
        earlier = _earlier(top, shifts[k], base, k).ravel()[:total]
        added = np.uint32(1) + permuted(
            jnp.repeat(top, size)[:total] - np.uint32(1),
            node_of(earlier, seeds),
            jnp.uint32(k),
            base - 1,
            seeds,
        )
        unit = np.uint32(base ** (count - 1 - k))
        leading = points.at[earlier].get(mode="promise_in_bounds") // unit
        digit = leading % np.uint32(base)
        leading = leading - digit + (digit + added) % np.uint32(base)
        finer = behind[size : size + total] // np.uint32(base**k)
        points = jnp.concatenate([points, leading * unit + finer])
        size += total
    with jax.enable_x64(True):
        return first_fraction(points.astype(jnp.uint64), base**count).astype(jnp.uint32)


def _earlier(top: Array, shifts: Array, base: int, k: int) -> Array:
    """Return the indices of the earlier points of new ones, shape (len(top), base**k).

    ``top``: uint32 Array: digit k of the new points. ``shifts``: uint32 Array, shape (K,).
    """
    earlier = jnp.zeros((top.shape[0], 1), jnp.uint32)
    for place in range(k):
        digits = (jax.lax.iota(jnp.uint32, base)[None, :] + top[:, None] * shifts[place]) % np.uint32(base)
        earlier = digits[:, :, None] * np.uint32(base**place) + earlier[:, None, :]
        earlier = earlier.reshape(top.shape[0], -1)
    return earlier

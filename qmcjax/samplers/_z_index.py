"""Indices of the Z-sampler: the digits of a pixel and of its sample, in one scrambled order."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.orders._hierarchy import ScrambledMorton

Index = tuple[Array, Array]
"""High and low word."""


def append(position: Array, number: Array, log_count: int | Array) -> Index:
    """Return ``position * 2**log_count + number``, for ``log_count`` in [0, 31]."""
    # In two steps, since a shift by 32 is not defined.
    return position >> 1 >> (31 - log_count), (position << log_count) | number


def scrambled_number(order: ScrambledMorton, number: Array, log_count: int, node: Array) -> Array:
    """Permute the numbers 0 to 2**log_count - 1 of a pixel's samples, from its node on (Eq. 16 and 17)."""
    digits, odd = divmod(log_count, 2)
    result, node = order.scrambled(number >> odd, digits, node)
    return _with_last_bit(order, result, number, node) if odd else result


def scrambled_numbers(
    order: ScrambledMorton, number: Array, log_counts: Array, log_most: int, node: Array
) -> Array:
    """Do the same with as many samples as each pixel has, at most ``2**log_most``."""
    odd = (log_counts & np.uint32(1)) == 1
    rest, digits = jnp.where(odd, number >> 1, number), log_counts >> 1
    result = jnp.zeros_like(number)
    for level in range(log_most // 2 - 1, -1, -1):
        digit, child = order.scrambled((rest >> (2 * level)) & np.uint32(3), 1, node)
        here = digits > level
        result = jnp.where(here, (result << 2) | digit, result)
        node = jnp.where(here, child, node)
    return jnp.where(odd, _with_last_bit(order, result, number, node), result)


def _with_last_bit(order: ScrambledMorton, result: Array, number: Array, node: Array) -> Array:
    """Append the last bit of odd powers of two, xor a random bit (Z paper, after Eq. 18)."""
    # Child 0 of the node is in any of four places, of which every other is odd.
    coin, _ = order.scrambled(jnp.zeros_like(number), 1, node)
    return (result << 1) | ((number ^ coin) & np.uint32(1))

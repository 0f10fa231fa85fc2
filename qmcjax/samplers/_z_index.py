"""Indices of the Z-sampler: the digits of a pixel and of its sample, in one scrambled order."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.orders import ScrambledMorton
from qmcjax.samplers._index_64 import Index


def append(position: Array, number: Array, log_count: int | Array) -> Index:
    """Return ``position * 2**log_count + number``, for ``log_count`` in [0, 31]."""
    # In two steps: a shift by 32 is not defined.
    return position >> 1 >> (31 - log_count), (position << log_count) | number


class Number(NamedTuple):
    """The number of a sample, ``high * 2**known + low``, with bits known at trace time last.

    Programs that unroll consecutive samples can then share the digits before.
    """

    high: Array
    low: int = 0
    known: int = 0

    @property
    def word(self) -> Array:
        """The number itself."""
        return (self.high << self.known) | np.uint32(self.low)

    def bit(self, place: int) -> Array:
        """Return the bit with weight ``2**place``."""
        if place < self.known:
            return jnp.uint32((self.low >> place) & 1)
        return (self.high >> (place - self.known)) & np.uint32(1)

    def digit(self, place: int) -> Array:
        """Return the two bits from ``place`` on."""
        if place >= self.known:
            return (self.high >> (place - self.known)) & np.uint32(3)
        return (self.bit(place + 1) << 1) | self.bit(place)


def scrambled_number(order: ScrambledMorton, number: Number, log_count: int, node: Array) -> Array:
    """Permute the numbers 0 to 2**log_count - 1 of a pixel's samples, from its node on (Eq. 16 and 17)."""
    places = range(log_count - 2, -1, -2)
    result, node = order.scrambled_digits([number.digit(place) for place in places], node)
    return _with_last_bit(order, result, number, node) if log_count % 2 else result


def scrambled_numbers(
    order: ScrambledMorton, number: Number, log_counts: Array, log_most: int, node: Array
) -> Array:
    """Do the same with as many samples as each pixel has, at most ``2**log_most``."""
    odd = (log_counts & np.uint32(1)) == 1
    digits = log_counts >> 1
    result = jnp.zeros_like(node)
    for level in range(log_most // 2 - 1, -1, -1):
        digit = jnp.where(odd, number.digit(2 * level + 1), number.digit(2 * level))
        digit, child = order.scrambled_digits([digit], node)
        here = digits > level
        result = jnp.where(here, (result << 2) | digit, result)
        node = jnp.where(here, child, node)
    return jnp.where(odd, _with_last_bit(order, result, number, node), result)


def _with_last_bit(order: ScrambledMorton, result: Array, number: Number, node: Array) -> Array:
    """Append the last bit of odd powers of two, xor a random bit (Z paper, after Eq. 18)."""
    # Child 0 of the node is in any of four places; every other one is odd.
    coin, _ = order.scrambled_digits([jnp.uint32(0)], node)
    return (result << 1) | (number.bit(0) ^ (coin & np.uint32(1)))

"""Indices of the Z-sampler: digits of pixels and of their samples, and frames."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import owen_hash, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import ScrambledMorton
from qmcjax.samplers._along_curve import Index
from qmcjax.sequences import BinarySequence, InTime, in_time


def append(position: Array, number: Array, log_count: int | Array) -> Index:
    """Return ``position * 2**log_count + number``, for ``log_count`` in [0, 31]."""
    # Two shifts, because a shift by 32 is undefined.
    return position >> 1 >> (31 - log_count), (position << log_count) | number


def shuffled(number: Array, seed: Array, digits: int) -> Array:
    """Permute numbers of samples with nested permutations that keep 0, so the first 2**k stay first.

    Each set digit xors the digits below it with random ones, as in Matousek's scrambling.
    """
    result = number
    for k in range(1, digits):
        # Separate bits while the seed has any.
        place = k * (k - 1) // 2 % 32
        random = (seed >> place) | (seed << (32 - place) if place else seed)
        result = result ^ (random & np.uint32(2**k - 1) & (np.uint32(0) - ((number >> k) & np.uint32(1))))
    return result


class Number(NamedTuple):
    """The number of a sample, ``high * 2**known + low``; the low bits are known at trace time.

    Programs that unroll consecutive samples can then share the digits before.
    """

    high: Array
    low: int = 0
    known: int = 0

    @property
    def word(self) -> Array:
        return (self.high << self.known) | np.uint32(self.low)

    def bit(self, place: int) -> Array:
        if place < self.known:
            return jnp.uint32((self.low >> place) & 1)
        return (self.high >> (place - self.known)) & np.uint32(1)

    def digit(self, place: int) -> Array:
        if place >= self.known:
            return (self.high >> (place - self.known)) & np.uint32(3)
        return (self.bit(place + 1) << 1) | self.bit(place)


def scrambled_number(order: ScrambledMorton, number: Number, log_count: int, node: Array) -> Array:
    """Permute the numbers 0 to 2**log_count - 1 of a pixel's samples below its node (Eq. 16 and 17)."""
    places = range(log_count - 2, -1, -2)
    result, node = order.scrambled_digits([number.digit(place) for place in places], node)
    return _with_last_bit(order, result, number, node) if log_count % 2 else result


def scrambled_group(
    order: ScrambledMorton, first: Number, log_count: int, node: Array
) -> tuple[Array, list[Array]]:
    """Permute the first of the numbers that differ only in their last digit, which may be a bit.

    Returns the result, and its xor with the result for each of these numbers.
    """
    place = scrambled_number(order, first, log_count, node)
    if log_count % 2:
        return place, [jnp.uint32(0), jnp.uint32(1)]
    digits = [first.digit(place) for place in range(log_count - 2, 0, -2)]
    _, node = order.scrambled_digits(digits, node)
    last = [order.scrambled_digits([jnp.uint32(digit)], node)[0] for digit in range(4)]
    return place, [last[0] ^ each for each in last]


def scrambled_numbers(
    order: ScrambledMorton, number: Number, log_counts: Array, log_most: int, node: Array
) -> Array:
    """Do the same for a separate number of samples in each pixel, at most ``2**log_most``."""
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
    # Child 0 of the node is at any of four places; every second one is odd.
    coin, _ = order.scrambled_digits([jnp.uint32(0)], node)
    return (result << 1) | (number.bit(0) ^ (coin & np.uint32(1)))


_STREAM = 0x66726D65
"""Stream number of the random words for frames, distinct from all others of a key."""


@frozen_pytree
class Frames:
    """A frame and its places in several orders: the first one is plain, the others are scrambled.

    Aligned blocks of frames stay aligned blocks.
    """

    seeds: Array
    """uint32 (orders - 1,)."""
    numbers: Array
    """uint32 (orders,)."""

    def moved(self, sequence: BinarySequence, number: int | Array) -> InTime:
        """Return a sequence at the place of the frame in one of the orders."""
        return in_time(sequence).at_frame(self.numbers[number])

    def at_frame(self, frame: Array | int) -> "Frames":
        """Return another frame in the same orders."""
        number = checks.frame(frame)
        # A bit is flipped by a hash of the bits above it, which are the first digits of a reversed fraction.
        others = reverse(owen_hash(reverse(jnp.broadcast_to(number, self.seeds.shape)), self.seeds))
        return Frames(self.seeds, jnp.concatenate([number[None], others]))


def of_key(frames: int, sequence: BinarySequence, key: Array | int | None, count: int) -> Frames:
    """Return frame 0 with ``count`` orders, for a sequence to move in time; without a key seeds are zero.

    The result does not depend on the number of frames.
    """
    checks.integer("frames", frames, 1, checks.INDEX_LIMIT)
    in_time(sequence)
    seeds = jnp.zeros((count - 1,), jnp.uint32)
    if key is not None:
        random = jax.random.fold_in(checks.prng_key("key", key), _STREAM)
        seeds = draws.bits(random, seeds.shape, jnp.uint32)
    return Frames(seeds, jnp.zeros((count,), jnp.uint32)).at_frame(0)

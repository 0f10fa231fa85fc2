"""Owen scrambling in base b with an independent uniform permutation at every node of the tree."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import hash_word, high_product
from qmcjax.core.digits import Base, base_of, cell_fraction, digit_count, digit_spans, quotient, word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.core.varying import alike
from qmcjax.sequences._scrambling.scrambled import ScrambledDigits

_DRAWN = 2**13
"""Most outcomes of swaps drawn together from 32 random bits."""


@frozen_pytree
class OwenExactDigits(ScrambledDigits):
    """A sequence with a nested uniform permutation of each coordinate."""

    seeds: Array
    """uint32 (dims, 2)."""

    called = "owen_exact"

    def _scrambled(self, index: Array, dims: np.ndarray | Array, dtype: DTypeLike) -> Array:
        base = base_of(self.sequence.bases, dims)
        first, last = _without_last(self.sequence.spans(index, dims), base)
        seeds = self.seeds[dims]
        count = digit_count(base)

        # Not unrolled: bases 2 and 3 have many digits.
        def scramble(k: Array, carry: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
            rest, unit, leading = carry
            upper = quotient(rest, base)
            node = node_of(first - rest * unit, seeds)
            scrambled = permuted(rest - upper * word(base), node, k, base, seeds)
            return upper, unit * word(base), leading * word(base) + scrambled

        *start, _ = alike((first, jnp.asarray(word(1 + 0 * base)), jnp.zeros_like(first), seeds))
        leading = jax.lax.fori_loop(np.uint32(0), np.uint32(count - 1), scramble, tuple(start))[2]
        node = node_of(first, seeds)
        scrambled = permuted(last, node, jnp.uint32(count - 1), base, seeds)
        # After the last digit all are 0: their images belong to the child of this node, and to no other
        # point.
        tail = random_word_of(node, jnp.uint32(count), last, seeds)
        return cell_fraction(leading, scrambled, tail, base, dtype)


def _without_last(numbers: list[Array], base: Base) -> tuple[Array, Array]:
    """Join all digits but the last to one number, the first one lowest; all digits would exceed a word."""
    *spans, span = digit_spans(base)
    last = quotient(numbers[-1], base ** (span - 1))
    first = numbers[-1] - last * word(base ** (span - 1))
    for number, size in zip(numbers[-2::-1], (base**s for s in reversed(spans)), strict=True):
        first = first * word(size) + number
    return first, last


def node_of(prefix: Array, seeds: Array) -> Array:
    return hash_word(prefix ^ seeds[..., 0])


def random_word_of(node: Array, depth: Array, which: Array, seeds: Array) -> Array:
    """Return one of 2**16 random words of a node: prefixes that differ in trailing zeros differ in depth.

    Two keyed rounds with feed-forward, so words may coincide.
    """
    number = (depth << 16) + which
    return hash_word(node + hash_word(number ^ seeds[..., 1])) ^ node


def drawn_together(top: int) -> int:
    """Return how many swaps of a permutation of ``top`` digits one random word draws."""
    together = 1
    while together < top - 1 and np.prod(top - np.arange(together + 1)) <= _DRAWN:
        together += 1
    return together


def permuted(digit: Array, node: Array, depth: Array, base: Base, seeds: Array) -> Array:
    """Return the image of a digit under a uniform random permutation: Fisher-Yates swaps, from the top."""
    top = np.max(base)
    together = drawn_together(top)
    above = word(base - 1)

    def swap(which: Array, position: Array) -> Array:
        random = random_word_of(node, depth, which, seeds)
        for k in range(together):
            # In a group with larger bases, the rest are swaps of 0 with itself.
            size = above - jnp.minimum(which * np.uint32(together) + np.uint32(k), above) + np.uint32(1)
            size = jnp.broadcast_to(size, random.shape)
            highest, other = size - np.uint32(1), high_product(random, size)
            random = random * size
            position = jnp.where(position == highest, other, jnp.where(position == other, highest, position))
        return position

    start, _ = alike((digit, node))
    return jax.lax.fori_loop(np.uint32(0), np.uint32(-(-(top - 1) // together)), swap, start)

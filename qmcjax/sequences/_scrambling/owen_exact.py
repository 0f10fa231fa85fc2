"""Owen scrambling with an independent uniform permutation at every node of the tree."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, draws
from qmcjax.core.bits import hash_word, high_product
from qmcjax.core.digits import Base, base_of, cell_fraction, digit_count, digit_spans, quotient, word
from qmcjax.core.jax_internals import alike
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import DigitSequence, with_digits
from qmcjax.sequences._protocol.binary import BinarySequence, Dims
from qmcjax.sequences._scrambling.mapped import Mapped, ScrambledDigits, of_dims

_DRAWN = 2**13
"""Most outcomes of swaps that are drawn together from 32 random bits."""


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
            scrambled = permute(rest - upper * word(base), node, k, base, seeds)
            return upper, unit * word(base), leading * word(base) + scrambled

        *start, _ = alike((first, jnp.asarray(word(1 + 0 * base)), jnp.zeros_like(first), seeds))
        leading = jax.lax.fori_loop(np.uint32(0), np.uint32(count - 1), scramble, tuple(start))[2]
        node = node_of(first, seeds)
        scrambled = permute(last, node, jnp.uint32(count - 1), base, seeds)
        # All digits after the last are 0: their images belong to the child of this node, and to no other
        # point.
        tail = random_word_of(node, jnp.uint32(count), last, seeds)
        return cell_fraction(leading, scrambled, tail, base, dtype)


def _without_last(numbers: list[Array], base: Base) -> tuple[Array, Array]:
    """Join all digits but the last into one number, the first digit lowest; all digits may not fit a word."""
    *spans, span = digit_spans(base)
    last = quotient(numbers[-1], base ** (span - 1))
    first = numbers[-1] - last * word(base ** (span - 1))
    for number, size in zip(numbers[-2::-1], (base**s for s in reversed(spans)), strict=True):
        first = first * word(size) + number
    return first, last


def node_of(prefix: Array, seeds: Array) -> Array:
    return hash_word(prefix ^ seeds[..., 0])


def random_word_of(node: Array, depth: Array, which: Array, seeds: Array) -> Array:
    """Return one of 2**16 random words of a node; prefixes that differ in trailing zeros differ in depth.

    It uses two keyed rounds with feed-forward, so words may coincide.
    """
    number = (depth << 16) + which
    return hash_word(node + hash_word(number ^ seeds[..., 1])) ^ node


def swaps_of_a_word(top: int) -> int:
    """Return the number of swaps, in a permutation of ``top`` digits, drawn from one random word."""
    together = 1
    while together < top - 1 and np.prod(top - np.arange(together + 1)) <= _DRAWN:
        together += 1
    return together


def permute(digit: Array, node: Array, depth: Array, base: Base, seeds: Array) -> Array:
    """Return the image of a digit under a uniform random permutation: Fisher-Yates swaps, from the top."""
    top = np.max(base)
    together = swaps_of_a_word(top)
    above = word(base - 1)

    def swap(which: Array, position: Array) -> Array:
        random = random_word_of(node, depth, which, seeds)
        for k in range(together):
            # In a group with larger bases, the remaining swaps exchange 0 with itself.
            size = above - jnp.minimum(which * np.uint32(together) + np.uint32(k), above) + np.uint32(1)
            size = jnp.broadcast_to(size, random.shape)
            highest, other = size - np.uint32(1), high_product(random, size)
            random = random * size
            position = jnp.where(position == highest, other, jnp.where(position == other, highest, position))
        return position

    start, _ = alike((digit, node))
    return jax.lax.fori_loop(np.uint32(0), np.uint32(-(-(top - 1) // together)), swap, start)


@frozen_pytree
class OwenTree:
    """A nested uniform permutation of each coordinate: digit k is flipped by bit k of a random word.

    In the traversal of the tree [1]_, a new path takes a new random word for all nodes down to its end, which
    have digits 0 after the branch. So the word of a node is a function of its digits as a number, without
    trailing zeros, and its random bit is the bit at its depth: no two nodes share a bit.
    """

    seeds: Array
    """uint32 (dims, 2)."""

    called = "owen_exact"

    def bit_reversed(self, bits: Array, dims: Dims) -> Array:
        seeds = of_dims(self.seeds, dims, bits)

        # Not unrolled: the compiler would recompute the hashes for more than two coordinates.
        def flip(k: Array, scrambled: Array) -> Array:
            unit = jnp.uint32(1) << k
            return scrambled ^ (random_word(bits & (unit - np.uint32(1)), seeds) & unit)

        start, _ = alike((bits, seeds))
        return jax.lax.fori_loop(np.uint32(0), np.uint32(32), flip, start)


def random_word(value: Array, seeds: Array) -> Array:
    """Hash a value to a word: two keyed rounds with feed-forward, so words may coincide."""
    mixed = hash_word(value ^ seeds[..., 0])
    return hash_word(mixed + seeds[..., 1]) ^ mixed


def owen_exact(sequence: BinarySequence | DigitSequence, key: Array | int) -> Mapped | OwenExactDigits:
    """Owen-scramble a sequence with a separate permutation of the digits after every prefix.

    This is nested uniform scrambling, the reference for :func:`owen`: the permutations of any two nodes of
    the tree are drawn independently, with random access and for all digits. In base 2 it costs 32 hashes per
    coordinate, compared with three products for :func:`owen`; in base b, from two hashes per digit in the
    smallest bases to b in large ones.

    Parameters
    ----------
    sequence : sequence in base 2, or Halton, Faure or van der Corput sequence
        Digits are scrambled in their base.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Mapped or OwenExactDigits
        The first in base 2, with exact ``bits``. In other bases the zeros after the digits of an index are
        scrambled as well, down to the resolution of float64. Values are rounded as by :func:`owen`.

    Notes
    -----
    In base b, the permutations are Fisher-Yates shuffles driven by hashed 32-bit words. Each word draws one
    swap, or several with at most 2**13 joint outcomes: the probability of each outcome is off by a factor
    within 1 +- 2**-19 in bases up to 2**13, and 1 +- 2**-16 up to 2**16. To detect the first at 5 sigma takes
    more than 2**42 draws of each outcome.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1, "Full Owen-Scrambling", after
       I. Friedel, A. Keller, "Fast Generation of Randomized Low-Discrepancy Point Sets", 2002.
    .. [2] A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = owen_exact(sequences.sobol(2), key=1).points(4)
    >>> print(sorted((points[:, 0] * 4).astype(int).tolist()))
    [0, 1, 2, 3]
    >>> points = owen_exact(sequences.faure(3), key=1).points(9)
    >>> print(sorted((points[:, 2] * 9).astype(int).tolist()))
    [0, 1, 2, 3, 4, 5, 6, 7, 8]
    """
    known = sequence if isinstance(sequence, BinarySequence) else with_digits("sequence", sequence)
    seeds = draws.bits(checks.prng_key("key", key), (known.dims, 2), jnp.uint32)
    if isinstance(known, BinarySequence):
        return Mapped(known, OwenTree(seeds))
    return OwenExactDigits(known, seeds)

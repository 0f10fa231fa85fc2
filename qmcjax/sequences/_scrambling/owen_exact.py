"""Owen scrambling with an independent permutation at every node of the tree: in base 2, a coin."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._protocol.binary import BinarySequence
from qmcjax.sequences._protocol.digit_sequence import DigitSequence, with_digits
from qmcjax.sequences._protocol.fraction import Fraction
from qmcjax.sequences._scrambling.owen_exact_base_b import OwenExactDigits, owen_exact_digits
from qmcjax.sequences._scrambling.scrambled import Scrambled, of_dims


@pytree
@dataclass(frozen=True, eq=False, repr=False)
class OwenExact(Scrambled):
    """A sequence whose coordinates go through nested uniform permutations, one each."""

    sequence: BinarySequence
    seeds: Array
    """uint32 (dims, 2)."""

    called = "owen_exact"

    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        """Scramble the digits."""

        def bit_reversed() -> Array:
            bit_reversed = fraction.bit_reversed
            return _scramble(bit_reversed, of_dims(self.seeds, dims, bit_reversed))

        return Fraction(bit_reversed=bit_reversed)


def _scramble(reversed_bits: Array, seeds: Array) -> Array:
    """Flip digit k by bit k of a random word that belongs to the k digits before it.

    In the traversal of the tree [1]_, a path that ramifies takes a fresh random word for all nodes
    down to its end, which are those with digits 0 below the branch. So a node's word is a function of
    its digits as a number, without the zeros behind, and its coin is the bit at its depth: each word
    serves different bits at the different depths, and no two nodes share a coin.
    """

    # Not unrolled: beyond two coordinates the compiler would compute the hashes again and again.
    def flip(k: Array, scrambled: Array) -> Array:
        unit = jnp.uint32(1) << k
        return scrambled ^ (random_word(reversed_bits & (unit - np.uint32(1)), seeds) & unit)

    return jax.lax.fori_loop(np.uint32(0), np.uint32(32), flip, reversed_bits)


def random_word(value: Array, seeds: Array) -> Array:
    """Hash a value to a word: two keyed rounds, fed forward, so that words may coincide."""
    mixed = hash_word(value ^ seeds[..., 0])
    return hash_word(mixed + seeds[..., 1]) ^ mixed


def owen_exact(sequence: BinarySequence | DigitSequence, key: Array | int) -> OwenExact | OwenExactDigits:
    """Owen-scramble a sequence with a permutation of its own for the digits after every prefix.

    This is nested uniform scrambling, the reference for :func:`owen`: the permutations of any two nodes of
    the tree are drawn independently, at random access and for all digits. In base 2 it costs 32 hashes
    a coordinate, where :func:`owen` takes three products; in base b, from two hashes a digit in the smallest
    bases to b in the large ones.

    Parameters
    ----------
    sequence : sequence in base 2, or Halton, Faure or van der Corput sequence
        Digits are scrambled in the base that they are in.
    key : jax.random.key, or int in [0, 2**32)
        A new key gives a new scrambling and compiles nothing anew.

    Returns
    -------
    OwenExact or OwenExactDigits
        The first in base 2, with exact ``bits``. In other bases the zeros behind the digits of an
        index are scrambled as well, down to the resolution of float64. Values are rounded as by
        :func:`owen`.

    Raises
    ------
    TypeError
        If ``sequence`` has no digits or ``key`` is no key.

    Notes
    -----
    In base b, the permutations are Fisher and Yates', from hashed words of 32 bits. As many swaps share a
    word as have at most 2**13 outcomes together, at least one: each outcome's probability is off by
    a factor within 1 +- 2**-19 in bases up to 2**13, and 1 +- 2**-16 up to 2**16. To see the first at 5 sigma
    takes more than 2**42 draws of each outcome.

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
    if not isinstance(sequence, BinarySequence):
        return owen_exact_digits(with_digits("sequence", sequence), checks.prng_key("key", key))
    seeds = jax.random.bits(checks.prng_key("key", key), (sequence.dims, 2), jnp.uint32)
    return OwenExact(sequence, seeds)

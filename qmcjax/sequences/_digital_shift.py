"""The digital shift: every coordinate xor a random word."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import reverse
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._base import BinarySequence, binary
from qmcjax.sequences._scrambled import Scrambled, along_last


@pytree
@dataclass(frozen=True)
class DigitalShift(Scrambled):
    """A sequence whose digits are flipped by the digits of one word a coordinate."""

    sequence: BinarySequence
    shifts: Array
    """uint32 (dims,): fractions, the flip of the first digit in bit 31."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        return self.sequence.bit_reversed(index, dim) ^ reverse(self.shifts[dim])

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        return self.sequence.word(index, dim) ^ self.shifts[dim]

    def _bit_reversed(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self.sequence._bit_reversed(index, dims) ^ reverse(along_last(self.shifts, dims, index))

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self.sequence._words(index, dims) ^ along_last(self.shifts, dims, index)


def digital_shift(sequence: BinarySequence, key: Array | int) -> DigitalShift:
    """Shift a sequence in base 2 digitally: add a random vector over F2, without carries.

    Every (t,m,s)-net stays one, each point is uniform on the unit cube, and the coordinates are
    shifted independently; two points keep the exclusive or of their digits.

    Parameters
    ----------
    sequence : BinarySequence
        Any sequence that has ``bits``.
    key : jax.random.key, or int in [0, 2**32)
        A new key gives a new shift and compiles nothing anew.

    Returns
    -------
    DigitalShift

    Raises
    ------
    ValueError
        If ``sequence`` is not in base 2 or ``key`` is no key.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4, "Scrambling".

    Examples
    --------
    >>> from qmcjax import sequences
    >>> bits = digital_shift(sequences.sobol(1), key=1).bits(jnp.arange(2, dtype=jnp.uint32))
    >>> print(bits[0] ^ bits[1])
    [2147483648]
    """
    binary("sequence", sequence)
    return DigitalShift(sequence, jax.random.bits(checks.prng_key("key", key), (sequence.dims,), jnp.uint32))

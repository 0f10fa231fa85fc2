"""Sequences in base 2 that implement their coordinates in another form than bit-reversed words."""

import abc

from jax import Array

from qmcjax.core.bits import reverse
from qmcjax.sequences._protocol.binary import BinarySequence
from qmcjax.sequences._protocol.fraction import Fraction


class WordFirst(BinarySequence):
    """A sequence in base 2 that implements :meth:`word` instead of ``bit_reversed``, as its sums carry."""

    @abc.abstractmethod
    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction, its first digit in bit 31."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        return reverse(self.word(index, dim))


class FractionFirst(BinarySequence):
    """A sequence in base 2 that implements :meth:`fraction`, in the forms of another sequence."""

    @abc.abstractmethod
    def fraction(self, index: Array, dim: int) -> Fraction:
        """Return one coordinate, lazily in either form."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        return self.fraction(index, dim).bit_reversed()

    def word(self, index: Array, dim: int) -> Array:
        return self.fraction(index, dim).word()

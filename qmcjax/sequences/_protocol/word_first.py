"""Sequences in base 2 with arithmetic that carries: words come first, and are bit-reversed for scramblers."""

import abc

from jax import Array

from qmcjax.core.bits import reverse
from qmcjax.sequences._protocol.binary import BinarySequence


class WordFirst(BinarySequence):
    """A sequence in base 2 that implements :meth:`word` instead of ``bit_reversed``."""

    @abc.abstractmethod
    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction, its first digit in bit 31."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        return reverse(self.word(index, dim))

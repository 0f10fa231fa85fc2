"""Blocks of a linear sequence: what a sample's number adds to the first point of its pixel's block."""

from dataclasses import dataclass

from jax import Array

from qmcjax.core.pytrees import pytree
from qmcjax.sequences import BinarySequence


@pytree
@dataclass(frozen=True)
class FromBlock(BinarySequence):
    """A linear sequence after the first points of some pixels' blocks, for indices below the blocks' size."""

    sequence: BinarySequence
    first_reversed: dict[int, Array]
    words: dict[int, Array]
    """uint32, of the pixels' shape: coordinates of the first points, by dimension, in both forms."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.sequence.dims

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        return self.sequence.bit_reversed(index, dim) ^ self.first_reversed[dim]

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 31."""
        return self.sequence.word(index, dim) ^ self.words[dim]


def first_words(sequence, first: Array, dims: tuple[int, ...]):
    """Return the coordinates of the first points of blocks, in both forms."""
    linear = sequence._linear
    return tuple({j: form(first, j) for j in dims} for form in (linear.bit_reversed, linear.word))


def after(sequence, state):
    """Return the sequence of the points of blocks: a linear one's are the first point's xor those of block 0."""
    return sequence._over(FromBlock(sequence._linear, *state))

"""Blocks of a linear sequence: what a sample's number adds to the first point of its pixel's block."""

from dataclasses import dataclass
from typing import Any

from jax import Array

from qmcjax.core.pytrees import pytree
from qmcjax.sequences import BinarySequence, Sequence


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


def first_words(sequence: Any, first: Array, dims: tuple[int, ...]) -> Any:
    """Return the coordinates of the first points of blocks, in both forms."""
    linear: Any = sequence._linear
    return tuple({j: form(first, j) for j in dims} for form in (linear.bit_reversed, linear.word))


def after(sequence: Any, state: Any) -> Sequence:
    """Return the sequence of the points of blocks: the first point xor those of the first block."""
    linear: Any = sequence._linear
    return sequence._over(FromBlock(linear, *state))

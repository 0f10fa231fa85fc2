"""Blocks of a linear sequence: what a sample's number adds to the first point of its pixel's block."""

from dataclasses import dataclass, field

from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.pytrees import pytree
from qmcjax.samplers._base import Sampler, check_count
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


@pytree
@dataclass(frozen=True)
class LinearBlocks(Sampler):
    """Sample s of some pixels is point s of a sequence over :class:`FromBlock`."""

    sequence: Sequence
    spp: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.sequence.dims

    def _values(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        return self.sequence(sample, dims, dtype)

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise a ValueError if a block has fewer points."""
        check_count(spp, self.spp, "samples in the block of a pixel")


def linear_blocks(sequence: Sequence, first: Array, spp: int, dims: tuple[int, ...]) -> LinearBlocks | None:
    """Return the sampler of the blocks from ``first`` on, multiples of ``spp``, if their indices are xors.

    The points of a block are then those of the first block, computed once for all pixels, xor one point.
    """
    if not isinstance(sequence, BinarySequence) or spp & (spp - 1):
        return None
    linear = sequence._linear
    if linear is None:
        return None
    first_reversed, words = ({j: form(first, j) for j in dims} for form in (linear.bit_reversed, linear.word))
    return LinearBlocks(sequence._over(FromBlock(linear, first_reversed, words)), spp)

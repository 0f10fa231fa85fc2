"""A sequence in Gray code order."""

from dataclasses import dataclass

from jax import Array

from qmcjax.core.bits import gray_encode
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._base import BinarySequence, Sequence, binary
from qmcjax.sequences._scrambled import Scrambled


@pytree
@dataclass(frozen=True)
class Gray(Scrambled):
    """Point i is the sequence's point i ^ (i >> 1)."""

    sequence: BinarySequence

    @property
    def limit_64(self) -> int:
        """The same as ``limit``: the upper word would change the lower one."""
        return self.limit

    with_high_word = Sequence.with_high_word

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        return self.sequence.bit_reversed(gray_encode(index), dim)

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        return self.sequence.word(gray_encode(index), dim)

    def _bit_reversed(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self.sequence._bit_reversed(gray_encode(index), dims)

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self.sequence._words(gray_encode(index), dims)

    @property
    def _linear(self) -> BinarySequence | None:
        # The code is linear itself, but scrambled points in its order are not.
        return self if self.sequence._linear is self.sequence else None


def gray(sequence: BinarySequence) -> Gray:
    """Put the points of a sequence in base 2 in Gray code order: one digit of the index changes a step.

    The first 2**k points stay the same set, and block b of as many becomes block b ^ (b >> 1). This is
    the order of programs that generate one point after the other by a single exclusive or.

    Parameters
    ----------
    sequence : BinarySequence
        Unbounded, or of 2**m points.

    Returns
    -------
    Gray

    Raises
    ------
    ValueError
        If ``sequence`` is not in base 2, or its size is no power of two.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.1, class Sobol.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> print(gray(sequences.sobol(1)).points(4)[:, 0])
    [0.   0.5  0.75 0.25]
    """
    size = binary("sequence", sequence).size
    if size is not None and size & (size - 1):
        raise ValueError(f"sequence must have 2**m points, or no last one, got size={size}")
    return Gray(sequence)

"""A sequence in Gray code order: a map of the indices."""

from jax import Array

from qmcjax.core.bits import gray_encode
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import Derived
from qmcjax.sequences._protocol.binary import BinarySequence, FractionFirst, as_binary
from qmcjax.sequences._protocol.fraction import Fraction


@frozen_pytree
class Gray(Derived, FractionFirst):
    """Point i is the sequence's point i ^ (i >> 1)."""

    sequence: BinarySequence

    called = "gray"

    def fraction(self, index: Array, dim: int) -> Fraction:
        return self.sequence.fraction(gray_encode(index), dim)

    def fractions(self, index: Array, dims: tuple[int, ...]) -> Fraction:
        return self.sequence.fractions(gray_encode(index), dims)

    @property
    def linear(self) -> "Gray | None":
        """The linear sequence below all scramblings in this order: the code is linear itself."""
        linear = self.sequence.linear
        if linear is None:
            return None
        return self if linear is self.sequence else Gray(linear)

    def of_linear(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return self.sequence.of_linear(fraction, dims)


def gray(sequence: BinarySequence) -> Gray:
    """Put the points of a sequence in base 2 in Gray code order: one digit of the index changes per step.

    The first 2**k points stay the same set, and block b of 2**k points becomes block b ^ (b >> 1). This is
    the order of programs that generate each point from the previous one by a single exclusive or.

    Parameters
    ----------
    sequence : BinarySequence, unbounded, or of 2**m points

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.1, class Sobol.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> print(gray(sequences.sobol(1)).points(4)[:, 0])
    [0.   0.5  0.75 0.25]
    """
    size = as_binary("sequence", sequence).size
    if size is not None and size & (size - 1):
        raise ValueError(f"sequence must have 2**m points or be unbounded, got size={size}")
    return Gray(sequence)

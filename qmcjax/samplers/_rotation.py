"""The Cranley-Patterson rotation with a shift for each pixel."""

from jax import Array
from jax.typing import DTypeLike

from qmcjax.sequences import Sequence


def rotated(sequence: Sequence, sample: Array, dim: int, offset: Array, dtype: DTypeLike) -> Array:
    """Return one coordinate plus an offset modulo 1, for offsets that are 32-bit fractions.

    In base 2 this is a sum of integers that wrap, and exact; for any other sequence it is rounded once
    from float64, never to 1.
    """
    return sequence.rotated_coordinate(sample, dim, offset, dtype)

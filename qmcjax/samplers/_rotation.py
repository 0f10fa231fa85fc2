"""The Cranley-Patterson rotation with a shift for each pixel."""

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import to_unit
from qmcjax.sequences import BinarySequence, Sequence
from qmcjax.sequences._rotation import wrapped


def rotated(sequence: Sequence, sample: Array, dim: int, offset: Array, dtype: DTypeLike) -> Array:
    """Return one coordinate plus an offset modulo 1, for offsets that are 32-bit fractions.

    In base 2 this is a sum of integers that wrap, and exact; for any other sequence it is rounded once
    from float64, never to 1.
    """
    if isinstance(sequence, BinarySequence):
        return to_unit(sequence.word(sample, dim) + offset, dtype)
    with jax.enable_x64(True):
        return wrapped(sequence.coordinate(sample, dim, jnp.float64), offset, dtype)

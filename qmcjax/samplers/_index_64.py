"""Indices of two words, for more than 2**32 points."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.digits import word
from qmcjax.sequences import Sequence

Index = tuple[Array, Array]
"""High and low word."""


def times(factor: Array, number: int | Array) -> Index:
    """Return the product of a word and another one, or an integer in [0, 2**32]."""
    if isinstance(number, int):
        if number == checks.INDEX_LIMIT:
            return factor, jnp.zeros_like(factor)
        number = jnp.full_like(factor, word(number))
    return jax.lax.mulhi(factor, number), factor * number


def plus(index: Index, other: Index | Array) -> Index:
    """Return the sum of two indices, or of an index and a word."""
    high, low = other if isinstance(other, tuple) else (np.uint32(0), other)
    total = index[1] + low
    return index[0] + high + (total < low).astype(jnp.uint32), total


def require(sequence: Sequence) -> None:
    """Raise a ValueError if a sequence has indices of one word only."""
    if sequence.limit_64 == sequence.limit:
        raise ValueError(
            f"wide must be False for a sequence whose indices end at {sequence.limit}, got wide=True and "
            f"{type(sequence).__name__}"
        )

"""64-bit indices, for more than 2**32 points: two words of 32 bits."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import high_product
from qmcjax.core.digits import word
from qmcjax.samplers._base import AlongCurve
from qmcjax.sequences import BinarySequence, Sequence

Index = tuple[Array, Array]
"""High and low word."""


def times(factor: Array, number: int | Array) -> Index:
    """Return the product of a word and another word, or an integer in [0, 2**32]."""
    if isinstance(number, int):
        if number == checks.INDEX_LIMIT:
            return factor, jnp.zeros_like(factor)
        number = jnp.full_like(factor, word(number))
    return high_product(factor, number), factor * number


def plus(index: Index, other: Index | Array) -> Index:
    """Return the sum of two indices, or of an index and a word."""
    high, low = other if isinstance(other, tuple) else (np.uint32(0), other)
    total = index[1] + low
    return index[0] + high + (total < low).astype(jnp.uint32), total


def needed(samples: int, sequence: Sequence) -> bool:
    """Return whether to use 64-bit indices: if there are more than 2**32 and the sequence supports them."""
    return samples > checks.INDEX_LIMIT and sequence.limit_64 > sequence.limit


def points_64(sequence: Sequence, index: Index, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
    """Return the points of 64-bit indices, below 2**32 bit-identical with those of 32-bit indices."""
    high, low = index
    beyond = sequence.with_high_word(high).coordinates(low, dims, dtype)
    if isinstance(sequence, BinarySequence):
        return beyond  # Exact in both ways.
    # Division by a long divisor rounds more often and differs in the last place.
    return jnp.where((high == 0)[..., None], sequence.coordinates(low, dims, dtype), beyond)


class Strided(AlongCurve):
    """A sampler along an order that needs 64-bit indices only for many samples."""

    short: bool
    """Whether 32-bit indices suffice for all samples."""

    def _whole(self, spp: int) -> int:
        """Return the number of samples in all iterations up to that of sample ``spp - 1``."""
        return spp

    @property
    def _limit(self) -> int:
        """Number of indices; sample numbers have 32 bits in any case."""
        return min(self.sequence.limit_64, self.order.length * checks.INDEX_LIMIT)

    @property
    def _has_64_bits(self) -> bool:
        return not self.short and needed(self.order.length * self.most, self.sequence)

    def up_to(self, spp: int) -> Any:
        """Return a sampler with 64-bit indices only if the first ``spp`` samples need them."""
        short = not needed(self.order.length * self._whole(spp), self.sequence)
        return replace(self, short=short)  # pyright: ignore[reportArgumentType]

    @property
    def _limited(self) -> str:
        return f"for {self._limit} indices and {self.order.length} positions"

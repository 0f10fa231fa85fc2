"""Base class of the randomisations in base b."""

import abc

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.digits import alike
from qmcjax.sequences._protocol.base import FEW, Derived
from qmcjax.sequences._protocol.digit_sequence import DigitSequence


class ScrambledDigits(Derived):
    """A sequence with coordinates mapped one by one, digit after digit."""

    sequence: DigitSequence

    def radical_bases(self) -> tuple[int | None, ...]:
        return self.sequence.radical_bases()

    @abc.abstractmethod
    def _scrambled(self, index: Array, dims: np.ndarray | Array, dtype: DTypeLike) -> Array:
        """Return coordinates ``dims``, broadcast against ``index``, as for ``DigitSequence.spans``."""

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        return self._scrambled(index, np.array(dim), dtype)

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        bases = self.sequence.bases
        if len(dims) > 1 and len(set(bases)) == 1:
            # A loop: one program for all coordinates would recompute shared values.
            wanted = jnp.asarray(np.array(dims, np.uint32))
            return jnp.moveaxis(jax.lax.map(lambda dim: self._scrambled(index, dim, dtype), wanted), 0, -1)
        if len(dims) <= FEW:
            return super().coordinates(index, dims, dtype)
        row = (1,) * index.ndim + (-1,)
        groups = [np.array(group).reshape(row) for group in alike(bases, dims)]
        return jnp.concatenate([self._scrambled(index[..., None], g, dtype) for g in groups], axis=-1)

"""Base classes of the randomisations, in base 2 and in base b."""

import abc
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.digits import alike
from qmcjax.sequences._protocol.base import FEW, Derived, DigitSequence, PointByPoint
from qmcjax.sequences._protocol.binary import BinarySequence, Fraction, FractionFirst


@dataclass(frozen=True, eq=False, repr=False)
class Scrambled(PointByPoint, FractionFirst):
    """A sequence in base 2 whose coordinates are mapped one by one; subclasses implement :meth:`mapped`."""

    sequence: BinarySequence

    @abc.abstractmethod
    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        """Scramble one coordinate, or several stacked last."""

    def fraction(self, index: Array, dim: int) -> Fraction:
        return self.mapped(self.sequence.fraction(index, dim), dim)

    def fractions(self, index: Array, dims: tuple[int, ...]) -> Fraction:
        if len(dims) <= FEW:
            return super().fractions(index, dims)
        return self.mapped(self.sequence.fractions(index, dims), dims)

    @property
    def linear(self) -> BinarySequence | None:
        return self.sequence.linear

    def of_linear(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return self.mapped(self.sequence.of_linear(fraction, dims), dims)


def of_dims(parameters: Array, dims: int | tuple[int, ...], coordinates: Array) -> Array:
    """Return the rows of parameters for one coordinate, or for several stacked last.

    They have the rank of ``coordinates``, followed by their own axes.
    """
    if isinstance(dims, int):
        return parameters[dims]
    count = parameters.shape[0]
    times = len(dims) // count
    if dims == tuple(range(count)) * times:  # a gather would be fused into the loop over all points
        wanted = jnp.tile(parameters, (times,) + (1,) * (parameters.ndim - 1))
    else:
        wanted = parameters[np.array(dims)]
    return wanted.reshape((1,) * (coordinates.ndim - 1) + wanted.shape)


@dataclass(frozen=True, eq=False, repr=False)
class ScrambledDigits(Derived):
    """A sequence whose coordinates are mapped one by one, digit by digit."""

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
            # A loop, since one program for all coordinates would recompute shared values.
            wanted = jnp.asarray(np.array(dims, np.uint32))
            return jnp.moveaxis(jax.lax.map(lambda dim: self._scrambled(index, dim, dtype), wanted), 0, -1)
        if len(dims) <= FEW:
            return super().coordinates(index, dims, dtype)
        row = (1,) * index.ndim + (-1,)
        groups = [np.array(group).reshape(row) for group in alike(bases, dims)]
        return jnp.concatenate([self._scrambled(index[..., None], g, dtype) for g in groups], axis=-1)

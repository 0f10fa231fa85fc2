"""The randomisations: in base 2 a map of fractions, in base b a base class."""

import abc
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import reverse
from qmcjax.core.digits import alike
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.cells import MappedCells
from qmcjax.sequences._protocol.base import FEW, Derived, DigitSequence, PointByPoint
from qmcjax.sequences._protocol.binary import BinarySequence, Dims, Fraction


@frozen_pytree
class Mapped(PointByPoint, BinarySequence):
    """A sequence in base 2 whose coordinates are mapped one by one.

    A map is a pytree of the parameters of all coordinates. It has the method ``word(word, dims)``, or
    ``bit_reversed(bits, dims)``, or both, for one coordinate or for several stacked last, and the name of the
    function that draws it, ``called``. If it permutes intervals and can be inverted, ``inverse(word, dim)``
    does so. ``linear`` says that it is linear over F2.
    """

    sequence: BinarySequence
    f: Any

    def __repr__(self) -> str:
        return f"{self.f.called}({self.sequence!r})"

    def word(self, index: Array, dim: int) -> Array:
        if hasattr(self.f, "word"):
            return self.f.word(self.sequence.word(index, dim), dim)
        return reverse(self.f.bit_reversed(self.sequence.bit_reversed(index, dim), dim))

    def bit_reversed(self, index: Array, dim: int) -> Array:
        if hasattr(self.f, "bit_reversed"):
            return self.f.bit_reversed(self.sequence.bit_reversed(index, dim), dim)
        return reverse(self.f.word(self.sequence.word(index, dim), dim))

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        if isinstance(dims, int) or len(dims) <= FEW:
            return super().fraction(index, dims)
        return self._mapped(self.sequence.fraction(index, dims), dims)

    @property
    def linear(self) -> BinarySequence | None:
        """The linear sequence below all maps, or this one after a linear map of that."""
        linear = self.sequence.linear
        return self if linear is self.sequence and getattr(self.f, "linear", False) else linear

    def of_linear(self, fraction: Fraction, dims: Dims) -> Fraction:
        if self.linear is self:
            return fraction
        return self._mapped(self.sequence.of_linear(fraction, dims), dims)

    def _mapped(self, fraction: Fraction, dims: Dims) -> Fraction:
        maps = (getattr(self.f, form, None) for form in ("word", "bit_reversed"))
        return fraction.mapped(*(f and partial(f, dims=dims) for f in maps))

    def inverted(self, log_side: int) -> Any:
        """Return an object that finds points from their cells by inverting the map."""
        if not hasattr(self.f, "inverse"):
            return super().inverted(log_side)
        return MappedCells(self.sequence.inverted(log_side), self.f)


def of_dims(parameters: Array, dims: Dims, coordinates: Array) -> Array:
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

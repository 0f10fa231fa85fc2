"""Base class of the randomisations in base 2."""

import abc

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.sequences._protocol.base import FEW, PointByPoint
from qmcjax.sequences._protocol.binary import BinarySequence, FractionFirst
from qmcjax.sequences._protocol.fraction import Fraction


class Scrambled(PointByPoint, FractionFirst):
    """A sequence in base 2 with coordinates mapped one by one: subclasses implement :meth:`mapped`."""

    sequence: BinarySequence

    @abc.abstractmethod
    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        """Scramble one coordinate, or some that are stacked last."""

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
    """Return the rows of parameters of one coordinate, or of some that are stacked last.

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

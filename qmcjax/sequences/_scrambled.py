"""What the randomisations in base 2 have in common: the sequence they scramble."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.sequences._base import BinarySequence, PointByPoint


class Scrambled(PointByPoint, BinarySequence):
    """A sequence in base 2 whose coordinates are mapped one by one, in fixed point."""

    sequence: BinarySequence

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.sequence.dims

    @property
    def _linear(self) -> BinarySequence | None:
        return self.sequence._linear

    def _over(self, blocks: BinarySequence) -> BinarySequence:
        if self._linear is self:
            return blocks
        over = self.sequence._over(blocks)
        return dataclasses.replace(self, sequence=over)  # pyright: ignore[reportArgumentType]


def along_last(values: Array, dims: tuple[int, ...], index: Array) -> Array:
    """Return the wanted rows of ``values`` for coordinates that are stacked behind the axes of ``index``."""
    count = values.shape[0]
    times = len(dims) // count
    if dims == tuple(range(count)) * times:  # no gather, which would be fused into the loop over all points
        wanted = jnp.tile(values, (times,) + (1,) * (values.ndim - 1))
    else:
        wanted = values[np.array(dims)]
    return wanted.reshape((1,) * index.ndim + wanted.shape)

"""What the randomisations in base 2 have in common: the sequence they scramble."""

import numpy as np
from jax import Array

from qmcjax.sequences._base import BinarySequence


class Scrambled(BinarySequence):
    """A sequence in base 2 whose coordinates are mapped one by one, in fixed point."""

    sequence: BinarySequence

    @property
    def dims(self) -> int:
        """Number of coordinates."""
        return self.sequence.dims

    @property
    def size(self) -> int | None:
        """Number of points."""
        return self.sequence.size


def along_last(values: Array, dims: tuple[int, ...], index: Array) -> Array:
    """Return the wanted rows of ``values`` for coordinates that are stacked behind the axes of ``index``."""
    wanted = values[np.array(dims)]
    return wanted.reshape((1,) * index.ndim + wanted.shape)

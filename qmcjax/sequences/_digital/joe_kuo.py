"""The generator matrices of the Sobol' sequence with Joe and Kuo's direction numbers."""

from functools import lru_cache

import numpy as np

from qmcjax.core import tables
from qmcjax.sequences._digital.sobol_matrix import DirectionNumbers, columns_of


@lru_cache(maxsize=16)
def matrices_of(dims: int) -> np.ndarray:
    """Return the matrices of components 1 to dims - 1 by Eq. 5.13 (0 is the identity), read-only."""
    matrices = columns_of(numbers(slice(dims - 1)))
    matrices.flags.writeable = False
    return matrices


@lru_cache
def columns_beyond(dim: int) -> np.ndarray:
    """Return columns 32 to 63 of the matrix of component ``dim`` > 0, their first 32 rows, as fractions."""
    return columns_of(numbers(slice(dim - 1, dim)), 64)[0, 32:]


def numbers(components: slice) -> list[DirectionNumbers]:
    """Return direction numbers of components, from component 1 on."""
    table = tables.arrays("sequences", "joe_kuo.npz", "polynomials", "initial")
    pairs = zip(*(array[components].tolist() for array in table), strict=True)
    return [DirectionNumbers(p, tuple(initial[: p.bit_length() - 1])) for p, initial in pairs]

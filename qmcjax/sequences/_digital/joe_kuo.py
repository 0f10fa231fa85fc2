"""The generator matrices of the Sobol' sequence with Joe and Kuo's direction numbers."""

from functools import lru_cache

import numpy as np

from qmcjax.core import tables
from qmcjax.sequences._digital.sobol_matrix import DirectionNumbers, columns_of


@lru_cache(maxsize=16)
def matrices_of(dims: int) -> np.ndarray:
    """Return the matrices of components 1 to dims - 1 by Eq. 5.13 (0 is the identity), read-only."""
    polynomials, initial = _table(dims)
    degrees = [int(p).bit_length() - 1 for p in polynomials]
    matrices = columns_of(
        [
            DirectionNumbers(int(p), tuple(numbers[:degree]))
            for p, numbers, degree in zip(polynomials, initial.tolist(), degrees, strict=True)
        ]
    )
    matrices.flags.writeable = False
    return matrices


@lru_cache
def columns_beyond(dim: int) -> np.ndarray:
    """Return columns 32 to 63 of the matrix of component ``dim`` > 0, their first 32 rows, as fractions.

    Eq. 5.13 for v_k = m_k / 2**k: products with powers of two become shifts to the right, so digits beyond 32
    are not needed for the next column.
    """
    polynomials, initial = _table(dim + 1)
    polynomial = int(polynomials[-1])
    degree = polynomial.bit_length() - 1
    columns = [int(number) << (31 - k) for k, number in enumerate(initial[-1, :degree])]
    for k in range(degree, 64):
        column = columns[k - degree] ^ (columns[k - degree] >> degree)
        for i in range(1, degree):
            if polynomial >> (degree - i) & 1:
                column ^= columns[k - i]
        columns.append(column)
    return np.array(columns[32:], np.uint32)


def _table(dims: int) -> tuple[np.ndarray, np.ndarray]:
    polynomials, initial = tables.arrays("sequences", "joe_kuo.npz", "polynomials", "initial")
    return polynomials[: dims - 1], initial[: dims - 1]

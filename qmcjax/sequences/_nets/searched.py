"""A (0,2)-sequence and (0,m,3)-nets of large minimum distance, from searched generator matrices."""

import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.digital import Digital, digital
from qmcjax.sequences._digital.matrix_products import packed, selected
from qmcjax.sequences._nets.nets_3d import OverPlane
from qmcjax.sequences._nets.optimized_net import MatrixNet, columns_of, matrix_net


@frozen_pytree
class MatrixNet3D(OverPlane):
    """The points (i / 2**m, C_1 i, C_2 i) for the matrices of a (0,2)-sequence."""

    plane: MatrixNet
    columns: Array
    """uint32 (m,): column k of C_2, its first row in bit 0."""

    called = "optimized_net_3d"

    def _third(self, index: Array) -> Array:
        return selected(self.columns, index)


def optimized_net_3d(m: int) -> MatrixNet3D:
    """Make a digital (0,m,3)-net of large minimum distance from searched generator matrices.

    Parameters
    ----------
    m : int, in [2, 16]

    Returns
    -------
    MatrixNet3D
        Its squared toroidal distance on the integer grid is 6, 12, 30, 82, 166, 461, 898, 2005, 4382,
        10291, 24086, 58670, 136449, 305960, 689409 for m = 2, ..., 16.

    Notes
    -----
    Found by ``analysis.search_matrices``, separately for each m: no net is part of another. In the unit cube,
    the (0,13,3)-net found by search in [1]_ has the distance 0.01342385, this one 0.02956774. Larger
    distances may exist.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.3 and Fig. 5.9.

    Examples
    --------
    >>> print((optimized_net_3d(2).points(4) * 4).astype(int))
    [[0 0 0]
     [1 3 2]
     [2 1 3]
     [3 2 1]]
    """
    first, second = _read("optimized_nets_3d.txt")[checks.integer("m", m, 2, 16)]
    return MatrixNet3D(matrix_net(first), columns_of(second))


def optimized_sequence() -> Digital:
    """Make a (0,2)-sequence with nets of large minimum distance, from searched generator matrices.

    Returns
    -------
    Digital
        Two dimensions. With i / 2**m as first coordinate, its first 2**m points are a (0,m,3)-net with
        squared toroidal distance 6, 9, 19, 46, 88, 200, 398, 852, 2141, 4998, 12545, 30555, 78401, 185638,
        430946 on the integer grid for m = 2, ..., 16. This is larger than for :func:`sobol` and
        :func:`larcher_pillichshammer`, except for m = 3, where the latter also gives 9.

    Notes
    -----
    The matrices C_1 and C_2 of order 16 were found by ``analysis.search_matrices``. For 32 columns they are
    repeated as ((C_1, 0), (0, C_1)) and ((C_2, C_2), (0, C_2)). As Pascal's triangle modulo 2 repeats in the
    latter way, the factors C_1 = L_1 U and C_2 = L_2 P U, which all (0,2)-sequences in base 2 have, are those
    of order 16 repeated on the diagonal, and t remains 0. Distances beyond m = 16 were not optimised.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.3.

    Examples
    --------
    >>> print((optimized_sequence().points(4) * 4).astype(int))
    [[0 0]
     [2 3]
     [3 1]
     [1 2]]
    """
    first, second = _read("optimized_sequence.txt")[16]
    matrices = np.stack([np.kron(np.eye(2, dtype=np.uint8), first), np.kron([[1, 1], [0, 1]], second)])
    return digital(packed(matrices))


def _read(name: str) -> dict[int, NDArray[np.uint8]]:
    """Read pairs of matrices by their order."""
    rows = [words[-2 * int(words[0]) :] for words in tables.rows("sequences", name)]
    return {
        len(row) // 2: np.array([list(digits) for digits in row], np.uint8).reshape(2, len(row) // 2, -1)
        for row in rows
    }

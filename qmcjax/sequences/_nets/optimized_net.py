"""Digital (0,m,2)-nets of large minimum distance, from searched generator matrices."""

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.matrix_products import selected
from qmcjax.sequences._nets.nets import Net, _above, _low, _reverse_low


@frozen_pytree
class MatrixNet(Net):
    """The points (i / 2**m, C times the bits of i) for C = L U with unit triangular factors over F2."""

    columns: Array
    """uint32 (m,): column k of C, its first row in bit 0."""
    lower_inverse: Array
    upper_inverse: Array
    """uint32 (m,): columns of the factors' inverses."""

    called = "optimized_net"

    def _second(self, index: Array) -> Array:
        return selected(self.columns, index)

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        # The lowest index bits fix the leading rows. Their block of C is the product of the leading blocks of
        # the factors, inverted by those of the inverse factors.
        upper = _above(x, self.m - log_side) | (sample << log_side)
        wrong = _low(self._second(upper), log_side) ^ _reverse_low(y, log_side)
        middle = _low(selected(self.lower_inverse, wrong), log_side)
        return upper | selected(self.upper_inverse, middle)


def optimized_net(m: int) -> MatrixNet:
    """Make a digital (0,m,2)-net of large minimum distance from a searched generator matrix.

    Parameters
    ----------
    m : int, in [1, 32]

    Returns
    -------
    MatrixNet
        Its squared toroidal distance on the integer grid is 2, 2, 8, 13, 29, 52, 100, 208, 425 for m = 1,
        ..., 9, and beyond four times that of ``optimized_net(m - 2)``.

    Notes
    -----
    The matrices of order 1 to 7 and 9 were found by simulated annealing; the others are diag(1, C, 1) with C
    of order m - 2. In units of the grid, this makes four copies of the smaller net, scaled by two, in 2 x 2
    tiles: the copy in tile (u, v) is shifted by (v, u). After k such steps there are 2**k x 2**k copies,
    scaled by 2**k and shifted by less than that, in y equally for a column of tiles and in x for a row. So in
    units of the grid of the first net, only a pair across a vertical border can lose distance in y, and only
    a pair across a horizontal border in x, less than 1 each. No such pair of the nets for m = 6 and 9 is
    close enough for this to matter, which proves the distances 52 * 4**k and 425 * 4**k for all k.

    For m <= 7 and for even m the distances are those that Table 5.1 of [1]_ reports for matrices; for odd
    m >= 9 they are larger: 425, 1700, 6800, 27200 instead of 400, 1600, 6385, 25313.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Table 5.1.

    Examples
    --------
    >>> print((optimized_net(3).points(8)[:, 1] * 8).astype(int))
    [0 5 2 7 4 1 6 3]
    """
    return matrix_net(_matrix(checks.integer("m", m, 1, 32)))


def matrix_net(matrix: NDArray[np.uint8]) -> MatrixNet:
    """Return the net of a generator matrix of order m with t = 0."""
    lower, upper = _factors(matrix)
    return MatrixNet(
        len(matrix), columns_of(matrix), columns_of(_inverse(lower)), columns_of(_inverse(upper.T).T)
    )


def _matrix(m: int) -> NDArray[np.uint8]:
    """Return the matrix of order m: a searched one, or diag(1, ..., 1, searched, 1, ..., 1)."""
    searched = _searched()
    core = m
    while core not in searched:
        core -= 2
    matrix, inside = np.eye(m, dtype=np.uint8), slice((m - core) // 2, (m + core) // 2)
    matrix[inside, inside] = searched[core]
    return matrix


def _searched() -> dict[int, NDArray[np.uint8]]:
    rows = [words[2:] for words in tables.rows("sequences", "optimized_nets.txt")]
    return {len(row): np.array([list(digits) for digits in row], np.uint8) for row in rows}


def _factors(matrix: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the unit triangular L and U with L U = matrix over F2; they exist where t = 0."""
    lower, upper = np.eye(len(matrix), dtype=np.uint8), matrix.copy()
    for k in range(len(matrix)):
        lower[k + 1 :, k] = upper[k + 1 :, k]
        upper[k + 1 :] ^= lower[k + 1 :, k, None] & upper[k]
    return lower, upper


def _inverse(lower: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Invert a unit lower triangular matrix over F2."""
    inverse = np.eye(len(lower), dtype=np.uint8)
    for k in range(len(lower)):
        inverse[k + 1 :] ^= lower[k + 1 :, k, None] & inverse[k]
    return inverse


def columns_of(matrix: NDArray[np.uint8]) -> Array:
    """Pack the columns into words, the first row in bit 0."""
    weights = np.uint32(1) << np.arange(len(matrix), dtype=np.uint32)
    return jnp.asarray((matrix.T * weights).sum(axis=1, dtype=np.uint32))

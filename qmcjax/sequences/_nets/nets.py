"""Nets of 2**m points with i / 2**m as first coordinate, and their inversion from pixel to index."""

import abc
from collections.abc import Callable
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks, number_theory
from qmcjax.core.bits import gray_decode, gray_encode, pascal, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.cells import packed, selected
from qmcjax.sequences._digital.digital import identity, larcher_sobol
from qmcjax.sequences._protocol.binary import BinarySequence


@dataclass(frozen=True, eq=False, repr=False)
class Net(BinarySequence):
    """A net in base 2 with a (0,m,2)-net as first two coordinates: one point per interval of area 2**-m."""

    m: int = field(metadata={"static": True})

    reported = ("m",)

    @property
    def dims(self) -> int:
        return 2

    @property
    def size(self) -> int:
        return 2**self.m

    @abc.abstractmethod
    def further(self, index: Array, dim: int) -> Array:
        """Return a coordinate after the first one, bit-reversed."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        return self.further(index, dim) if dim else reverse(fraction_of(index, self.m))

    def word(self, index: Array, dim: int) -> Array:
        return reverse(self.further(index, dim)) if dim else fraction_of(index, self.m)

    def points_per_cell(self, log_side: int) -> int:
        """Return ``2**(m - 2 * log_side)``, the points in each of ``2**log_side`` x ``2**log_side`` cells."""
        if self.m < 2 * log_side:
            raise ValueError(
                f"net's m must be at least {2 * log_side} for one point in each of "
                f"{2**log_side} x {2**log_side} cells, got m={self.m}"
            )
        return 2 ** (self.m - 2 * log_side)

    @abc.abstractmethod
    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of a point from its cell.

        Parameters
        ----------
        x, y : uint32 Array
            Column and row of the cell in a raster of ``2**log_side`` cells per side.
        sample : uint32 Array
            Number of the point in its cell, below ``points_per_cell(log_side)``.

        Returns
        -------
        uint32 Array, the broadcast shape

        References
        ----------
        .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4.
        """


class MatrixNet(Net):
    """A net with a matrix C = L U for the second coordinate, with unit triangular factors over F2."""

    @abc.abstractmethod
    def solve(self, digits: Array, log_side: int) -> Array:
        """Return the low digits of the index that give these leading digits of the second coordinate."""

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        # For any other index bits, the lowest ones determine the leading rows.
        upper = above(x, self.m - log_side) | (sample << log_side)
        wrong = low(self.further(upper, 1), log_side) ^ reverse_low(y, log_side)
        return upper | self.solve(wrong, log_side)


@frozen_pytree
class StepsNet(MatrixNet):
    """A net that multiplies by its matrices in a few steps on words."""

    steps: tuple[Callable[[Array], Array], ...] = field(metadata={"static": True})
    """Functions from the index to the further coordinates, bit-reversed."""
    inverse: Callable[[Array], Array] = field(metadata={"static": True})
    """The inverse of the first of them."""
    called: str = field(metadata={"static": True})
    """Name of the function that makes such a net."""

    @property
    def dims(self) -> int:
        return 1 + len(self.steps)

    def further(self, index: Array, dim: int) -> Array:
        return self.steps[dim - 1](index)

    def solve(self, digits: Array, log_side: int) -> Array:
        return self.inverse(digits)


@frozen_pytree
class ColumnsNet(MatrixNet):
    """A net that multiplies by the columns of its matrices."""

    columns: Array
    """uint32 (dims - 1, m): column k of each matrix, its first row in bit 0."""
    lower_inverse: Array
    upper_inverse: Array
    """uint32 (m,): columns of the inverses of the factors of the first matrix."""
    called: str = field(metadata={"static": True})
    """Name of the function that makes such a net."""

    @property
    def dims(self) -> int:
        return 1 + self.columns.shape[0]

    def further(self, index: Array, dim: int) -> Array:
        return selected(self.columns[dim - 1], index)

    def solve(self, digits: Array, log_side: int) -> Array:
        # The leading block of C is the product of the leading blocks of the factors, inverted by those of the
        # inverse factors.
        return selected(self.upper_inverse, low(selected(self.lower_inverse, digits), log_side))


def fraction_of(numerator: Array, m: int) -> Array:
    """Return numerator / 2**m in fixed point; for m = 0 the numerator is 0."""
    return numerator << min(32 - m, 31)


def above(word: Array, count: int) -> Array:
    """Shift left; a shift by 32 or more gives zero."""
    return word << min(count, 31)


def low(word: Array, count: int) -> Array:
    """Return the lowest ``count`` bits."""
    return word & np.uint32((1 << count) - 1)


def reverse_low(word: Array, count: int) -> Array:
    """Reverse the order of the lowest ``count`` bits; the others are dropped."""
    return reverse(word) >> (32 - count) if count else jnp.zeros_like(word)


def hammersley_net(m: int) -> StepsNet:
    """Make the Hammersley net: the points (i / 2**m, phi_2(i)).

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    StepsNet, a (0,m,2)-net in base 2

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4 and Table 5.1.

    Examples
    --------
    >>> print(hammersley_net(2).points(4))
    [[0.   0.  ]
     [0.25 0.5 ]
     [0.5  0.25]
     [0.75 0.75]]
    """
    return _steps_net(m, (identity,), identity, "hammersley_net")


def larcher_pillichshammer_net(m: int) -> StepsNet:
    """Make the Larcher-Pillichshammer net: i / 2**m and the product with the matrix of ones.

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    StepsNet, a (0,m,2)-net in base 2 of low star discrepancy

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Eq. 5.15.

    Examples
    --------
    >>> print(larcher_pillichshammer_net(2).points(4))
    [[0.   0.  ]
     [0.25 0.5 ]
     [0.5  0.75]
     [0.75 0.25]]
    """
    return _steps_net(m, (gray_decode,), gray_encode, "larcher_pillichshammer_net")


def sobol_net_3d(m: int) -> StepsNet:
    """Make the Sobol' net: i / 2**m and the two components of the Sobol' (0,2)-sequence.

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    StepsNet
        A (0,m,3)-net in base 2; the first two coordinates are the Hammersley net.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.2, Remark 4 and Fig. 5.5.

    Examples
    --------
    >>> print(sobol_net_3d(2).points(4))
    [[0.   0.   0.  ]
     [0.25 0.5  0.5 ]
     [0.5  0.25 0.75]
     [0.75 0.75 0.25]]
    """
    return _steps_net(m, (identity, pascal), identity, "sobol_net_3d")


def larcher_pillichshammer_net_3d(m: int) -> StepsNet:
    """Make the modified net: i / 2**m and the two components of the (0,2)-sequence of C'1, C'2.

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    StepsNet
        A (0,m,3)-net in base 2; the first two coordinates are the Larcher-Pillichshammer net. For m > 6 its
        minimum distance is larger than that of :func:`sobol_net_3d`.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.2, Eq. 5.19 and Remark 5.

    Examples
    --------
    >>> print(larcher_pillichshammer_net_3d(2).points(4))
    [[0.   0.   0.  ]
     [0.25 0.5  0.5 ]
     [0.5  0.75 0.25]
     [0.75 0.25 0.75]]
    """
    return _steps_net(m, (gray_decode, larcher_sobol), gray_encode, "larcher_pillichshammer_net_3d")


def _steps_net(
    m: int, steps: tuple[Callable[[Array], Array], ...], inverse: Callable[[Array], Array], called: str
) -> StepsNet:
    return StepsNet(checks.integer("m", m, 0, 32), steps, inverse, called)


def columns_net(matrices: list[NDArray[np.uint8]], called: str) -> ColumnsNet:
    """Return the net of generator matrices of order m, the first of t = 0."""
    inverses = [number_theory.inverse(factor, 2) for factor in _factors(matrices[0])]
    lower, upper, *columns = reverse(jnp.asarray(packed(np.stack([*inverses, *matrices]))))
    return ColumnsNet(len(matrices[0]), jnp.stack(columns), lower, upper, called)


def _factors(matrix: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the unit triangular L and U with L U = matrix over F2; they exist where t = 0."""
    lower, upper = np.eye(len(matrix), dtype=np.uint8), matrix.copy()
    for k in range(len(matrix)):
        lower[k + 1 :, k] = upper[k + 1 :, k]
        upper[k + 1 :] ^= lower[k + 1 :, k, None] & upper[k]
    return lower, upper

"""Nets of 2**m points with i / 2**m as first coordinate, and their inversion from pixel to index."""

import abc
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import gray_decode, gray_encode, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.binary import BinarySequence


@dataclass(frozen=True, eq=False, repr=False)
class Net(BinarySequence):
    """A (0,m,2)-net in base 2: one point in every elementary interval of area 2**-m."""

    m: int = field(metadata={"static": True})

    reported = ("m",)

    @property
    def dims(self) -> int:
        return 2

    @property
    def size(self) -> int:
        return 2**self.m

    @abc.abstractmethod
    def _second(self, index: Array) -> Array:
        """Return the bit-reversed second coordinate."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        return self._second(index) if dim else reverse(_fraction(index, self.m))

    def word(self, index: Array, dim: int) -> Array:
        return reverse(self._second(index)) if dim else _fraction(index, self.m)

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


def _fraction(numerator: Array, m: int) -> Array:
    """Return numerator / 2**m in fixed point; for m = 0 the numerator is 0."""
    return numerator << min(32 - m, 31)


def _low(word: Array, count: int) -> Array:
    return word & np.uint32((1 << count) - 1)


def _reverse_low(word: Array, count: int) -> Array:
    """Reverse the order of the lowest ``count`` bits; the others are dropped."""
    return reverse(word) >> (32 - count) if count else jnp.zeros_like(word)


@frozen_pytree
class HammersleyNet(Net):
    """The points (i / 2**m, phi_2(i))."""

    called = "hammersley_net"

    def _second(self, index: Array) -> Array:
        return index

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        return _above(x, self.m - log_side) | (sample << log_side) | _reverse_low(y, log_side)


@frozen_pytree
class LarcherPillichshammerNet(Net):
    """The points (i / 2**m, C'1 times the bits of i)."""

    called = "larcher_pillichshammer_net"

    def _second(self, index: Array) -> Array:
        return gray_decode(index)

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        # The matrix is triangular: the lowest index bits fix the leading rows for all others.
        upper = _above(x, self.m - log_side) | (sample << log_side)
        wrong = _low(gray_decode(upper), log_side) ^ _reverse_low(y, log_side)
        return upper | gray_encode(wrong)


@frozen_pytree
class PermutationNet(Net):
    """Points on parallel diagonals, thesis Sect. 5.3.1, for odd m and even m >= 4."""

    called = "permutation_net"

    def _second(self, index: Array) -> Array:
        half = self.m // 2
        if self.m % 2:
            # Eq. 5.44
            y = _low(index - (_reverse_low(_low(index, half), half) << (self.m - half)), self.m)
        else:
            # x = 2^half rev(k) + floor(k / 4) + (1 + r) 2^(half - 2), y = k + r 2^half, solved for k and r:
            # the low bits of x are k's upper ones, and those of (x - floor(k / 4)) / 2^(half - 2)
            # above bit half are, once 4 rev(k) has lost its lower part, k's lowest two.
            upper = _low(index, half - 2)
            rest = (index >> (half - 2)) - np.uint32(1) - (_reverse_low(upper, half - 2) << 2)
            lowest = _reverse_low(_low(rest >> half, 2), 2)
            y = (_low(rest, half) << half) | (upper << 2) | lowest
        return reverse(_fraction(y, self.m))

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        half = self.m // 2
        if self.m % 2:
            # With H = m - half: x = 2^half ((2 rev(k) + r) mod 2^H) + k and y = 2^half r + k. The cell
            # gives the leading bits of r and of the bracket, whose lowest bits agree.
            spare = self.m - half - log_side
            r = _above(y, spare) | _low(sample, spare)
            bracket = _above(x, spare) | ((sample >> spare) << 1) | _low(sample, 1)
            k = _reverse_low(_low(bracket - r, self.m - half) >> 1, half)
            return (bracket << half) | k
        # x = 2^half ((rev(k) + floor((1 + r) / 4)) mod 2^half) + lower bits, y = 2^half r + k.
        spare = half - log_side
        r = _above(y, spare) | _low(sample, spare)
        bracket = _above(x, spare) | (sample >> spare)
        k = _reverse_low(_low(bracket - ((r + np.uint32(1)) >> 2), half), half)
        lower = (k >> 2) + (_low(r + np.uint32(1), 2) << (half - 2))
        return (bracket << half) | lower


def _above(word: Array, count: int) -> Array:
    """Shift to the left; a shift by 32 or more gives zero."""
    return word << min(count, 31)


def hammersley_net(m: int) -> HammersleyNet:
    """Make the Hammersley net: the points (i / 2**m, phi_2(i)).

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    HammersleyNet, a (0,m,2)-net in base 2

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
    return HammersleyNet(checks.integer("m", m, 0, 32))


def larcher_pillichshammer_net(m: int) -> LarcherPillichshammerNet:
    """Make the Larcher-Pillichshammer net: i / 2**m and the product with the matrix of ones.

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    LarcherPillichshammerNet, a (0,m,2)-net in base 2 of low star discrepancy

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
    return LarcherPillichshammerNet(checks.integer("m", m, 0, 32))


def permutation_net(m: int) -> Net:
    """Make the permutation net of large minimum distance, which is not a digital net.

    The squared toroidal distance is 2**m on the integer grid for odd m, and 241 * 2**(m - 8) for even m >= 8
    with the *sheared* tiling, rows shifted by 2**(m - 2).

    Parameters
    ----------
    m : int
        In [1, 32]. The construction starts at m = 4 for even m; m = 2 gives the Hammersley net, with the
        distance of Table 5.1.

    Returns
    -------
    Net, a (0,m,2)-net in base 2, numbered by its first coordinate

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1, Theorem 3 and class GenDiag0m2.

    Examples
    --------
    >>> print((permutation_net(3).points(8)[:, 1] * 8).astype(int))
    [0 5 2 7 4 1 6 3]
    """
    m = checks.integer("m", m, 1, 32)
    return HammersleyNet(2) if m == 2 else PermutationNet(m)


def permutation_net_in_row(m: int, row: Array | int, index: Array | int) -> Array:
    """Return points of the permutation net in the pixels of one row of the screen.

    With the net in every pixel, the screen keeps the minimum distance of the net if each row of pixels shifts
    it by a quarter of a pixel along x relative to the row below, modulo the pixel. For odd m there is no
    shift. The pattern repeats after four rows, and in each row from pixel to pixel.

    Parameters
    ----------
    m : int, in [1, 32]: 2**m points per pixel
    row : uint32 Array, or int, row of the pixel, counted along the second coordinate
    index : uint32 Array, broadcastable to ``row``, or int
        Below 2**m, in the numbering of :func:`permutation_net`.

    Returns
    -------
    uint32 Array, the broadcast shape + (2,)
        Fractions of the pixel: the coordinate is ``bits / 2**32``.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1, function pixelWrap and Fig. 5.19.

    Examples
    --------
    >>> print(permutation_net_in_row(4, jnp.arange(3, dtype=jnp.uint32), 0) >> 28)
    [[ 0 15]
     [ 4 15]
     [ 8 15]]
    """
    net = permutation_net(m)
    row, index = jnp.broadcast_arrays(checks.unsigned("row", row), checks.unsigned("index", index, net.size))
    x, y = net.word(index, 0), net.word(index, 1)
    # A quarter of the pixel is 2**30: in the product with the row, multiples of four wrap to 0.
    return jnp.stack([x if net.m % 2 else x + (row << 30), y], axis=-1)

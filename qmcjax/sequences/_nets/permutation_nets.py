"""Permutation nets of large minimum distance in two and three dimensions; they are not digital nets."""

from dataclasses import field

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._nets.nets import Net, above, fraction_of, hammersley_net, low, reverse_low
from qmcjax.sequences._protocol.binary import BinarySequence


@frozen_pytree
class PermutationNet(Net):
    """Points on parallel diagonals, thesis Sect. 5.3.1, for odd m and even m >= 4."""

    called = "permutation_net"

    def further(self, index: Array, dim: int) -> Array:
        half = self.m // 2
        if self.m % 2:
            # Eq. 5.44
            y = low(index - (reverse_low(low(index, half), half) << (self.m - half)), self.m)
        else:
            # x = 2^half rev(k) + floor(k / 4) + (1 + r) 2^(half - 2), y = k + r 2^half, solved for k and r:
            # the low bits of x are the upper ones of k. After removing the lower part of 4 rev(k), the bits
            # of (x - floor(k / 4)) / 2^(half - 2) above bit half are the lowest two of k.
            upper = low(index, half - 2)
            rest = (index >> (half - 2)) - np.uint32(1) - (reverse_low(upper, half - 2) << 2)
            lowest = reverse_low(low(rest >> half, 2), 2)
            y = (low(rest, half) << half) | (upper << 2) | lowest
        return reverse(fraction_of(y, self.m))

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        half = self.m // 2
        if self.m % 2:
            # With H = m - half: x = 2^half ((2 rev(k) + r) mod 2^H) + k and y = 2^half r + k. The cell
            # gives the leading bits of r and of the bracket, whose lowest bits agree.
            spare = self.m - half - log_side
            r = above(y, spare) | low(sample, spare)
            bracket = above(x, spare) | ((sample >> spare) << 1) | low(sample, 1)
            k = reverse_low(low(bracket - r, self.m - half) >> 1, half)
            return (bracket << half) | k
        # x = 2^half ((rev(k) + floor((1 + r) / 4)) mod 2^half) + lower bits, y = 2^half r + k.
        spare = half - log_side
        r = above(y, spare) | low(sample, spare)
        bracket = above(x, spare) | (sample >> spare)
        k = reverse_low(low(bracket - ((r + np.uint32(1)) >> 2), half), half)
        lower = (k >> 2) + (low(r + np.uint32(1), 2) << (half - 2))
        return (bracket << half) | lower


def permutation_net(m: int) -> Net:
    """Make the permutation net of large minimum distance, which is not a digital net.

    Its squared toroidal distance on the integer grid is 2**m for odd m, and 241 * 2**(m - 8) for even m >= 8
    with the *sheared* tiling, which shifts rows by 2**(m - 2).

    Parameters
    ----------
    m : int
        In [1, 32]. For even m the construction starts at m = 4; m = 2 gives the Hammersley net, with the
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
    return hammersley_net(2) if m == 2 else PermutationNet(m)


def permutation_net_in_row(m: int, row: Array | int, index: Array | int) -> Array:
    """Return points of the permutation net in the pixels of one row of the screen.

    If every pixel contains the net, the screen keeps its minimum distance if each row of pixels shifts it by
    a quarter of a pixel along x relative to the row below, modulo the pixel. For odd m there is no shift. The
    pattern repeats after four rows, and within each row from pixel to pixel.

    Parameters
    ----------
    m : int, in [1, 32]: 2**m points per pixel
    row : uint32 Array, or int, row of the pixel, counted along the second coordinate
    index : uint32 Array, broadcastable to ``row``, or int
        Below 2**m, numbered as in :func:`permutation_net`.

    Returns
    -------
    uint32 Array, the broadcast shape + (2,)
        Fractions of the pixel: a coordinate is ``bits / 2**32``.

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
    # A quarter of a pixel is 2**30: in the product with the row, multiples of four wrap to 0.
    return jnp.stack([x if net.m % 2 else x + (row << 30), y], axis=-1)


# fmt: off
_PERMUTATIONS = {
    2: ((0, 2, 3, 1), (0, 3, 1, 2)),
    3: ((0, 6, 2, 4, 7, 1, 5, 3), (0, 5, 6, 3, 1, 4, 7, 2)),
    4: ((13, 4, 0, 9, 6, 15, 11, 2, 10, 3, 7, 14, 1, 8, 12, 5),
        (5, 11, 0, 14, 6, 8, 3, 13, 10, 4, 15, 1, 9, 7, 12, 2)),
    5: ((1, 16, 26, 11, 28, 12, 6, 22, 20, 4, 31, 14, 24, 8, 3, 18,
         0, 17, 27, 10, 13, 29, 23, 7, 5, 21, 30, 15, 9, 25, 2, 19),
        (16, 0, 30, 14, 9, 24, 6, 23, 13, 28, 19, 3, 5, 20, 11, 27,
         1, 17, 15, 31, 8, 25, 7, 22, 12, 29, 2, 18, 4, 21, 26, 10)),
}
# fmt: on
"""Second and third coordinate of P_2, ..., P_5, numbered by the first."""


@frozen_pytree
class PermutationNet3D(BinarySequence):
    """One of P_2, ..., P_5, tiled until there are 2**m points (thesis Sect. 5.3.2)."""

    m: int = field(metadata={"static": True})

    called = "permutation_net_3d"
    reported = ("m",)

    @property
    def dims(self) -> int:
        return 3

    @property
    def size(self) -> int:
        return 2**self.m

    def word(self, index: Array, dim: int) -> Array:
        numerator = index if dim == 0 else self._numerator(index, dim)
        return numerator << (32 - self.m)

    def _numerator(self, index: Array, dim: int) -> Array:
        # In bits, the octant (a, b, c) maps (x', y', z') to x = a x' c b, y = b y' c a and z = c z' (a ^ b)
        # a. So x determines the octant and x'.
        rest, m, done = index, self.m, 0
        coordinate = jnp.zeros_like(index)
        while m > 5:
            a, b, c = rest >> (m - 1), rest & np.uint32(1), (rest >> 1) & np.uint32(1)
            outer, inner = (b, (c << 1) | a) if dim == 1 else (c, ((a ^ b) << 1) | a)
            coordinate = coordinate | (((outer << (m - 1)) | inner) << done)
            rest, m, done = (rest >> 2) & np.uint32(2 ** (m - 3) - 1), m - 3, done + 2
        for bit, values in enumerate(_truth_tables(_PERMUTATIONS[m][dim - 1])):
            coordinate = coordinate | (((values >> rest) & np.uint32(1)) << (done + bit))
        return coordinate


def _truth_tables(permutation: tuple[int, ...]) -> list[np.uint32]:
    """Return one word per bit of at most 32 numbers, with bit i from number i, to avoid a gather."""
    bits = (len(permutation) - 1).bit_length()
    return [
        np.uint32(sum((number >> k & 1) << i for i, number in enumerate(permutation))) for k in range(bits)
    ]


def permutation_net_3d(m: int) -> PermutationNet3D:
    """Make the permutation net of large minimum distance: P_2, ..., P_5 and their tilings.

    Up to m = 5 these are the (0,m,3)-nets found by search, with squared toroidal distances 6, 12, 38 and 90
    on the integer grid. For larger m, the points for m - 3 are repeated in the eight octants. This keeps the
    Latin hypercube property, one point in each of 2**m slabs along each axis, but each tiling raises t by
    one, as counted up to m = 14: m = 6, 7, 8 give (1,m,3)-nets, m = 9, 10, 11 (2,m,3)-nets.

    Parameters
    ----------
    m : int
        In [2, 32]. Every such m is 2, 3, 4 or 5 plus a multiple of 3; P_5 is preferred to P_2.

    Returns
    -------
    PermutationNet3D, numbered by the first coordinate

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.2.

    Examples
    --------
    >>> print((permutation_net_3d(2).points(4) * 4).astype(int))
    [[0 0 0]
     [1 2 3]
     [2 3 1]
     [3 1 2]]
    """
    return PermutationNet3D(checks.integer("m", m, 2, 32))

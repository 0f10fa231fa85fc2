"""Nets of 2**m points in three dimensions with i / 2**m as first coordinate."""

import abc
from collections.abc import Callable
from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import pascal, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.digital import _larcher_sobol
from qmcjax.sequences._nets.nets import HammersleyNet, LarcherPillichshammerNet, Net
from qmcjax.sequences._protocol.binary import BinarySequence, WordFirst


class OverPlane(BinarySequence):
    """A net in three dimensions over a net of the first two coordinates, by which it is inverted."""

    plane: Any
    """The net of the first two coordinates."""

    reported = ("dims",)

    @property
    def dims(self) -> int:
        return 3

    @property
    def size(self) -> int:
        return self.plane.size

    @abc.abstractmethod
    def _third(self, index: Array) -> Array:
        """Return the third coordinate, bit-reversed."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        return self._third(index) if dim == 2 else self.plane.bit_reversed(index, dim)

    def word(self, index: Array, dim: int) -> Array:
        return reverse(self._third(index)) if dim == 2 else self.plane.word(index, dim)

    def points_per_cell(self, log_side: int) -> int:
        return self.plane.points_per_cell(log_side)

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of a point from the cell of its first two coordinates (thesis Sect. 5.2.4)."""
        return self.plane.index_in_cell(x, y, log_side, sample)


@frozen_pytree
class Net3D(OverPlane):
    """A (0,m,3)-net in base 2: i / 2**m and the two components of a (0,2)-sequence."""

    plane: Net
    third: Callable[[Array], Array] = field(metadata={"static": True})
    """The third coordinate, bit-reversed, from the index."""

    called = "net_3d"

    def _third(self, index: Array) -> Array:
        return self.third(index)


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
class PermutationNet3D(WordFirst):
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
        # In bits, the octant (a, b, c) makes x = a x' c b, y = b y' c a and z = c z' (a ^ b) a out of
        # (x', y', z'). So x gives the octant and x'.
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
    """Return one word per bit of at most 32 numbers, with bit i from number i: avoids a gather."""
    bits = (len(permutation) - 1).bit_length()
    return [
        np.uint32(sum((number >> k & 1) << i for i, number in enumerate(permutation))) for k in range(bits)
    ]


def sobol_net_3d(m: int) -> Net3D:
    """Make the Sobol' net: i / 2**m and the two components of the Sobol' (0,2)-sequence.

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    Net3D
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
    return Net3D(HammersleyNet(checks.integer("m", m, 0, 32)), pascal)


def larcher_pillichshammer_net_3d(m: int) -> Net3D:
    """Make the modified net: i / 2**m and the two components of the (0,2)-sequence of C'1, C'2.

    Parameters
    ----------
    m : int, in [0, 32]

    Returns
    -------
    Net3D
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
    return Net3D(LarcherPillichshammerNet(checks.integer("m", m, 0, 32)), _larcher_sobol)


def permutation_net_3d(m: int) -> PermutationNet3D:
    """Make the permutation net of large minimum distance: P_2, ..., P_5 and their tilings.

    Up to m = 5 these are the (0,m,3)-nets found by search, of squared toroidal distance 6, 12, 38 and
    90 on the integer grid. Beyond, the points of m - 3 are repeated in the eight octants. This keeps
    the Latin hypercube property, one point in each of 2**m slabs along each axis, but each tiling
    raises t by one, as counted up to m = 14: m = 6, 7, 8 give (1,m,3)-nets, m = 9, 10, 11 (2,m,3)-nets.

    Parameters
    ----------
    m : int
        In [2, 32]. Every such m is 2, 3, 4 or 5 plus a multiple of 3; if both P_2 and P_5 lead to it, P_5 is
        used.

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

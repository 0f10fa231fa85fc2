"""Peano order: a curve through neighbouring pixels in base 3."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import Order

PEANO_SIDE = 3**10
"""Longest side: positions below 9**10 fit a uint32, those of the next side, 3**11, do not."""

_ONE = np.uint32(1)


def _reversed_if(odd: Array, digit: Array) -> Array:
    return jnp.where(odd != 0, np.uint32(2) - digit, digit)


@frozen_pytree
class Peano(Order):
    """The Peano curve from (0, 0) to (side - 1, side - 1).

    Nine smaller curves, column by column, alternately down and up. Each digit of a coordinate is reversed, to
    2 minus itself, when the digits of the other coordinate before it in the position have an odd sum. Their
    reversals do not change that.
    """

    @property
    def log_side(self) -> int:
        """Logarithm to base 3 of the side of the padded raster."""
        digits = 0
        while 3**digits < max(self.width, self.height):
            digits += 1
        return digits

    @property
    def length(self) -> int:
        return 9**self.log_side

    @property
    def raster(self) -> tuple[int, int]:
        return 3**self.log_side, 3**self.log_side

    def unchecked_position(self, x: Array, y: Array) -> Array:
        position = odd_x = odd_y = jnp.zeros_like(x)
        for level in range(self.log_side - 1, -1, -1):
            column, row = ((v // np.uint32(3**level)) % np.uint32(3) for v in (x, y))
            odd_x = odd_x ^ (column & _ONE)
            pair = np.uint32(3) * _reversed_if(odd_y, column) + _reversed_if(odd_x, row)
            odd_y = odd_y ^ (row & _ONE)
            position = position * np.uint32(9) + pair
        return position

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        x = y = odd_x = odd_y = jnp.zeros_like(position)
        for level in range(self.log_side - 1, -1, -1):
            pair = (position // np.uint32(9**level)) % np.uint32(9)
            column, row = pair // np.uint32(3), pair % np.uint32(3)
            odd_x = odd_x ^ (column & _ONE)
            x = x * np.uint32(3) + _reversed_if(odd_y, column)
            y = y * np.uint32(3) + _reversed_if(odd_x, row)
            odd_y = odd_y ^ (row & _ONE)
        return x, y


def peano(width: int, height: int) -> Peano:
    """Make the order of the Peano curve; its length is a power of 9.

    Consecutive positions are pixels that share an edge.

    Parameters
    ----------
    width, height : int
        In [1, 59049]: a larger image needs a side of 3**11, and positions beyond 32 bits. The curve fills
        the next square with a power of three as side; pixels off the image are skipped.

    References
    ----------
    .. [1] G. Peano, "Sur une courbe, qui remplit toute une aire plane", 1890.
    .. [2] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Fig. 1.

    Examples
    --------
    >>> order = peano(3, 3)
    >>> print([tuple(int(v) for v in order.pixel(i)) for i in range(5)])
    [(0, 0), (0, 1), (0, 2), (1, 2), (1, 1)]
    """
    return Peano(*checks.image_size(width, height, PEANO_SIDE))

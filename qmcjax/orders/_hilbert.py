"""Hilbert order: a curve through neighbouring pixels only."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import SquareOrder


@frozen_pytree
class Hilbert(SquareOrder):
    """The Hilbert curve from (0, 0) to (side - 1, 0).

    In each quadrant the curve is a smaller one: transposed in the first, transposed about the other diagonal
    in the last. Instead of composing these transformations, each level applies its own to the lower bits of
    the pixel.
    """

    def unchecked_position(self, x: Array, y: Array) -> Array:
        ones = np.uint32(2**self.log_side - 1)
        position = jnp.zeros_like(x)
        for level in range(self.log_side - 1, -1, -1):
            right, low = (x >> level) & np.uint32(1), (y >> level) & np.uint32(1)
            position = (position << 2) | ((right * np.uint32(3)) ^ low)
            flip = jnp.where((right & ~low) != 0, ones, np.uint32(0))
            upper = low == 0
            x, y = jnp.where(upper, y ^ flip, x), jnp.where(upper, x ^ flip, y)
        return position

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        x = y = jnp.zeros_like(position)
        for level in range(self.log_side):
            quadrant = (position >> (2 * level)) & np.uint32(3)
            right = quadrant >> 1
            low = (quadrant ^ right) & np.uint32(1)
            flip = jnp.where((right & ~low) != 0, np.uint32(2**level - 1), np.uint32(0))
            upper = low == 0
            x, y = jnp.where(upper, y ^ flip, x), jnp.where(upper, x ^ flip, y)
            x, y = x | (right << level), y | (low << level)
        return x, y


def hilbert(width: int, height: int) -> Hilbert:
    """Make the order of the Hilbert curve.

    Consecutive positions are pixels that share an edge, so a contiguous piece of a low discrepancy sequence
    stays in a compact region.

    Parameters
    ----------
    width, height : int
        In [1, 65536]. The curve fills the next square with a power of two as side; pixels off the
        image are skipped, which breaks the curve where it leaves the image.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.

    Examples
    --------
    >>> order = hilbert(4, 4)
    >>> print([tuple(int(v) for v in order.pixel(i)) for i in range(4)])
    [(0, 0), (1, 0), (1, 1), (0, 1)]
    """
    return Hilbert(*checks.image_size(width, height))

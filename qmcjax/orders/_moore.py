"""Moore order: the closed Hilbert curve."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import SquareOrder
from qmcjax.orders._hilbert import Hilbert


@frozen_pytree
class Moore(SquareOrder):
    """Four Hilbert curves, rotated by 90 degrees: up through the left half, and down through the right."""

    @property
    def _quarter(self) -> Hilbert:
        half = 2**self.log_side // 2
        return Hilbert(half, half)

    def unchecked_position(self, x: Array, y: Array) -> Array:
        if self.log_side == 0:
            return jnp.zeros_like(x)
        level = self.log_side - 1
        ones = np.uint32(2**level - 1)
        right, low = x >> level, y >> level
        flip = jnp.where(right != 0, ones, np.uint32(0))
        x, y = x & ones, y & ones
        # On the left the x of a quarter runs against x and its y along y; on the right the reverse.
        inside = self._quarter.unchecked_position(y ^ flip, x ^ flip ^ ones)
        return (((right * np.uint32(3)) ^ low) << (2 * level)) | inside

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        if self.log_side == 0:
            return jnp.zeros_like(position), jnp.zeros_like(position)
        level = self.log_side - 1
        ones = np.uint32(2**level - 1)
        quadrant = position >> (2 * level)
        right = quadrant >> 1
        low = (quadrant ^ right) & np.uint32(1)
        flip = jnp.where(right != 0, ones, np.uint32(0))
        along, across = self._quarter.unchecked_pixel(position & np.uint32(4**level - 1))
        return (across ^ flip ^ ones) | (right << level), (along ^ flip) | (low << level)


def moore(width: int, height: int) -> Moore:
    """Make the order of the Moore curve, a closed variant of the Hilbert curve.

    Consecutive positions are pixels that share an edge, and so are the last and the first.

    Parameters
    ----------
    width, height : int
        In [1, 65536]. The curve fills the next square with a power of two as side; pixels off the image are
        skipped, which breaks the curve where it leaves the image.

    Returns
    -------
    Moore, from (side / 2 - 1, 0) to its right neighbour, around the square

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Fig. 1.

    Examples
    --------
    >>> order = moore(4, 4)
    >>> print([tuple(int(v) for v in order.pixel(i)) for i in (0, 1, 14, 15)])
    [(1, 0), (0, 0), (3, 0), (2, 0)]
    """
    return Moore(*checks.image_size(width, height))

"""Morton order: the bits of both coordinates, interleaved."""

import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import traced_once
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import SquareOrder

_SPREADING = ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555))
_GATHERING = ((1, 0x33333333), (2, 0x0F0F0F0F), (4, 0x00FF00FF), (8, 0x0000FFFF))


@traced_once
def spread(word: Array) -> Array:
    """Move bit ``k`` to bit ``2 k``, for the lower 16 bits."""
    for shift, mask in _SPREADING:
        word = (word | (word << shift)) & np.uint32(mask)
    return word


@traced_once
def gather(word: Array) -> Array:
    """Move bit ``2 k`` to bit ``k``, and drop the odd bits."""
    word = word & np.uint32(0x55555555)
    for shift, mask in _GATHERING:
        word = (word | (word >> shift)) & np.uint32(mask)
    return word


@frozen_pytree
class Morton(SquareOrder):
    """Quadrants in the order upper left, upper right, lower left, lower right, recursively."""

    def unchecked_position(self, x: Array, y: Array) -> Array:
        return spread(x) | (spread(y) << 1)

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        return gather(position), gather(position >> 1)


def morton(width: int, height: int) -> Morton:
    """Make the Morton order (Z-order): x in the even bits of the position, y in the odd ones.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the curve fills the next square with a power of two as side

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Fig. 1.

    Examples
    --------
    >>> print(morton(4, 4).position(2, 1), morton(4, 4).length)
    6 16
    """
    return Morton(*checks.image_size(width, height))

"""Raster order: row by row."""

import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import Order


@frozen_pytree
class Raster(Order):
    """Rows from top to bottom, each from left to right."""

    def unchecked_position(self, x: Array, y: Array) -> Array:
        return y * np.uint32(self.width) + x

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        return position % np.uint32(self.width), position // np.uint32(self.width)


def raster(width: int, height: int) -> Raster:
    """Make the order of scan lines: position ``y * width + x``.

    Parameters
    ----------
    width, height : int, in [1, 65536]

    Examples
    --------
    >>> print(raster(5, 3).position(1, 2))
    11
    """
    return Raster(*checks.image_size(width, height))

"""The interface of an order: from a pixel to its position on a curve, and back."""

import abc
from dataclasses import dataclass, field

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks

MAX_SIDE = checks.MAX_SIDE
"""Largest resolution with positions that fit a uint32."""


@dataclass(frozen=True)
class Order(abc.ABC):
    """A bijection between the pixels of a padded image and 0, ..., length - 1.

    :meth:`position` and :meth:`pixel` check their arguments. Samplers use the unchecked methods.
    """

    width: int = field(metadata={"static": True})
    height: int = field(metadata={"static": True})

    @property
    def length(self) -> int:
        """Number of positions on the padded curve."""
        return self.width * self.height

    @property
    def raster(self) -> tuple[int, int]:
        """Width and height of the padded raster."""
        return self.width, self.height

    @abc.abstractmethod
    def unchecked_position(self, x: Array, y: Array) -> Array:
        """Return ``position`` of uint32 Arrays of one shape, within the padded raster."""

    @abc.abstractmethod
    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        """Return ``pixel`` of a uint32 Array below ``length``."""

    def position(self, x: Array | int, y: Array | int) -> Array:
        """Return the positions of pixels along the curve.

        Parameters
        ----------
        x, y : integer Array, broadcastable, or int
            Column and row of the pixel, within the padded raster. Traced ones are not checked.

        Returns
        -------
        uint32 Array, the broadcast shape
        """
        columns, rows = self.raster
        x, y = jnp.broadcast_arrays(checks.unsigned("x", x, columns), checks.unsigned("y", y, rows))
        return self.unchecked_position(x, y)

    def pixel(self, position: Array | int) -> tuple[Array, Array]:
        """Return the pixels at positions of the curve: the inverse of :meth:`position`.

        Parameters
        ----------
        position : integer Array, shape (...), or int, below ``length``

        Returns
        -------
        x, y : uint32 Array, shape (...)
            Column and row, within the padded raster; the curve may leave the image.
        """
        return self.unchecked_pixel(checks.unsigned("position", position, self.length))


@dataclass(frozen=True)
class SquareOrder(Order):
    """An order with a curve that fills a square, its side a power of two."""

    @property
    def log_side(self) -> int:
        """Binary logarithm of the side of the padded raster."""
        return log_side(self.width, self.height)

    @property
    def length(self) -> int:
        return 4**self.log_side

    @property
    def raster(self) -> tuple[int, int]:
        return 2**self.log_side, 2**self.log_side


def log_side(width: int, height: int) -> int:
    """Return the binary logarithm of the smallest power of two that covers both."""
    width, height = checks.image_size(width, height)
    return (max(width, height) - 1).bit_length()

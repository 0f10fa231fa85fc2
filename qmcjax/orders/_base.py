"""The interface of an order: maps between a pixel, or a pixel of a frame, and its position on a curve."""

import abc
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree, listing

MAX_SIDE = checks.MAX_SIDE
"""Largest resolution for which positions fit a uint32."""


@dataclass(frozen=True)
class Order(abc.ABC):
    """A bijection between the pixels of a padded image and 0, ..., length - 1.

    :meth:`position` and :meth:`pixel` check their arguments. Samplers use the unchecked methods.
    """

    __dir__ = listing("at_frame", "length", "pixel", "position", "raster")

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
            Column and row of the pixel, within the padded raster. Traced values are not checked.

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
    """An order along a curve that fills a square with a power of two as side."""

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


@dataclass(frozen=True)
class FrameOrder(abc.ABC):
    """A bijection between the pixels of all frames, padded to powers of two, and 0, ..., length - 1."""

    width: int = field(metadata={"static": True})
    height: int = field(metadata={"static": True})
    frames: int = field(metadata={"static": True})

    @property
    def log_side(self) -> int:
        """Binary logarithm of the side of the padded raster."""
        return log_side(self.width, self.height)

    @property
    def log_frames(self) -> int:
        """Binary logarithm of the padded number of frames."""
        return (self.frames - 1).bit_length()

    @property
    def length(self) -> int:
        """Number of positions."""
        return 2 ** (2 * self.log_side + self.log_frames)

    @abc.abstractmethod
    def unchecked_position(self, x: Array, y: Array, t: Array) -> Array:
        """Return ``position`` of uint32 Arrays of one shape."""

    @abc.abstractmethod
    def unchecked_pixel(self, position: Array) -> tuple[Array, Array, Array]:
        """Return ``pixel`` of a uint32 Array below ``length``."""

    def position(self, x: Array | int, y: Array | int, t: Array | int) -> Array:
        """Return the positions of pixels of frames.

        Parameters
        ----------
        x, y, t : integer Array, broadcastable, or int
            Column, row and frame, within the padded raster and number of frames. Traced values are not
            checked.

        Returns
        -------
        uint32 Array, the broadcast shape
        """
        limits = (2**self.log_side, 2**self.log_side, 2**self.log_frames)
        named = zip(("x", "y", "t"), (x, y, t), limits, strict=True)
        return self.unchecked_position(*jnp.broadcast_arrays(*(checks.unsigned(*one) for one in named)))

    def pixel(self, position: Array | int) -> tuple[Array, Array, Array]:
        """Return the pixels and frames at positions: the inverse of :meth:`position`.

        Parameters
        ----------
        position : integer Array, shape (...), or int, below ``length``

        Returns
        -------
        x, y, t : uint32 Array, shape (...)
        """
        return self.unchecked_pixel(checks.unsigned("position", position, self.length))

    def at_frame(self, frame: Array | int) -> "OneFrame":
        """Return the positions of one frame as an order of pixels, without recompilation for other frames.

        Parameters
        ----------
        frame : int, or integer Array of shape (), below the padded number of frames
            Traced values are taken modulo this number.
        """
        return OneFrame(self.width, self.height, self, checks.frame(frame, 2**self.log_frames))


@frozen_pytree
class OneFrame(Order):
    """The positions of one frame, a subset of those of an order of pixels and frames."""

    animation: FrameOrder
    frame: Array
    """uint32 scalar."""

    @property
    def length(self) -> int:
        return self.animation.length

    @property
    def raster(self) -> tuple[int, int]:
        return 2**self.animation.log_side, 2**self.animation.log_side

    def at_frame(self, frame: Array | int) -> "OneFrame":
        """Return the order of another frame, as :meth:`FrameOrder.at_frame`."""
        return self.animation.at_frame(frame)

    def unchecked_position(self, x: Array, y: Array) -> Array:
        frame = self.frame & np.uint32(2**self.animation.log_frames - 1)
        return self.animation.unchecked_position(x, y, jnp.broadcast_to(frame, x.shape))

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        return self.animation.unchecked_pixel(position)[:2]


def animation_size(width: int, height: int, frames: int) -> tuple[int, int, int]:
    """Check that the positions fit a 32-bit word, and return the sizes."""
    width, height = checks.image_size(width, height)
    most = checks.INDEX_LIMIT // 4 ** log_side(width, height)
    return width, height, checks.integer("frames", frames, 1, most)

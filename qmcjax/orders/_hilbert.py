"""Curves that step to adjacent pixels only: Hilbert, Moore and Peano, and a Hilbert curve through frames."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import gray_decode, gray_encode
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import FrameOrder, Order, SquareOrder, animation_size


@frozen_pytree
class Hilbert(SquareOrder):
    """The Hilbert curve from (0, 0) to (side - 1, 0).

    Each quadrant contains a smaller curve: transposed in the first, transposed about the other diagonal in
    the last. Instead of composing these transformations, each level applies its own to the lower bits of the
    pixel.
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

    Consecutive positions are pixels that share an edge, so a contiguous block of a low discrepancy sequence
    falls into a compact region.

    Parameters
    ----------
    width, height : int
        In [1, 65536]. The curve fills the next square with a power of two as side; pixels outside the image
        are skipped, which breaks the curve where it leaves the image.

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
        # In the left half, a quarter's x runs against x and its y along y; in the right half the reverse.
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

    Consecutive positions are pixels that share an edge, including the last and the first.

    Parameters
    ----------
    width, height : int
        In [1, 65536]. The curve fills the next square with a power of two as side; pixels outside the image
        are skipped, which breaks the curve where it leaves the image.

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


PEANO_SIDE = 3**10
"""Longest side: positions below 9**10 fit a uint32; those for the next side, 3**11, do not."""

_ONE = np.uint32(1)


def _reversed_if(odd: Array, digit: Array) -> Array:
    return jnp.where(odd != 0, np.uint32(2) - digit, digit)


@frozen_pytree
class Peano(Order):
    """The Peano curve from (0, 0) to (side - 1, side - 1).

    It consists of nine smaller curves, column by column, alternately down and up. Each digit of a coordinate
    is reversed, to 2 minus itself, if the digits of the other coordinate before it in the position have an
    odd sum. Reversing those does not change the parity.
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
        the next square with a power of three as side; pixels outside the image are skipped.

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


def _packed(values: tuple[int, ...]) -> np.uint32:
    return np.uint32(sum(value << (4 * k) for k, value in enumerate(values)))


_ENTRY = _packed((0, 0, 0, 3, 3, 6, 6, 5))
"""The corner where the curve enters each part, for direction 0: the Gray code of 2 * ((w - 1) // 2)."""

_DIRECTION = {2: _packed((0, 1, 1, 0)), 3: _packed((0, 1, 1, 2, 2, 1, 1, 0))}
"""The axis along which the curve traverses each part, for two and three axes, minus that of the whole."""


def _at(table: np.uint32, digit: Array) -> Array:
    return (table >> (digit << 2)) & np.uint32(15)


def _rotated(word: Array, count: Array, axes: int) -> Array:
    """Rotate words of ``axes`` bits to the left, by 1 to ``axes``."""
    return ((word << count) | (word >> (np.uint32(axes) - count))) & np.uint32(2**axes - 1)


@frozen_pytree
class Hilbert3(FrameOrder):
    """Two axes, or one, down to blocks as long as they are wide; then all three axes.

    The state of a block is the corner where the curve enters, and the axis along which it leaves. It enters
    and leaves blocks of pixels in the first frame, so their states are those of a curve in the plane.
    """

    @property
    def _axes(self) -> list[tuple[int, int]]:
        """Place and number of axes of each digit, the first one first."""
        cubes = min(self.log_side, self.log_frames)
        planar = [(place, 2) for place in range(self.log_side - 1, cubes - 1, -1)]
        return planar + [(place, 3) for place in range(cubes - 1, -1, -1)]

    def _start(self, like: Array) -> tuple[Array, Array]:
        """Return the entry, and the axis of the exit: that of frames if they outnumber pixels per side."""
        axis = 2 if self.log_frames >= self.log_side else 0
        return jnp.zeros_like(like), jnp.full_like(like, np.uint32(axis))

    @staticmethod
    def _next(entry: Array, axis: Array, digit: Array, axes: int) -> tuple[Array, Array]:
        turn = axis + np.uint32(1)
        return (
            entry ^ _rotated(_at(_ENTRY, digit), turn, axes),
            (turn + _at(_DIRECTION[axes], digit)) % np.uint32(axes),
        )

    def unchecked_position(self, x: Array, y: Array, t: Array) -> Array:
        one = np.uint32(1)
        position = t >> self.log_side if self.log_frames > self.log_side else jnp.zeros_like(x)
        entry, axis = self._start(x)
        for place, axes in self._axes:
            corner = ((x >> place) & one) | (((y >> place) & one) << 1)
            if axes == 3:
                corner = corner | (((t >> place) & one) << 2)
            # A rotation to the right by axis + 1.
            turned = _rotated(corner ^ entry, np.uint32(axes - 1) - axis, axes)
            digit = gray_decode(turned)
            position = (position << axes) | digit
            entry, axis = self._next(entry, axis, digit, axes)
        return position

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array, Array]:
        one, left = np.uint32(1), 2 * self.log_side + min(self.log_side, self.log_frames)
        x = y = jnp.zeros_like(position)
        t = (position >> left) << self.log_side if self.log_frames > self.log_side else jnp.zeros_like(x)
        entry, axis = self._start(position)
        for place, axes in self._axes:
            left -= axes
            digit = (position >> left) & np.uint32(2**axes - 1)
            corner = _rotated(gray_encode(digit), axis + one, axes) ^ entry
            x, y = x | ((corner & one) << place), y | (((corner >> 1) & one) << place)
            t = t | ((corner >> 2) << place)
            entry, axis = self._next(entry, axis, digit, axes)
        return x, y, t


def hilbert3(width: int, height: int, frames: int) -> Hilbert3:
    """Make the order of a Hilbert curve through the pixels of an animation.

    Consecutive positions are neighbours: they differ by one in x, in y or in t, in the padded animation.

    Parameters
    ----------
    width, height : int, in [1, 65536]; padded to a square with a power of two as side
    frames : int
        Padded to a power of two; there are at most 2**32 positions. If there are more frames than pixels per
        side, cubes follow one another in time. If there are fewer, the curve visits cubes of all frames in
        the order of a Hilbert curve in the plane.

    Returns
    -------
    Hilbert3
        ``position(x, y, t)``, ``pixel(position)``, and ``at_frame(t)``, an order of pixels for samplers.

    References
    ----------
    .. [1] C. Hamilton, "Compact Hilbert Indices", Dalhousie University, CS-2006-07, 2006.
    .. [2] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.

    Examples
    --------
    >>> order = hilbert3(2, 2, 2)
    >>> print([tuple(int(v) for v in order.pixel(i)) for i in range(4)])
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    """
    return Hilbert3(*animation_size(width, height, frames))

"""Hilbert order of pixels and frames: a curve through neighbours only."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.bits import gray_decode, gray_encode
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._frames import FrameOrder, animation_size


def _packed(values: tuple[int, ...]) -> np.uint32:
    return np.uint32(sum(value << (4 * k) for k, value in enumerate(values)))


_ENTRY = _packed((0, 0, 0, 3, 3, 6, 6, 5))
"""The corner where the curve enters each part, for the direction 0: the Gray code of 2 * ((w - 1) // 2)."""

_DIRECTION = {2: _packed((0, 1, 1, 0)), 3: _packed((0, 1, 1, 2, 2, 1, 1, 0))}
"""The axis along which the curve passes through each part, for two and three axes, less that of the whole."""


def _at(table: np.uint32, digit: Array) -> Array:
    return (table >> (digit << 2)) & np.uint32(15)


def _rotated(word: Array, count: Array, axes: int) -> Array:
    """Rotate words of as many bits as there are axes to the left, by 1 to ``axes``."""
    return ((word << count) | (word >> (np.uint32(axes) - count))) & np.uint32(2**axes - 1)


@frozen_pytree
class Hilbert3(FrameOrder):
    """Two axes down to blocks as long as they are wide, or one; then all three.

    State of a block: the corner where the curve enters, and the axis along which it leaves. Blocks of pixels
    enter and leave in the first frame, so their states are those of a curve in the plane.
    """

    @property
    def _axes(self) -> list[tuple[int, int]]:
        """Place and number of axes of each digit, the first one first."""
        cubes = min(self.log_side, self.log_frames)
        planar = [(place, 2) for place in range(self.log_side - 1, cubes - 1, -1)]
        return planar + [(place, 3) for place in range(cubes - 1, -1, -1)]

    def _start(self, like: Array) -> tuple[Array, Array]:
        """Return the entry, and the axis of the exit: frames, if there are more than pixels per side."""
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
        side, cubes come one after another in time. If there are fewer, the curve passes through cubes of all
        frames in the order of a Hilbert curve in the plane.

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

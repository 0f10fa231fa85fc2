"""Raster, Morton and accordion order, computed from the bits of both coordinates without a state."""

import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import gather, gray_decode, gray_encode, spread
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import Order, SquareOrder


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


@frozen_pytree
class Accordion(SquareOrder):
    """Four smaller accordions: two transposed, two transposed about the other diagonal.

    The *lengthwise* coordinate of a square runs from its first half to its second, the *crosswise* one across
    the first half. All four children exchange the two; those of the second half also reverse both. The
    lengthwise bits above a child reverse it as a whole, and all but the last cancel: with lengthwise bit a
    and crosswise bit b of each level of the pixel, digit k of the position is (a[k] ^ a[k - 1],
    a[k] ^ b[k]).
    """

    @property
    def _vertical(self) -> np.uint32:
        """The levels with y as lengthwise coordinate: every second one, starting with the first."""
        return np.uint32(0xAAAAAAAA if self.log_side % 2 == 0 else 0x55555555)

    def unchecked_position(self, x: Array, y: Array) -> Array:
        lengthwise = (y & self._vertical) | (x & ~self._vertical)
        return spread(x ^ y) | (spread(gray_encode(lengthwise)) << 1)

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        lengthwise = gray_decode(gather(position >> 1))
        differing = gather(position)
        return lengthwise ^ (differing & self._vertical), lengthwise ^ (differing & ~self._vertical)


def accordion(width: int, height: int) -> Accordion:
    """Make the accordion order: the square is cut and unfolded about pivots into a strip.

    Each step cuts the strip into twice as many bars of half the width, by cuts from alternate sides; each cut
    leaves a pivot at its end. Turning the bars about their pivots gives a strip of twice the length. The
    first cut separates the upper from the lower half of the square.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the curve fills the next square with a power of two as side

    Returns
    -------
    Accordion
        From (0, 0) along the first rows to (side - 1, 0), and back along the last rows to (0, side - 1).

    Notes
    -----
    The caption in [1]_ does not say from which side the first cut of each step comes; here the sides
    alternate from step to step. This agrees with the rest of the caption: the last two quadrants of the
    Morton order are swapped, the second step leaves a jump from the bottom to the top between the second and
    the third quadrant, and reversing its cuts visits the 16 blocks in the order of a Moore curve. In print
    the jump also goes from the left to the right, which no choice of sides gives: here it stays in the last
    column. Beyond 16 blocks no choice gives a Moore curve: not all its squares are cut across the strip.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Fig. 4.

    Examples
    --------
    >>> order = accordion(4, 4)
    >>> print([tuple(int(v) for v in order.pixel(i)) for i in range(4)])
    [(0, 0), (0, 1), (1, 1), (1, 0)]
    """
    return Accordion(*checks.image_size(width, height))

"""Where curves cross the borders of pixels: exact integrals along edges, pixel by pixel."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qmcjax.scenes._base import EPS

Floats = NDArray[np.float64]


class Pieces(NamedTuple):
    """Parts of curves, each in one pixel."""

    curve: NDArray[np.intp]
    low: Floats
    high: Floats
    """The ends of the piece in the curve's parameter."""
    pixel: NDArray[np.intp]
    """``y * width + x``"""
    shape: tuple[int, int]
    """Of the image, (height, width)."""
    doubt: float
    """Error of an end in the curve's parameter by rounding: larger where a curve grazes a border."""

    @property
    def middle(self) -> Floats:
        return 0.5 * (self.low + self.high)

    @property
    def length(self) -> Floats:
        """The length of each piece, in the curve's parameter."""
        return self.high - self.low

    def image(self, integral: Floats) -> Floats:
        """Return the sum over the pieces in each pixel, divided by the pixel's area."""
        height, width = self.shape
        sums = np.bincount(self.pixel, integral, height * width).astype(np.float64)
        return width * height * sums.reshape(self.shape)


def split(
    breaks: Floats, point: Callable[[NDArray[np.intp], Floats], Floats], width: int, height: int, doubt: float
) -> Pieces:
    """Split curves at ``breaks``, shape (curves, any), in any order; ``point(curve, parameter)`` is on it."""
    breaks = np.sort(breaks, axis=1)
    curve, piece = np.nonzero(np.diff(breaks, axis=1) > 0)
    low, high = breaks[curve, piece], breaks[curve, piece + 1]
    at = point(curve, 0.5 * (low + high))
    column, row = np.floor(at[:, 0] * width), np.floor(at[:, 1] * height)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    pixel = (row[inside] * width + column[inside]).astype(np.intp)
    return Pieces(curve[inside], low[inside], high[inside], pixel, (height, width), doubt)


def split_segments(
    starts: Floats, ends: Floats, width: int, height: int, others: Floats | None = None
) -> Pieces:
    """Split segments, shape (any, 2), at the borders of pixels, and at ``others``, fractions of them."""
    span = ends - starts
    breaks = [np.tile([0.0, 1.0], (len(starts), 1))]
    off = 4 * EPS * max(1.0, float(np.abs(starts).max()), float(np.abs(ends).max()))
    doubt = EPS
    for axis, count in enumerate((width, height)):
        along = span[:, axis, None]
        borders = np.arange(count + 1) / count - starts[:, axis, None]
        breaks.append(np.where(along == 0, 0, borders / np.where(along == 0, 1, along)))
        met = (borders >= np.minimum(along, 0) - off) & (borders <= np.maximum(along, 0) + off)
        doubt = max(doubt, float(np.max(np.where(met, off / np.maximum(abs(along), off), 0))))
    if others is not None:
        breaks.append(others)
    return split(
        np.clip(np.concatenate(breaks, axis=1), 0, 1),
        lambda curve, t: starts[curve] + t[:, None] * span[curve],
        width,
        height,
        doubt,
    )

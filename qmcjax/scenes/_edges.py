"""Edges: the boxes that they may meet, points on them, and integrals along them, pixel by pixel."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.scenes._base import EPS


def linear(point: Array, constant: Array, slopes: Sequence[Array]) -> Array:
    """Return ``constant`` plus the sum of the ``slopes`` times the point's first coordinates."""
    return constant + sum(slope * point[..., j] for j, slope in enumerate(slopes))


def sign_varies(
    low: Array, high: Array, constant: Array, slopes: Sequence[Array], reach: ArrayLike = 0.0
) -> Array:
    """Return the boxes in which `linear`, up to ``reach``, may change its sign.

    The margin includes rounding in the scene's evaluation of the sum.
    """
    middle = linear(0.5 * (low + high), constant, slopes)
    half = sum(abs(slope) * 0.5 * (high[..., j] - low[..., j]) for j, slope in enumerate(slopes))
    size = abs(constant) + sum(abs(slope) for slope in slopes) + reach
    return abs(middle) <= half + reach + 16 * jnp.finfo(low.dtype).eps * size


def disc_sides(low: Array, high: Array, centre: Any, radius: Array) -> tuple[Array, Array]:
    """Return the boxes that are certainly outside or inside a disc in their first two coordinates."""
    cx, cy = centre[0], centre[1]
    margin = 16 * jnp.finfo(low.dtype).eps * (1 + abs(cx) + abs(cy) + radius)
    left, right = cx - high[..., 0], cx - low[..., 0]
    top, bottom = cy - high[..., 1], cy - low[..., 1]
    near = [jnp.maximum(jnp.maximum(a, -b), 0) for a, b in ((left, right), (top, bottom))]
    far = [jnp.maximum(-a, b) for a, b in ((left, right), (top, bottom))]
    outside = near[0] * near[0] + near[1] * near[1] > (radius + margin) ** 2
    inside = (far[0] * far[0] + far[1] * far[1] < (radius - margin) ** 2) & (radius > margin)
    return outside, inside


def visible(start: Array, end: Array) -> tuple[Array, Array]:
    """Clip segments to the unit square, and return the ends as fractions of the segments [1]_.

    ``start``, ``end``: float Array, shape (..., 2). Returns ``low, high``, float Array, shape (...): both 0
    if nothing is visible. They have no derivatives: moving the point where an edge is clipped does not
    change the area that the edge sweeps.

    References
    ----------
    .. [1] Y.-D. Liang, B. A. Barsky, "A New Concept and Method for Line Clipping", 1984.
    """
    start, span = jax.lax.stop_gradient((start, end - start))
    parallel = span == 0
    between = (start >= 0) & (start <= 1)
    divisor = jnp.where(parallel, 1, span)
    at_zero, at_one = -start / divisor, (1 - start) / divisor
    low = jnp.where(parallel, jnp.where(between, 0, 1), jnp.minimum(at_zero, at_one))
    high = jnp.where(parallel, jnp.where(between, 1, 0), jnp.maximum(at_zero, at_one))
    low = jnp.maximum(jnp.maximum(low[..., 0], low[..., 1]), 0)
    high = jnp.minimum(jnp.minimum(high[..., 0], high[..., 1]), 1)
    empty = high <= low
    return jnp.where(empty, 0, low), jnp.where(empty, 0, high)


def spread(u: Array, lengths: Array) -> tuple[Array, Array]:
    """Return the one of consecutive pieces that contains ``u`` in [0, 1), and the distance from its start.

    ``u``: float Array, shape (...). ``lengths``: float Array, shape (pieces,): pieces of length 0 are never
    hit, unless all have length 0. Returns ``piece``, int32 Array, shape (...), and ``position``, float Array,
    shape (...), with derivatives only with respect to ``u``.
    """
    lengths = jax.lax.stop_gradient(lengths)
    ends = jnp.cumsum(lengths)
    position = u * ends[-1]
    # Below the sum of all even after rounding, unless that is 0.
    piece = jnp.minimum(jnp.searchsorted(ends, position, side="right"), len(lengths) - 1)
    return piece, position - (ends - lengths)[piece]


def along(starts: Array, ends: Array, u: Array) -> tuple[Array, Array]:
    """Return points on the visible parts of segments, uniform by length, and the segment of each.

    ``starts``, ``ends``: float Array, shape (segments, 2). ``u``: float Array, shape (...): in [0, 1).
    Returns ``point``, float Array, shape (..., 2); ``segment``, int32 Array, shape (...).
    """
    low, high = visible(starts, ends)
    span = ends - starts
    length = jax.lax.stop_gradient(jnp.hypot(span[:, 0], span[:, 1]))
    segment, position = spread(u, (high - low) * length)
    fraction = low[segment] + position / length[segment]
    return starts[segment] + fraction[..., None] * span[segment], segment


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
    """Rounding error of an end in the curve's parameter, larger where a curve grazes a border."""

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
    """Split curves at ``breaks``, shape (curves, any), unordered; ``point(curve, parameter)`` evaluates."""
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
    """Split segments, shape (any, 2), at the borders of pixels and at the fractions ``others``."""
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

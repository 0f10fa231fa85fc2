"""A triangle."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, in_float64
from qmcjax.scenes._edges import along, split_segments

Floats = NDArray[np.float64]


@frozen_pytree
class Triangle(ExactScene):
    """A triangle: 1 inside, 0 elsewhere."""

    vertices: Array | Floats
    """The three corners (x, y), in either orientation, shape (3, 2)."""
    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        vertices = cast_edges(self, point.dtype).vertices
        x, y = point[..., 0], point[..., 1]
        inside = jnp.ones(x.shape, bool)
        for start, span in _sides(vertices):
            inside &= span[0] * (y - start[1]) - span[1] * (x - start[0]) > 0
        return inside.astype(point.dtype)

    def varies(self, low: Array, high: Array) -> Array:
        """Return the boxes that a side may meet; see `Scene`.

        This includes a few boxes beyond a sharp corner, where rounding may still give 1.
        """
        vertices = cast(self, low.dtype).vertices
        eps = jnp.finfo(low.dtype).eps
        shape = low.shape[:-1]
        apart, within = jnp.zeros(shape, bool), jnp.ones(shape, bool)
        for start, span in _sides(vertices):
            across = [span[0] * (end[..., 1] - start[1]) for end in (low, high)]
            along = [-span[1] * (end[..., 0] - start[0]) for end in (low, high)]
            least = jnp.minimum(*across) + jnp.minimum(*along)
            most = jnp.maximum(*across) + jnp.maximum(*along)
            slack = 8 * eps * (abs(span[0]) * (1 + abs(start[1])) + abs(span[1]) * (1 + abs(start[0])))
            apart |= most < -slack
            within &= least > slack
        met = ~(apart | within)
        return jnp.stack([met, met], axis=-1)

    def boundary(self, u: Array) -> tuple[Array, Array]:
        vertices = cast(self, u.dtype).vertices
        point, _ = along(vertices, jnp.roll(vertices, -1, axis=0), u[..., 0])
        return point, jnp.broadcast_to(jnp.sign(_twice_the_area(vertices)), point.shape[:-1])

    def _pixel_means(self, width: int, height: int) -> tuple[Floats, float]:
        """Add signed areas above the sides."""
        vertices = in_float64(self).vertices
        ends = np.roll(vertices, -1, axis=0)
        sides = zip(vertices, ends, strict=True)
        shares = sum(_shares_above(start, end, width, height) for start, end in sides)
        bound = 32 * EPS * max(width, height) * max(1.0, float(np.abs(vertices).max()))
        return -np.asarray(shares) * np.sign(_twice_the_area(vertices)), bound

    def reference_gradient(self, width: int, height: int) -> tuple["Triangle", float]:
        """Return the exact derivatives of the pixel means; see `Scene`.

        If a corner moves, the point at ``t`` on the side from it moves ``1 - t`` times as far, and the point
        at ``t`` on the side to it ``t`` times: the mean over a piece is the value at its midpoint.
        """
        width, height = checks.image_size(width, height)
        vertices = in_float64(self).vertices
        ends = np.roll(vertices, -1, axis=0)
        pieces = split_segments(vertices, ends, width, height)
        span = (ends - vertices) * np.sign(_twice_the_area(vertices))
        normal = np.stack([span[:, 1], -span[:, 0]], axis=-1)
        gradient = np.empty((height, width, 3, 2))
        for corner in range(3):
            share = np.where(pieces.curve == corner, 1 - pieces.middle, 0)
            share += np.where(pieces.curve == (corner - 1) % 3, pieces.middle, 0)
            for axis in (0, 1):
                gradient[..., corner, axis] = pieces.image(share * pieces.length * normal[pieces.curve, axis])
        bound = 4 * pieces.doubt * float(np.abs(span).max()) * width * height
        return Triangle(gradient), bound


def _sides(vertices: Any) -> list[tuple[Any, Any]]:
    """Return start and vector of each side; the inside is where the cross product is positive."""
    sign = jnp.sign(_twice_the_area(vertices))
    return [(vertices[k], sign * (vertices[(k + 1) % 3] - vertices[k])) for k in range(3)]


def _twice_the_area(vertices: Any) -> Any:
    """Return twice the area, positive if the corners turn from x to y."""
    a, b = vertices[1] - vertices[0], vertices[2] - vertices[0]
    return a[0] * b[1] - a[1] * b[0]


def _shares_above(start: Floats, end: Floats, width: int, height: int) -> Floats:
    """Return the fraction of each pixel on the smaller-y side of a segment, signed as its direction in x.

    Over the segment's part in a pixel this is the mean of a linear function clipped to [0, 1].
    """
    span = end - start
    if span[0] == 0:
        return np.zeros((height, width))
    x = np.clip(np.arange(width + 1) / width, min(start[0], end[0]), max(start[0], end[0]))
    y = start[1] + (x - start[0]) / span[0] * span[1]
    borders = (np.arange(height) / height)[:, None]
    left, right = (y[:-1] - borders) * height, (y[1:] - borders) * height
    lower, upper = np.minimum(left, right), np.maximum(left, right)
    rise = upper - lower
    flat = rise == 0
    enters, leaves = (np.clip((c - lower) / np.where(flat, 1, rise), 0, 1) for c in (0, 1))
    at_enters, at_leaves = (np.clip(lower + t * rise, 0, 1) for t in (enters, leaves))
    mean = (leaves - enters) * 0.5 * (at_enters + at_leaves) + (1 - leaves)
    return np.sign(span[0]) * width * np.diff(x) * np.where(flat, np.clip(lower, 0, 1), mean)


def triangle(vertices: Any = ((0.15, 0.2), (0.9, 0.4), (0.35, 0.85))) -> Triangle:
    """Return a triangle.

    Parameters
    ----------
    vertices : array_like, shape (3, 2)
        The corners (x, y), in either orientation, not collinear; they may lie outside the image.

    Examples
    --------
    >>> triangle([(0, 0), (1, 0), (0, 1)])(jnp.array([[0.3, 0.6], [0.6, 0.6]]))
    Array([1., 0.], dtype=float32)
    """
    vertices = numbers("vertices", vertices, (3, 2))
    if not isinstance(vertices, Tracer):
        a, b = np.diff(np.asarray(vertices, np.float64), axis=0)
        if abs(a[0] * b[1] - a[1] * b[0]) <= 4 * EPS * (abs(a[0] * b[1]) + abs(a[1] * b[0])):
            raise ValueError(f"vertices must not be on a straight line, got {checks.shown(vertices)}")
    return Triangle(vertices)

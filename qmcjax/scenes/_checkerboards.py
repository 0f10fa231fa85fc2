"""Checkerboards: on a ground plane that extends to the horizon, and seen from above at any angle."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes import _checkerboard_reference
from qmcjax.scenes._base import ExactScene, cast_edges
from qmcjax.scenes._edges import visible


@frozen_pytree
class Checkerboard(ExactScene):
    """A checkerboard in perspective up to the horizon, the upper edge of the image.

    At depth ``Z = squares / y`` and lateral position ``X = (x - 1/2) Z`` the value is 1 where
    ``floor(X) + floor(Z)`` is even and 0 elsewhere. Where squares are too fine for floating point numbers,
    ``Z >= 1 / (2 eps)`` (2**22 in float32), the value is their mean 1/2.
    """

    squares: Array | float
    """Number of squares across the lower edge of the image."""
    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        x, y, squares = point[..., 0], point[..., 1], cast_edges(self, point.dtype).squares
        farthest = float(0.5 / jnp.finfo(point.dtype).eps)
        depth = jnp.minimum(squares / y, farthest)
        half = 0.5 * (jnp.floor((x - 0.5) * depth) + jnp.floor(depth))
        return jnp.where(depth < farthest, 1 - 2 * (half - jnp.floor(half)), 0.5)

    def varies(self, low: Array, high: Array) -> Array:
        squares, eps = cast(self, low.dtype).squares, jnp.finfo(low.dtype).eps
        farthest, slack = float(0.5 / eps), 8 * eps
        near = jnp.minimum(squares / high[..., 1] * (1 - slack), farthest)
        far = jnp.minimum(squares / low[..., 1] * (1 + slack), farthest)
        left, right = low[..., 0] - 0.5, high[..., 0] - 0.5
        leftmost = jnp.minimum(left * near, left * far)
        rightmost = jnp.maximum(right * near, right * far)
        widest = slack * jnp.maximum(abs(leftmost), abs(rightmost))
        across = jnp.floor(leftmost - widest) == jnp.floor(rightmost + widest)
        met = ~(across & (jnp.floor(near) == jnp.floor(far))) & (near < farthest)
        return jnp.stack([met, met], axis=-1)

    def boundary(self, u: Array) -> tuple[Array, Array]:
        """Raise a ValueError: see `qmcjax.boundary_gradient`.

        There are infinitely many edges towards the horizon. Their contributions converge to the derivative
        only by cancellation: the sum of absolute values is infinite, with ``1/k`` for the line ``Z = k``
        alone, so no estimator that samples single edges has a mean.
        """
        raise ValueError(
            "scene must have finitely many edges, got a Checkerboard: towards the horizon they sweep an "
            "infinite area, whose parts cancel. Use differences of scene.reference, or a flat_checkerboard"
        )

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        return _checkerboard_reference.pixel_means(float(self.squares), width, height)


def checkerboard(squares: Array | float = 8.0) -> Checkerboard:
    """Return the perspective view of a checkerboard, the first test scene of [1]_.

    Parameters
    ----------
    squares : float
        Number of squares across the lower edge of the image; positive.

    Notes
    -----
    Section 6.1.1 shows the scene without a formula. The camera is our choice: it looks along the ground
    plane, with the horizon at the upper edge of the image, and squares are as deep as they are wide.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.1.1.

    Examples
    --------
    >>> checkerboard()(jnp.array([[0.51, 0.9], [0.49, 0.9]]))
    Array([1., 0.], dtype=float32)
    """
    return Checkerboard(positive("squares", squares))


@frozen_pytree
class FlatCheckerboard(ExactScene):
    """A checkerboard seen from above, rotated about the centre of the image.

    With ``X = squares ((x - 1/2) cos(angle) + (y - 1/2) sin(angle))`` and
    ``Y = squares ((y - 1/2) cos(angle) - (x - 1/2) sin(angle))`` the value is 1 where
    ``floor(X) + floor(Y)`` is even and 0 elsewhere.
    """

    squares: Array | NDArray[np.float64]
    """Number of squares across the image."""
    angle: Array | NDArray[np.float64]
    """In radians, from x to y."""
    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        x, y = point[..., 0] - 0.5, point[..., 1] - 0.5
        cosine, sine = scene.squares * jnp.cos(scene.angle), scene.squares * jnp.sin(scene.angle)
        return (1 + _parity(jnp.floor(x * cosine + y * sine) + jnp.floor(y * cosine - x * sine))) * 0.5

    def varies(self, low: Array, high: Array) -> Array:
        scene = cast(self, low.dtype)
        low, high = low - 0.5, high - 0.5
        cosine, sine = scene.squares * jnp.cos(scene.angle), scene.squares * jnp.sin(scene.angle)
        slack = 8 * jnp.finfo(low.dtype).eps * scene.squares
        met = jnp.zeros(low.shape[:-1], bool)
        for slopes in ((cosine, sine), (-sine, cosine)):
            first, last = -slack, slack
            for axis, slope in enumerate(slopes):
                ends = slope * low[..., axis], slope * high[..., axis]
                first, last = first + jnp.minimum(*ends), last + jnp.maximum(*ends)
            met |= jnp.floor(first) != jnp.floor(last)
        return jnp.stack([met, met], axis=-1)

    def boundary(self, u: Array) -> tuple[Array, Array]:
        """Return points on the edges and the jumps there; see `qmcjax.boundary_gradient`.

        All lines ``X = k`` and ``Y = k`` that meet the image are sampled equally often. The side of smaller X
        or Y lies to the left of a line's direction.
        """
        scene = cast(self, u.dtype)
        cosine, sine = jnp.cos(scene.angle), jnp.sin(scene.angle)
        half = jax.lax.stop_gradient(0.5 * scene.squares * (abs(cosine) + abs(sine)))  # of the image, along X
        farthest = jnp.maximum(jnp.ceil(half) - 1, 0)
        lines = 2 * farthest + 1
        position = u[..., 0] * (2 * lines)
        line = jax.lax.stop_gradient(jnp.floor(position))
        second = line >= lines
        k = line - farthest - jnp.where(second, lines, 0)

        first_axis, second_axis = jnp.stack([cosine, sine]), jnp.stack([-sine, cosine])
        across = jnp.where(second[..., None], *_same_shape(second_axis, first_axis, k))
        onward = jnp.where(second[..., None], *_same_shape(-first_axis, second_axis, k))
        foot = 0.5 + (k / scene.squares)[..., None] * across
        low, high = visible(foot - onward, foot + onward)
        distance = 2 * (low + (position - line) * (high - low)) - 1
        square = jnp.floor(jnp.where(second, -1, 1) * distance * scene.squares)
        return foot + distance[..., None] * onward, -_parity(k + square)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        return _checkerboard_reference.flat_means(float(self.squares), float(self.angle), width, height)

    def reference_gradient(self, width: int, height: int) -> tuple["FlatCheckerboard", float]:
        width, height = checks.image_size(width, height)
        squares, angle, bound = _checkerboard_reference.flat_gradients(
            float(self.squares), float(self.angle), width, height
        )
        return FlatCheckerboard(squares, angle), bound


def _parity(integers: Array) -> Array:
    """Return 1 for even and -1 for odd integers."""
    half = 0.5 * integers
    return 1 - 4 * (half - jnp.floor(half))


def _same_shape(a: Array, b: Array, like: Array) -> tuple[Array, Array]:
    shape = (*like.shape, 2)
    return jnp.broadcast_to(a, shape), jnp.broadcast_to(b, shape)


def flat_checkerboard(squares: Array | float = 8.0, angle: Array | float = 0.3) -> FlatCheckerboard:
    """Return a checkerboard seen from above.

    Parameters
    ----------
    squares : float, number of squares across the image; positive
    angle : float
        Rotation about the centre of the image, in radians, from x to y.

    Examples
    --------
    >>> flat_checkerboard(squares=2.0, angle=0.0)(jnp.array([[0.1, 0.1], [0.9, 0.1]]))
    Array([1., 0.], dtype=float32)
    """
    return FlatCheckerboard(positive("squares", squares), numbers("angle", angle))

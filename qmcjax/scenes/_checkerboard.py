"""A checkerboard on a ground plane that extends to the horizon."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.parameters import cast, positive
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes import _checkerboard_reference
from qmcjax.scenes._base import ExactScene, cast_edges


@frozen_pytree
class Checkerboard(ExactScene):
    """A checkerboard in perspective up to the horizon, the upper edge of the image.

    At depth ``Z = squares / y`` and lateral position ``X = (x - 1/2) Z`` the value is 1 where
    ``floor(X) + floor(Z)`` is even and 0 elsewhere. Where squares are too fine for floating point numbers,
    ``Z >= 1 / (2 eps)`` (2**22 in float32), it is their mean 1/2.
    """

    squares: Array | float
    """Number of squares across the lower edge of the image."""
    needs: ClassVar[tuple[str, ...]] = ("x", "y")

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

        There are infinitely many edges towards the horizon. Their contributions add up to a derivative only
        by cancellation: the sum of absolute values is infinite, ``1/k`` for the line ``Z = k`` alone, so no
        estimator that samples the edges one by one has a mean.
        """
        raise ValueError(
            "scene must have finitely many edges, got a Checkerboard: towards the horizon they sweep an "
            "infinite area, whose parts cancel. Use differences of scene.reference, or a flat_checkerboard"
        )

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel.

        The bound is about 2e-12 at 512 x 512, mostly rounding.
        """
        return _checkerboard_reference.pixel_means(float(self.squares), width, height)


def checkerboard(squares: Array | float = 8.0) -> Checkerboard:
    """Return the perspective view of a checkerboard, the first test scene of [1]_.

    Parameters
    ----------
    squares : float
        Number of squares across the lower edge of the image; positive.

    Notes
    -----
    Section 6.1.1 shows the scene without a formula. We chose the camera: it looks along the ground plane,
    with the horizon at the upper edge of the image, and squares are as deep as they are wide.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.1.1.

    Examples
    --------
    >>> checkerboard()(jnp.array([[0.51, 0.9], [0.49, 0.9]]))
    Array([1., 0.], dtype=float32)
    """
    return Checkerboard(positive("squares", squares))

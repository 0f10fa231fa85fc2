"""A Gaussian bump."""

import math
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.parameters import cast, numbers, positive
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, in_float64
from qmcjax.scenes._factors import bell_means, separable


@frozen_pytree
class Gaussian(ExactScene):
    """The bump ``exp(-|p - centre|**2 / (2 width**2))``."""

    centre: Any
    """Where it is 1, shape (2,)."""
    width: Any
    """Its standard deviation."""
    needs: ClassVar[tuple[str, ...]] = ("x", "y")

    def __call__(self, point: Array) -> Array:
        scene = cast(self, point.dtype)
        x = (point[..., 0] - scene.centre[0]) / scene.width
        y = (point[..., 1] - scene.centre[1]) / scene.width
        return jnp.exp(-0.5 * (x * x + y * y))

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel, a product of two differences of error functions."""
        scene = in_float64(self)
        scale = math.sqrt(0.5) / float(scene.width)

        def mean(j: int, low: NDArray[np.float64], length: float) -> NDArray[np.float64]:
            return bell_means((low - scene.centre[j]) * scale, length * scale)

        image = separable(mean, 2, width, height)
        return image, 16 * EPS * (1 + scale * float(1 + abs(scene.centre).max()))


def gaussian(centre: Any = (0.4, 0.6), width: Any = 0.15) -> Gaussian:
    """Return a Gaussian bump: infinitely smooth, so that samplers reach their best rates.

    Parameters
    ----------
    centre : float array, shape (2,), position of the maximum 1; anywhere
    width : float
        The standard deviation, in units of the unit square; positive.

    Examples
    --------
    >>> gaussian(centre=(0.5, 0.5), width=0.5)(jnp.array([[0.5, 0.5], [0.5, 0.0]]))
    Array([1.        , 0.60653067], dtype=float32)
    """
    return Gaussian(numbers("centre", centre, (2,)), positive("width", width))

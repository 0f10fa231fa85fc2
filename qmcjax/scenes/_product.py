"""Sobol's g-function, a product of as many factors as there are dimensions."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, in_float64
from qmcjax.scenes._factors import separable
from qmcjax.scenes._parameters import named


@frozen_pytree
class Product(ExactScene):
    """The product over ``j`` of ``(|4 x_j - 2| + a_j) / (1 + a_j)``, whose integral is 1."""

    a: Any
    """Insensitivity to each coordinate, shape (dims,)."""

    @property
    def needs(self) -> tuple[str, ...]:
        return named(self.a.shape[0])

    def __call__(self, point: Array) -> Array:
        a = cast(self, point.dtype).a
        value = jnp.ones_like(point[..., 0])
        for j in range(self.a.shape[0]):
            value *= (jnp.abs(4 * point[..., j] - 2) + a[j]) / (1 + a[j])
        return value

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        a = in_float64(self).a

        def mean(j: int, low: NDArray[np.float64], length: float) -> NDArray[np.float64]:
            if j >= 2:
                return np.ones(1)
            left = np.clip(0.5 - low, 0, length)
            right = length - left
            # Distances from 1/2 to the middle of each part.
            slopes = left * abs(0.5 - low - 0.5 * left) + right * abs(low + length - 0.5 - 0.5 * right)
            return (4 * slopes / length + a[j]) / (1 + a[j])

        image = separable(mean, len(a), width, height)
        return image, 32 * EPS * float(image.max())


def product(a: Any = (0.0, 1.0, 4.5, 9.0)) -> Product:
    """Return Sobol's g-function, a product of as many factors as ``a`` has entries.

    Parameters
    ----------
    a : float array, shape (dims,)
        Insensitivity to coordinate ``j``: with 0 its factor runs from 0 to 2, with 9 from 0.9 to 1.1.
        2 to 1024 numbers, each at least 0.

    References
    ----------
    .. [1] I. M. Sobol', "Sensitivity estimates for nonlinear mathematical models", 1993.

    Examples
    --------
    >>> product(a=[0.0, 0.0, 1.0])(jnp.array([1.0, 0.25, 1.0]))
    Array(3., dtype=float32)
    """
    a = numbers("a", a, (None,))
    checks.integer("the number of entries of a", a.shape[0], 2, 1024)
    require("a", a, lambda a: a >= 0, "at least 0")
    return Product(a)

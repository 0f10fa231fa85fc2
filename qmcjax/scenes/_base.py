"""What a scene is: a function on the unit cube, with names for its dimensions."""

from typing import Any, ClassVar, Protocol

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray


class Scene(Protocol):
    """A pure function from a point to a value; any object with these three is a scene.

    Dimensions 0 and 1 are the position on the screen: x to the right, y downward, so that pixel
    ``(x, y)`` covers ``[x, x+1)/width`` times ``[y, y+1)/height`` and is ``image[y, x]``.
    """

    needs: ClassVar[tuple[str, ...]]
    """The name of each dimension, in the order of the point's coordinates."""

    def __call__(self, point: Array) -> Array:
        """Evaluate the scene.

        Parameters
        ----------
        point : float Array, shape (..., len(needs))
            Points in [0, 1).

        Returns
        -------
        float Array, shape (...), of the dtype of ``point``
        """
        ...

    def reference(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the mean over each pixel and a bound on the absolute error of every one of them."""
        ...


def coordinates(point: Array, parameter: Any) -> tuple[Array, Array, Array]:
    """Return x, y and the scene's parameter, all in the dtype of ``point``."""
    x, y = point[..., 0], point[..., 1]
    return x, y, jnp.asarray(parameter).astype(point.dtype)

"""A grey ramp over one dimension."""

from dataclasses import field

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene
from qmcjax.scenes._parameters import named


@frozen_pytree
class Ramp(ExactScene):
    """The scene that shows one of the coordinates."""

    dimension: int = field(metadata={"static": True})
    """Its index, counted from 0."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension up to the one that is shown."""
        return named(max(self.dimension + 1, 2))

    def __call__(self, point: Array) -> Array:
        return point[..., self.dimension]

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel: 1/2 except for ramps over x or y."""
        image = np.full((height, width), 0.5)
        if self.dimension == 0:
            image[:] = (np.arange(width) + 0.5) / width
        elif self.dimension == 1:
            image[:] = ((np.arange(height) + 0.5) / height)[:, None]
        return image, EPS

    def varies(self, low: Array, high: Array) -> Array:
        del low
        return jnp.zeros(high.shape, bool).at[..., self.dimension].set(True)


def ramp(dimension: int = 5) -> Ramp:
    """Return the grey ramp of [1]_: rendered with one sample per pixel, it shows a coordinate of the sampler.

    A pattern in the image is a correlation of this dimension with the pixel; the mean 1/2 is reached only
    with enough samples to break the pattern.

    Parameters
    ----------
    dimension : int
        The dimension shown, counted from 0, in [0, 1023]; 0 and 1 are x and y.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Fig. 8.

    Examples
    --------
    >>> ramp(2)(jnp.array([0.1, 0.2, 0.75]))
    Array(0.75, dtype=float32)
    """
    return Ramp(checks.integer("dimension", dimension, 0, 1023))

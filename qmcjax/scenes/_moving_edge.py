"""A half plane that moves."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.parameters import cast, numbers
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import ExactScene, cast_edges, in_float64
from qmcjax.scenes._blurred_edge import smeared_by_box
from qmcjax.scenes._constancy import linear, sign_varies


@frozen_pytree
class MovingEdge(ExactScene):
    """The half plane ``x < offset + velocity time``: 1 inside, 0 outside."""

    offset: Any
    """Position of the edge when the shutter opens."""
    velocity: Any
    """Distance until the shutter closes; None is still and does not need time."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; time only if there is a velocity."""
        return ("x", "y") if self.velocity is None else ("x", "y", "time")

    def _edge(self) -> tuple[Any, list[Any]]:
        """Return constant and slopes of the linear function that is negative inside."""
        slopes = [jnp.ones_like(self.offset), jnp.zeros_like(self.offset)]
        return -self.offset, slopes if self.velocity is None else [*slopes, -self.velocity]

    def __call__(self, point: Array) -> Array:
        return (linear(point, *cast_edges(self, point.dtype)._edge()) < 0).astype(point.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel, a ramp with rounded ends."""
        scene = in_float64(self)
        velocity = 0.0 if scene.velocity is None else float(scene.velocity)
        return smeared_by_box(0.0, float(scene.offset) + 0.5 * velocity, (abs(velocity), 0.0), width, height)

    def varies(self, low: Array, high: Array) -> Array:
        constant, slopes = cast(self, low.dtype)._edge()
        met = sign_varies(low, high, constant, slopes)
        return jnp.stack([met & (slope != 0) for slope in slopes], axis=-1)


def moving_edge(offset: Any = 0.3, velocity: Any = 0.4) -> MovingEdge:
    """Return a half plane to the left of an edge that moves to the right while the shutter is open.

    Parameters
    ----------
    offset : float, position of the edge when the shutter opens, at time 0
    velocity : float or None
        Distance until the shutter closes, at time 1, in widths of the image; negative to the left. None is
        still: the scene then does not need time.

    Examples
    --------
    >>> scene = moving_edge(offset=0.25, velocity=0.5)
    >>> scene(jnp.array([[0.5, 0.5, 0.25], [0.5, 0.5, 0.75]])), scene.needs
    (Array([0., 1.], dtype=float32), ('x', 'y', 'time'))
    """
    return MovingEdge(numbers("offset", offset), None if velocity is None else numbers("velocity", velocity))

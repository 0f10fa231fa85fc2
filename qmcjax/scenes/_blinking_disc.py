"""A disc that is visible for a part of the time."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.parameters import cast, numbers, positive, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, in_float64
from qmcjax.scenes._circle_area import disc_in_boxes
from qmcjax.scenes._constancy import disc_sides


@frozen_pytree
class BlinkingDisc(ExactScene):
    """A disc, 1 inside, visible for ``on[0] <= time < on[1]``."""

    centre: Any
    """Shape (2,)."""
    radius: Any

    on: Any
    """When it appears and disappears, shape (2,); None is always visible and does not need time."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; time only if the disc appears or disappears."""
        return ("x", "y") if self.on is None else ("x", "y", "time")

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        x, y = point[..., 0] - scene.centre[0], point[..., 1] - scene.centre[1]
        inside = x * x + y * y < scene.radius * scene.radius
        if scene.on is not None:
            time = point[..., 2]
            inside &= (scene.on[0] <= time) & (time < scene.on[1])
        return inside.astype(point.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel: a part of the time, times a part of the pixel."""
        scene = in_float64(self)
        x, y = np.arange(width + 1) / width, (np.arange(height + 1) / height)[:, None]
        areas = disc_in_boxes(scene.centre[0], scene.centre[1], scene.radius, x[:-1], x[1:], y[:-1], y[1:])
        share = 1.0 if scene.on is None else scene.on[1] - scene.on[0]
        size = 1 + abs(scene.centre).max() + float(scene.radius)
        return share * (width * height) * areas, 8 * EPS * size * max(width, height)

    def varies(self, low: Array, high: Array) -> Array:
        scene = cast(self, low.dtype)
        outside, inside = disc_sides(low, high, scene.centre, scene.radius)
        if scene.on is None:
            met = ~outside & ~inside
            return jnp.stack([met, met], axis=-1)
        first, last = low[..., 2], high[..., 2]
        seen = (first < scene.on[1]) & (last >= scene.on[0])
        always = (first >= scene.on[0]) & (last < scene.on[1])
        met = seen & ~outside & ~inside
        return jnp.stack([met, met, seen & ~always & ~outside], axis=-1)


def blinking_disc(centre: Any = (0.5, 0.45), radius: Any = 0.3, on: Any = (0.25, 0.75)) -> BlinkingDisc:
    """Return a disc that is visible for a part of the time that the shutter is open.

    Parameters
    ----------
    centre : float array, shape (2,)
    radius : float, positive
    on : float array, shape (2,), or None
        When the disc appears and disappears, ``0 <= on[0] < on[1] <= 1``. None is always visible: the scene
        then does not need time.

    Examples
    --------
    >>> blinking_disc(centre=(0.5, 0.5), on=(0.0, 0.5))(jnp.array([[0.5, 0.5, 0.4], [0.5, 0.5, 0.6]]))
    Array([1., 0.], dtype=float32)
    """
    centre, radius = numbers("centre", centre, (2,)), positive("radius", radius)
    if on is not None:
        on = numbers("on", on, (2,))
        require("on", on, lambda on: 0 <= on[0] < on[1] <= 1, "0 <= on[0] < on[1] <= 1")
    return BlinkingDisc(centre, radius, on)

"""The shadow of a half plane lit by a rectangle."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import ExactScene, cast_edges, in_float64
from qmcjax.scenes._blurred_edge import smeared_by_box
from qmcjax.scenes._constancy import linear, sign_varies


@frozen_pytree
class SoftShadow(ExactScene):
    """The shadow of a half plane lit by a rectangle; see `soft_shadow`."""

    angle: Any

    offset: Any

    height: Any
    """The height of the half plane; that of the light is 1."""
    light: Any
    """The sides of the light, shape (2,); None is a point light."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; the light only if it has an area."""
        return ("x", "y") if self.light is None else ("x", "y", "light_u", "light_v")

    def _edge(self) -> tuple[Any, list[Any]]:
        """Return constant and slopes of the linear function that is negative in the shadow."""
        normal = [jnp.cos(self.angle), jnp.sin(self.angle)]
        middle = 0.5 * self.height * (normal[0] + normal[1])
        slopes = [(1 - self.height) * n for n in normal]
        if self.light is None:
            return middle - self.offset, slopes
        sides = [self.height * n * self.light[j] for j, n in enumerate(normal)]
        return middle - 0.5 * (sides[0] + sides[1]) - self.offset, [*slopes, *sides]

    def __call__(self, point: Array) -> Array:
        return (linear(point, *cast_edges(self, point.dtype)._edge()) >= 0).astype(point.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel: a convolution of two rectangles.

        Rays to the centre of the light pass the half plane at ``(1 - height) p``, up to a constant: a shrunk
        image, which keeps all digits where the half plane is near the light.
        """
        scene = in_float64(self)
        angle, up = float(scene.angle), float(scene.height)
        u, v = (0.0, 0.0) if scene.light is None else up * scene.light
        widths = abs(u * math.cos(angle)), abs(v * math.sin(angle))
        shadow, bound = smeared_by_box(angle, float(scene.offset), widths, width, height, 1 - up)
        return 1 - shadow, bound

    def varies(self, low: Array, high: Array) -> Array:
        constant, slopes = cast(self, low.dtype)._edge()
        met = sign_varies(low, high, constant, slopes)
        return jnp.stack([met & (slope != 0) for slope in slopes], axis=-1)


def soft_shadow(
    angle: Any = 0.4, offset: Any = 0.6, height: Any = 0.4, light: Any = (0.5, 0.3)
) -> SoftShadow:
    """Return the ground below a half plane with a rectangular light above.

    The image is the ground, seen from above. The light is parallel to it at height 1, with its centre above
    that of the image. The half plane is parallel to both at the given height and covers ``x cos(angle) + y
    sin(angle) < offset``. The value is 1 where the point ``p`` on the ground sees the point ``q`` of the
    light, that is, where ``(1 - height) p + height q`` is not in the half plane.

    Parameters
    ----------
    angle : float
        The direction from the half plane to its outside, in radians from x to y.
    offset : float
        The distance of its edge from the point above the corner (0, 0) along that direction.
    height : float
        Position of the half plane between ground and light, in (0, 1).
    light : float array, shape (2,), or None
        The sides of the light along x and y; positive. None is a point light: the scene then does not need
        the coordinates of the light.

    Examples
    --------
    >>> scene = soft_shadow(angle=0.0, offset=0.5, height=0.5, light=(0.4, 0.4))
    >>> scene(jnp.array([[0.4, 0.5, 0.9, 0.5], [0.4, 0.5, 0.1, 0.5]]))
    Array([1., 0.], dtype=float32)
    """
    height = numbers("height", height)
    require("height", height, lambda h: (h > 0) & (h < 1), "above 0 and below 1")
    if light is not None:
        checks.positive("light", light)
        light = numbers("light", light, (2,))
    return SoftShadow(numbers("angle", angle), numbers("offset", offset), height, light)

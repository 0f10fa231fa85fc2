"""A half plane out of focus."""

import math
from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import ExactScene, cast_edges, in_float64
from qmcjax.scenes._blurred_edge import smeared_by_box, smeared_by_disc
from qmcjax.scenes._constancy import linear, sign_varies


@frozen_pytree
class DefocusedEdge(ExactScene):
    """A half plane out of focus; see `defocused_edge`."""

    angle: Any

    offset: Any

    blur: Any
    """The radius of the blur disc, or half the side of the blur square, of a point; None is sharp."""
    aperture: str = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; the lens only if there is blur."""
        return ("x", "y") if self.blur is None else ("x", "y", "lens_u", "lens_v")

    def _edge(self) -> tuple[Any, list[Any]]:
        """Return constant and slopes of the linear function that is negative in the half plane."""
        return -self.offset, [jnp.cos(self.angle), jnp.sin(self.angle)]

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        constant, slopes = scene._edge()
        distance = linear(point, constant, slopes)
        if scene.blur is not None:
            u, v = point[..., 2], point[..., 3]
            if self.aperture == "square":
                across, along = 2 * u - 1, 2 * v - 1
            else:
                radius, turn = jnp.sqrt(u), 2 * math.pi * v
                across, along = radius * jnp.cos(turn), radius * jnp.sin(turn)
            distance += scene.blur * (slopes[0] * across + slopes[1] * along)
        return (distance < 0).astype(point.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel: a convolution of three shapes."""
        scene = in_float64(self)
        angle, offset = float(scene.angle), float(scene.offset)
        if scene.blur is not None and self.aperture == "disc":
            return smeared_by_disc(angle, offset, float(scene.blur), width, height)
        side = 0.0 if scene.blur is None else 2 * float(scene.blur)
        sides = abs(side * math.cos(angle)), abs(side * math.sin(angle))
        return smeared_by_box(angle, offset, sides, width, height)

    def varies(self, low: Array, high: Array) -> Array:
        scene = cast(self, low.dtype)
        constant, slopes = scene._edge()
        if scene.blur is None:
            reach, lens = 0.0, []
        elif self.aperture == "square":
            reach = scene.blur * (abs(slopes[0]) + abs(slopes[1]))
            lens = [slopes[0] != 0, slopes[1] != 0]
        else:
            reach, lens = scene.blur * jnp.sqrt(high[..., 2]), [True, True]
        met = sign_varies(low, high, constant, slopes, reach)
        return jnp.stack([met & on for on in [slopes[0] != 0, slopes[1] != 0, *lens]], axis=-1)


def defocused_edge(
    angle: Any = 0.4, offset: Any = 0.6, blur: Any = 0.15, aperture: str = "disc"
) -> DefocusedEdge:
    """Return a half plane seen by a camera that is focused at another distance.

    Through the point ``q`` of the aperture, at most 1 from its centre in each direction, the camera sees the
    point ``p + blur q``. The value is 1 where this has ``x cos(angle) + y sin(angle) < offset``.

    Parameters
    ----------
    angle : float
        The direction in which the value decreases, in radians from x to y.
    offset : float
        The distance of the edge from the corner (0, 0) along that direction.
    blur : float or None
        The radius of the blur disc, or half the side of the blur square, of a point of light; positive.
        None is in focus: the scene then does not need the lens.
    aperture : {"disc", "square"}
        The shape of the aperture. The lens coordinates are mapped to the disc by ``q = sqrt(u)
        (cos(2 pi v), sin(2 pi v))`` and to the square by ``q = (2u - 1, 2v - 1)``.

    Examples
    --------
    >>> scene = defocused_edge(angle=0.0, offset=0.5, blur=0.2)
    >>> scene(jnp.array([[0.4, 0.5, 0.81, 0.0], [0.4, 0.5, 0.81, 0.5]]))
    Array([0., 1.], dtype=float32)
    """
    checks.choice("aperture", aperture, ("disc", "square"))
    blur = None if blur is None else positive("blur", blur)
    return DefocusedEdge(numbers("angle", angle), numbers("offset", offset), blur, aperture)

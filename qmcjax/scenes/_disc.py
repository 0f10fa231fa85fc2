"""A disc."""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, in_float64
from qmcjax.scenes._circle_area import disc_in_boxes
from qmcjax.scenes._constancy import disc_sides
from qmcjax.scenes._edges import spread
from qmcjax.scenes._pixel_cuts import split


@frozen_pytree
class Disc(ExactScene):
    """A disc: 1 where the distance from ``centre`` is less than ``radius``, 0 elsewhere."""

    centre: Array | NDArray[np.float64]
    """(x, y)"""
    radius: Array | NDArray[np.float64]

    needs: ClassVar[tuple[str, ...]] = ("x", "y")

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        x, y = point[..., 0] - scene.centre[0], point[..., 1] - scene.centre[1]
        return (x * x + y * y < scene.radius * scene.radius).astype(point.dtype)

    def varies(self, low: Array, high: Array) -> Array:
        scene = cast(self, low.dtype)
        outside, inside = disc_sides(low, high, scene.centre, scene.radius)
        met = ~outside & ~inside
        return jnp.stack([met, met], axis=-1)

    def boundary(self, u: Array) -> tuple[Array, Array]:
        """Return points on the circle and the jumps there; see `qmcjax.boundary_gradient`.

        The circle is cut where it leaves the image, at eight angles at most. Its visible arcs are sampled.
        """
        scene = cast(self, u.dtype)
        x, y, radius = jax.lax.stop_gradient((scene.centre[0], scene.centre[1], scene.radius))
        borders = jnp.arange(2, dtype=u.dtype)
        beside = jnp.arccos(jnp.clip((borders - x) / radius, -1, 1))
        above = jnp.arcsin(jnp.clip((borders - y) / radius, -1, 1))
        whole = jnp.asarray([0, 2 * math.pi], u.dtype)
        cuts = jnp.concatenate([beside, -beside, above, math.pi - above])
        cuts = jnp.sort(jnp.concatenate([cuts % (2 * math.pi), whole]))
        middle = 0.5 * (cuts[:-1] + cuts[1:])
        across, down = x + radius * jnp.cos(middle), y + radius * jnp.sin(middle)
        seen = (across > 0) & (across < 1) & (down > 0) & (down < 1)
        arc, position = spread(u[..., 0], jnp.where(seen, jnp.diff(cuts), 0))
        angle = cuts[arc] + position
        point = [
            scene.centre[0] + scene.radius * jnp.cos(angle),
            scene.centre[1] + scene.radius * jnp.sin(angle),
        ]
        return jnp.stack(point, axis=-1), jnp.ones(angle.shape, u.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel: the area of a disc within rectangles.

        The bound is below 2e-12 times ``1 + |centre| + radius`` at 512 x 512, all rounding.
        """
        scene = in_float64(self)
        x, y = np.arange(width + 1) / width, (np.arange(height + 1) / height)[:, None]
        centre_x, centre_y = scene.centre
        areas = disc_in_boxes(centre_x, centre_y, scene.radius, x[:-1], x[1:], y[:-1], y[1:])
        return width * height * areas, 16 * EPS * self._scale(scene) * max(width, height)

    @staticmethod
    def _scale(scene: Any) -> float:
        return 1 + float(np.abs(scene.centre).max()) + float(scene.radius)

    def reference_gradient(self, width: int, height: int) -> tuple["Disc", float]:
        """Return the exact derivatives of the pixel means; see `Scene`.

        A moving circle sweeps the integral of its normal (cos, sin) over the arcs in a pixel, a growing one
        their length.
        """
        width, height = checks.image_size(width, height)
        scene = in_float64(self)
        radius = float(scene.radius)
        across = (np.arange(width + 1) / width - scene.centre[0]) / radius
        down = (np.arange(height + 1) / height - scene.centre[1]) / radius
        beside, above = np.arccos(np.clip(across, -1, 1)), np.arcsin(np.clip(down, -1, 1))
        cuts = np.concatenate([beside, -beside, above, math.pi - above]) % (2 * math.pi)
        # Near a border that is a tangent, angles change like the square root of distances.
        off = 4 * EPS * (1 + self._scale(scene) / radius)
        slopes = np.sqrt(np.abs(1 - np.concatenate([across, down]) ** 2))
        doubt = off / max(float(slopes.min()), math.sqrt(off))
        pieces = split(
            np.concatenate([cuts, [0, 2 * math.pi]])[None],
            lambda _, a: scene.centre + radius * np.stack([np.cos(a), np.sin(a)], axis=-1),
            width,
            height,
            doubt,
        )
        chord = 2 * radius * np.sin(0.5 * pieces.length)
        centre = [pieces.image(chord * wave(pieces.middle)) for wave in (np.cos, np.sin)]
        bound = 4 * radius * pieces.doubt * width * height
        return Disc(np.stack(centre, axis=-1), pieces.image(radius * pieces.length)), bound


def disc(centre: Any = (0.47, 0.54), radius: Array | float = 0.31) -> Disc:
    """Return a disc.

    Parameters
    ----------
    centre : array_like, shape (2,)
        (x, y); it may lie outside of the image.
    radius : float, positive, in widths of the image

    Examples
    --------
    >>> disc((0.5, 0.5), 0.25)(jnp.array([[0.5, 0.7], [0.7, 0.7]]))
    Array([1., 0.], dtype=float32)
    """
    return Disc(numbers("centre", centre, (2,)), positive("radius", radius))

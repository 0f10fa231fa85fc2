"""Discs: still, or visible for a part of the time."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, in_float64
from qmcjax.scenes._edges import disc_sides, split, spread

Floats = NDArray[np.float64]


def disc_in_boxes(
    cx: ArrayLike, cy: ArrayLike, r: ArrayLike, x0: ArrayLike, x1: ArrayLike, y0: ArrayLike, y1: ArrayLike
) -> Floats:
    """Return the areas of the discs around (cx, cy) of radius r within the boxes [x0, x1] x [y0, y1].

    All arguments broadcast; ``r > 0``, ``x0 <= x1`` and ``y0 <= y1``. Only areas within the box are
    subtracted, so the error is a few units of rounding of the coordinates times the sides of the box.
    """
    cx, cy, r, x0, x1, y0, y1 = (np.asarray(a, dtype=np.float64) for a in (cx, cy, r, x0, x1, y0, y1))
    left, right, top, bottom = x0 - cx, x1 - cx, y0 - cy, y1 - cy
    # Each quadrant is mirrored into the first one.
    across = [(np.maximum(left, 0), np.maximum(right, 0)), (np.maximum(-right, 0), np.maximum(-left, 0))]
    along = [(np.maximum(top, 0), np.maximum(bottom, 0)), (np.maximum(-bottom, 0), np.maximum(-top, 0))]
    return np.asarray(sum(_quarter_in_boxes(r, *x, *y) for x in across for y in along))


def _quarter_in_boxes(r: Floats, x0: Floats, x1: Floats, y0: Floats, y1: Floats) -> Floats:
    """Return the areas of the quarter disc ``x, y >= 0`` within boxes that lie in this quadrant.

    The arc is above the box from ``x0`` to ``a``, inside it up to ``b``, and then below.
    """
    a = np.clip(_leg(r, y1), x0, x1)
    b = np.clip(_leg(r, y0), x0, x1)
    at_a, at_b = _leg(r, a), _leg(r, b)
    run = b - a
    total = at_a + at_b
    fall = run * (a + b) / np.where(total > 0, total, 1)  # at_a - at_b without cancellation
    below_chord = run * np.maximum(0.5 * total - y0, 0)
    return (a - x0) * (y1 - y0) + below_chord + arc_over_chord(r, np.hypot(run, fall))


def _leg(r: Floats, x: Floats) -> Floats:
    """Return ``sqrt(r**2 - x**2)``, and 0 beyond r."""
    return np.sqrt(np.maximum(r - x, 0) * (r + x))


_SERIES = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800)


def arc_over_chord(r: Floats, chord: Floats) -> Floats:
    """Return the area between a chord and its minor arc, with small relative error even for short chords."""
    angle = 2 * np.arcsin(np.minimum(chord / (2 * r), 1))
    squared = angle * angle
    series = np.zeros_like(squared)
    for coefficient in reversed(_SERIES):
        series = series * squared + coefficient
    difference = np.where(angle < 0.5, angle * squared * series, angle - np.sin(angle))
    return 0.5 * r * r * difference


@frozen_pytree
class Disc(ExactScene):
    """A disc: 1 where the distance from ``centre`` is less than ``radius``, 0 elsewhere."""

    centre: Array | NDArray[np.float64]
    """(x, y)"""
    radius: Array | NDArray[np.float64]

    needs = ("x", "y")

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

        The circle is cut where it leaves the image, at up to eight angles. Its visible arcs are sampled.
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
        scene = in_float64(self)
        return disc_means(scene, width, height), 16 * EPS * self._scale(scene) * max(width, height)

    @staticmethod
    def _scale(scene: Any) -> float:
        return 1 + float(np.abs(scene.centre).max()) + float(scene.radius)

    def reference_gradient(self, width: int, height: int) -> tuple["Disc", float]:
        """Return the exact derivatives of the pixel means; see `Scene`.

        A moving circle sweeps the integral of its normal (cos, sin) over the arcs in a pixel; a growing
        circle sweeps their length.
        """
        width, height = checks.image_size(width, height)
        scene = in_float64(self)
        radius = float(scene.radius)
        across = (np.arange(width + 1) / width - scene.centre[0]) / radius
        down = (np.arange(height + 1) / height - scene.centre[1]) / radius
        beside, above = np.arccos(np.clip(across, -1, 1)), np.arcsin(np.clip(down, -1, 1))
        cuts = np.concatenate([beside, -beside, above, math.pi - above]) % (2 * math.pi)
        # Near a tangent border, angles change like the square root of distances.
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


def disc_means(scene: Any, width: int, height: int) -> Floats:
    """Return the fraction of each pixel that a disc covers."""
    (cx, cy), x, y = scene.centre, np.arange(width + 1) / width, (np.arange(height + 1) / height)[:, None]
    return width * height * disc_in_boxes(cx, cy, scene.radius, x[:-1], x[1:], y[:-1], y[1:])


def disc(centre: Any = (0.47, 0.54), radius: Array | float = 0.31) -> Disc:
    """Return a disc.

    Parameters
    ----------
    centre : array_like, shape (2,)
        (x, y); it may lie outside the image.
    radius : float, positive, in widths of the image

    Examples
    --------
    >>> disc((0.5, 0.5), 0.25)(jnp.array([[0.5, 0.7], [0.7, 0.7]]))
    Array([1., 0.], dtype=float32)
    """
    return Disc(numbers("centre", centre, (2,)), positive("radius", radius))


@frozen_pytree
class BlinkingDisc(ExactScene):
    """A disc, 1 inside, visible for ``on[0] <= time < on[1]``."""

    centre: Any
    """Shape (2,)."""
    radius: Any

    on: Any
    """When it appears and disappears, shape (2,); None means always visible and does not need time."""

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
        scene = in_float64(self)
        share = 1.0 if scene.on is None else scene.on[1] - scene.on[0]
        size = 1 + abs(scene.centre).max() + float(scene.radius)
        return share * disc_means(scene, width, height), 8 * EPS * size * max(width, height)

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
    """Return a disc that is visible for a part of the shutter interval.

    Parameters
    ----------
    centre : float array, shape (2,)
    radius : float, positive
    on : float array, shape (2,), or None
        When the disc appears and disappears, ``0 <= on[0] < on[1] <= 1``. None means always visible: the
        scene then does not need time.

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

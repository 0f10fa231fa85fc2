"""A disc on a path with jumps, and its exact pixel means, in NumPy and float64.

At any time the mean is the area of the disc within the pixel. As a function of time it is analytic, except
when the circle passes a corner of the pixel or touches one of its edges; it then grows like the elapsed time
to the power 3/2. Between these times the substitution ``s**2 (3 - 2 s)`` removes these powers, and
Gauss-Legendre quadrature converges fast.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, in_float64
from qmcjax.scenes._discs import disc_in_boxes
from qmcjax.scenes._edges import disc_sides

Floats = NDArray[np.float64]

_NODES = 32
_CHUNK = 2**12
"""Number of pixels integrated at a time, to fit the cache."""


def swept_means(
    start: Floats, way: Floats, radius: float, width: int, height: int, nodes: int = _NODES
) -> tuple[Floats, float]:
    """Return the means, over time and pixels, of a disc with its centre moving from ``start`` by ``way``."""
    size = 1 + float(abs(start).max() + abs(way).max()) + radius
    bound = 5e-13 + 8 * EPS * size * max(width, height)
    x, y = np.arange(width + 1) / width, np.arange(height + 1) / height
    if not way.any():
        areas = disc_in_boxes(start[0], start[1], radius, x[:-1], x[1:], y[:-1, None], y[1:, None])
        return width * height * areas, bound

    outside, inside = _sides(start, way, radius, x, y)
    image = inside.astype(float)
    rows, columns = np.nonzero(~outside & ~inside)
    for first in range(0, len(rows), _CHUNK):
        row, column = rows[first : first + _CHUNK], columns[first : first + _CHUNK]
        box = x[column], x[column + 1], y[row], y[row + 1]
        image[row, column] = width * height * _integrals(start, way, radius, box, nodes)
    return image, bound


def _integrals(start: Floats, way: Floats, radius: float, box: tuple[Floats, ...], nodes: int) -> Floats:
    """Integrate the area within each box over time."""
    cuts = np.sort(np.stack(_kinks(start, way, radius, box), axis=1), axis=1)
    length = np.diff(cuts, axis=1)
    which, piece = np.nonzero(length > 0)
    begin, length = cuts[which, piece], length[which, piece]
    box = tuple(side[which] for side in box)
    total = np.zeros(len(which))
    node, weight = np.polynomial.legendre.leggauss(nodes)
    for s, w in zip(0.5 * (1 + node), 0.5 * weight, strict=True):
        time = begin + length * (s * s * (3 - 2 * s))
        area = disc_in_boxes(start[0] + time * way[0], start[1] + time * way[1], radius, *box)
        total += w * 6 * s * (1 - s) * length * area
    return np.bincount(which, total, minlength=len(cuts)).astype(np.float64)


def _kinks(start: Floats, way: Floats, radius: float, box: tuple[Floats, ...]) -> list[Floats]:
    """Return all times in [0, 1] at which the circle passes corners or touches the lines of the edges."""
    x0, x1, y0, y1 = box
    squared = way @ way
    times = [np.zeros_like(x0), np.ones_like(x0)]
    for x in (x0, x1):
        for y in (y0, y1):
            dx, dy = x - start[0], y - start[1]
            along = (dx * way[0] + dy * way[1]) / squared
            beside = abs(dx * way[1] - dy * way[0]) / np.sqrt(squared)
            half = np.sqrt(np.maximum(radius - beside, 0) * (radius + beside) / squared)
            times += [along - half, along + half]
    for axis, edges in enumerate(((x0, x1), (y0, y1))):
        if way[axis]:
            times += [(edge + r - start[axis]) / way[axis] for edge in edges for r in (-radius, radius)]
    return [np.clip(time, 0, 1) for time in times]


def _sides(
    start: Floats, way: Floats, radius: float, x: Floats, y: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the pixels that the disc never touches and those it always covers, conservatively by circles."""
    inside = np.ones((len(y) - 1, len(x) - 1), bool)
    for end in (start, start + way):
        dx, dy = abs(x - end[0]), abs(y - end[1])
        far = np.maximum(dx[:-1], dx[1:]) ** 2 + np.maximum(dy[:-1], dy[1:])[:, None] ** 2
        inside &= far <= radius * radius
    mx, my = 0.5 * (x[:-1] + x[1:]) - start[0], (0.5 * (y[:-1] + y[1:]) - start[1])[:, None]
    part = np.clip((mx * way[0] + my * way[1]) / (way @ way), 0, 1)
    near = np.hypot(mx - part * way[0], my - part * way[1])
    return near > radius + np.hypot(x[1] - x[0], y[1] - y[0]), inside


@frozen_pytree
class Ball(ExactScene):
    """A disc, 1 inside, that moves at constant speed along straight lines and may jump between them."""

    starts: Any
    """Position of the centre at the start of each line, shape (lines, 2)."""
    ends: Any
    """Position at the end, shape (lines, 2); None for no motion along the lines."""
    times: Any
    """Start times of all lines but the first, shape (lines - 1,)."""
    radius: Any

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; time only if the ball moves or jumps."""
        still = self.ends is None and self.times.shape[0] == 0
        return ("x", "y") if still else ("x", "y", "time")

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        time = point[..., 2] if len(self.needs) > 2 else jnp.zeros_like(point[..., 0])
        cx, cy = scene._centre(0, time)
        for line in range(1, scene.starts.shape[0]):
            begun = time >= scene.times[line - 1]
            next_x, next_y = scene._centre(line, time)
            cx, cy = jnp.where(begun, next_x, cx), jnp.where(begun, next_y, cy)
        x, y = point[..., 0] - cx, point[..., 1] - cy
        return (x * x + y * y < scene.radius * scene.radius).astype(point.dtype)

    def _interval(self, line: int) -> tuple[Any, Any]:
        last = line == self.times.shape[0]
        return (self.times[line - 1] if line else 0.0), (1.0 if last else self.times[line])

    def _centre(self, line: int, time: Array) -> tuple[Any, Any]:
        start = self.starts[line]
        if self.ends is None:
            return start[0], start[1]
        begin, end = self._interval(line)
        part = (time - begin) / (end - begin)
        way = self.ends[line] - start
        return start[0] + part * way[0], start[1] + part * way[1]

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Integrate areas over time."""
        scene = in_float64(self)
        image, bound = np.zeros((height, width)), 0.0
        for line, start in enumerate(scene.starts):
            begin, end = scene._interval(line)
            way = np.zeros(2) if scene.ends is None else scene.ends[line] - start
            means, error = swept_means(start, way, float(scene.radius), width, height)
            image += (end - begin) * means
            bound = max(bound, error)
        return image, bound

    def varies(self, low: Array, high: Array) -> Array:
        scene = cast(self, low.dtype)
        if len(self.needs) == 2:
            outside, inside = disc_sides(low, high, scene._centre(0, low[..., 0]), scene.radius)
            met = ~outside & ~inside
            return jnp.stack([met, met], axis=-1)
        first, last = low[..., 2], high[..., 2]
        nowhere = jnp.zeros(first.shape, bool)
        met, moved, covered, free = nowhere, nowhere, nowhere, nowhere
        lines = jnp.zeros(first.shape, jnp.int32)
        for line in range(scene.starts.shape[0]):
            begin, end = scene._interval(line)
            on = (last >= begin) & ((first < end) | (line == self.times.shape[0]))
            a = scene._centre(line, jnp.clip(first, begin, end))
            b = scene._centre(line, jnp.clip(last, begin, end))
            # The farthest corner from any centre between a and b is farthest from a or from b.
            inside = disc_sides(low, high, a, scene.radius)[1] & disc_sides(low, high, b, scene.radius)[1]
            outside = _beside(low, high, a, b, scene.radius)
            touched = on & ~inside & ~outside
            met |= touched
            if scene.ends is not None:
                moved |= touched & jnp.any(scene.ends[line] != scene.starts[line])
            covered |= on & ~outside
            free |= on & ~inside
            lines += on.astype(jnp.int32)
        varied = moved | (covered & free & (lines > 1))
        return jnp.stack([met, met, varied], axis=-1)


def _beside(low: Array, high: Array, a: tuple[Array, Array], b: tuple[Array, Array], radius: Array) -> Array:
    """Return the boxes that a disc certainly does not touch while its centre moves from ``a`` to ``b``.

    Boxes are replaced by their circumscribed discs.
    """
    mx, my = 0.5 * (low[..., 0] + high[..., 0]) - a[0], 0.5 * (low[..., 1] + high[..., 1]) - a[1]
    wx, wy = b[0] - a[0], b[1] - a[1]
    squared = wx * wx + wy * wy
    part = jnp.clip((mx * wx + my * wy) / jnp.where(squared > 0, squared, 1), 0, 1)
    x, y = mx - part * wx, my - part * wy
    hx, hy = 0.5 * (high[..., 0] - low[..., 0]), 0.5 * (high[..., 1] - low[..., 1])
    size = 1 + abs(a[0]) + abs(a[1]) + abs(b[0]) + abs(b[1]) + radius
    reach = radius + jnp.sqrt(hx * hx + hy * hy) + 16 * jnp.finfo(low.dtype).eps * size
    return x * x + y * y > reach * reach


def ball(
    starts: Any = ((0.2, 0.25), (0.75, 0.7)),
    ends: Any = ((0.5, 0.35), (0.4, 0.6)),
    times: Any = (0.5,),
    radius: Any = 0.15,
) -> Ball:
    """Return a disc that moves at constant speed along straight lines, with jumps between them.

    Parameters
    ----------
    starts : float array, shape (lines, 2)
        Position of the centre at the start of each line; 1 to 64 lines.
    ends : float array, shape (lines, 2), or None
        Position at the end of each line. None for no motion along the lines: with a single line the scene
        then does not need time.
    times : float array, shape (lines - 1,)
        Start times of all lines but the first, increasing between 0 and 1.
    radius : float, positive

    Examples
    --------
    >>> ball()(jnp.array([[0.2, 0.25, 0.0], [0.2, 0.25, 0.6], [0.7, 0.7, 0.6]]))
    Array([1., 0., 1.], dtype=float32)
    """
    starts = numbers("starts", starts, (None, 2))
    lines = checks.integer("the number of starts", starts.shape[0], 1, 64)
    if ends is not None:
        ends = numbers("ends", ends, (lines, 2))
    times = numbers("times", times, (lines - 1,))
    require("times", times, lambda t: np.diff(t, prepend=0, append=1) > 0, "increasing between 0 and 1")
    return Ball(starts, ends, times, positive("radius", radius))

"""Images of intervals of the shutter, predicted from others and corrected by samples (thesis, Sect. 3.3.4).

Pixels store the nearest hit of their samples and move with it; triangles between them are drawn. Colours of
the predictions from both sides are averaged; all other data of a pixel (x, y) are those of the first one if
x xor y is even, else those of the second. A few samples then detect where the prediction failed.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from figures.shared.rendered import scene_images
from qmcjax import tracing
from qmcjax.core import draws
from qmcjax.core.bits import below_one
from qmcjax.core.parameters import cast
from qmcjax.core.pytrees import jit
from qmcjax.tracing.search.intersection import frames, in_dtype, intersect


class Drawn(NamedTuple):
    """The triangle in front in each pixel, arrays of shape (height, width, ...)."""

    covered: NDArray[np.bool_]
    """Whether there is one."""
    vertices: NDArray[np.intp]
    """(..., 3): its vertices, as pixel numbers in row-major order."""
    weights: NDArray[np.float64]
    """(..., 3): their barycentric weights, which sum to 1."""


def triangles_between(height: int, width: int) -> NDArray[np.intp]:
    """Return the corners of all triangles, (n, 3), as pixel numbers."""
    pixel = np.arange(height * width).reshape(height, width)
    a, b, c, d = pixel[:-1, :-1], pixel[:-1, 1:], pixel[1:, :-1], pixel[1:, 1:]
    return np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, c, b), (d, b, c))])


def draw_triangles(x: NDArray, y: NDArray, depth: NDArray, seen: NDArray[np.bool_]) -> Drawn:
    """Draw the triangles whose vertices are all seen: those in front, of the smallest depth (Fig. 3.6).

    Arguments have shape (height, width). Positions are in pixels: the centre of pixel (i, j) is (i, j). All
    pairs of a triangle and a pixel of its bounding box are tested at once.
    """
    height, width = x.shape
    corners = triangles_between(height, width)
    corners = corners[seen.ravel()[corners].all(axis=1)]
    at_x, at_y = x.ravel().astype(np.float64)[corners], y.ravel().astype(np.float64)[corners]
    # Boxes in whole pixels, clipped to the image.
    left = np.clip(np.ceil(at_x.min(axis=1)), 0, width).astype(np.intp)
    right = np.clip(np.floor(at_x.max(axis=1)), -1, width - 1).astype(np.intp)
    top = np.clip(np.ceil(at_y.min(axis=1)), 0, height).astype(np.intp)
    bottom = np.clip(np.floor(at_y.max(axis=1)), -1, height - 1).astype(np.intp)
    columns, rows = np.maximum(right - left + 1, 0), np.maximum(bottom - top + 1, 0)
    triangle = np.repeat(np.arange(len(corners)), columns * rows)
    within = np.arange(len(triangle)) - np.repeat(np.cumsum(columns * rows) - columns * rows, columns * rows)
    row, column = np.divmod(within, np.maximum(columns, 1)[triangle])
    column, row = left[triangle] + column, top[triangle] + row
    dx, dy = at_x[triangle] - column[:, None], at_y[triangle] - row[:, None]
    (dx_1, dx_2), (dy_1, dy_2) = ([np.roll(d, -k, axis=1) for k in (1, 2)] for d in (dx, dy))
    areas = dx_1 * dy_2 - dx_2 * dy_1
    total = areas.sum(axis=1)
    # Back faces too: rotation may show the other side.
    inside = (total != 0) & ((areas >= 0).all(axis=1) | (areas <= 0).all(axis=1))
    triangle, weights = triangle[inside], areas[inside] / total[inside, None]
    place = row[inside] * width + column[inside]
    near = np.sum(weights * depth.ravel().astype(np.float64)[corners[triangle]], axis=1)
    order = np.lexsort((near, place))
    place, first = np.unique(place[order], return_index=True)
    front = order[first]
    covered = np.zeros(height * width, bool)
    vertices, parts = np.zeros((height * width, 3), np.intp), np.zeros((height * width, 3))
    covered[place], vertices[place], parts[place] = True, corners[triangle[front]], weights[front]
    shape = height, width
    return Drawn(covered.reshape(shape), vertices.reshape(*shape, 3), parts.reshape(*shape, 3))


FAR = 1e30
"""The depth of pixels without a hit."""

ROWS = 2**14
"""Samples taken together, for one program that serves all numbers of pixels and samples."""


class Step(NamedTuple):
    """One prediction: of the interval half-way between two others, by their numbers."""

    left: int
    middle: int
    right: int
    level: int
    """From 1, the first level."""


class Predicted(NamedTuple):
    """The image of a shutter and of its intervals."""

    image: NDArray[np.float32]
    """(height, width, 3): the mean of all images."""
    images: NDArray[np.float32]
    """(n, height, width, 3): one image per interval, in order."""
    samples: NDArray[np.int32]
    """(n, height, width): samples per pixel; pixels with fewer than ``fail`` are predicted."""
    steps: tuple[Step, ...]


def predict(
    scene: tracing.DirectLight, side: int, samples: tuple[int, ...], fail: int, key: int, contrast: float
) -> Predicted:
    """Render a shutter of 2^m + 1 intervals, and predict most of their images.

    ``samples`` of each pixel check the predictions of each level: p fails if abs(p - e) > contrast (p + e) in
    a colour, with the mean e of the samples. A pixel without a prediction gets ``fail`` samples.
    """
    count = side * side
    render = Renderer(scene, side, 2 ** len(samples) + 1, jax.random.key(key, impl="threefry2x32"))
    steps = recursion(len(samples))
    known = {end: render.sample(end, np.arange(count), fail, 0) for end in (0, render.intervals - 1)}
    taken = {end: np.full(count, fail, np.int32) for end in known}
    for step in steps:
        predicted, covered = render.predict(known[step.left], known[step.right], step)
        known[step.middle], taken[step.middle] = render.correct(
            predicted, covered, step, samples[step.level - 1], fail, contrast
        )
    images = np.stack([known[k].color.reshape(side, side, 3) for k in range(render.intervals)])
    of_all = np.stack([taken[k].reshape(side, side) for k in range(render.intervals)])
    return Predicted(images.mean(axis=0, dtype=np.float64).astype(np.float32), images, of_all, steps)


def recursion(levels: int) -> tuple[Step, ...]:
    """Return all predictions of 2^levels + 1 intervals, level by level (thesis, Fig. 3.3)."""
    steps = []
    for level in range(1, levels + 1):
        apart = 2 ** (levels - level + 1)
        for left in range(0, 2**levels, apart):
            steps.append(Step(left, left + apart // 2, left + apart, level))
    return tuple(steps)


class DeepImage(NamedTuple):
    """A deep framebuffer, arrays with one row per pixel: the nearest hit of all samples of the pixel."""

    color: Any
    """(n, 3): the mean of the samples."""
    distance: Any
    """inf without a hit."""
    inside: Any
    """(n, 3): the point in object space; the direction of the ray without a hit."""
    time: Any
    number: Any
    """Of the primitive; -1 without a hit."""


class Renderer(NamedTuple):
    """The data shared by all images."""

    scene: tracing.DirectLight
    side: int
    intervals: int
    key: Array

    def sample(self, interval: int, pixels: NDArray[np.intp], count: int, first: int) -> DeepImage:
        """Return some pixels by random samples of an interval; samples are numbered from a given one."""
        rows = np.repeat(pixels, count)
        block = min(ROWS, 1 << (self.side**2 - 1).bit_length())
        key = jax.random.fold_in(jax.random.fold_in(self.key, interval), first)
        size = jnp.asarray([self.side, self.side, self.intervals], jnp.float32)
        parts = []
        for number, start in enumerate(range(0, len(rows), block)):
            some = rows[start : start + block]
            wide = np.resize(some, block)
            place = np.stack([wide % self.side, wide // self.side, np.full_like(wide, interval)])
            drawn = jax.random.fold_in(key, number)
            points = _points(jnp.asarray(place.astype(np.float32)), size, drawn, self.scene.needs)
            of_rows = points, *what_is_hit(self.scene, points)
            parts.append([np.asarray(a)[: len(some)] for a in of_rows])
        points, *hits = (np.concatenate(column) for column in zip(*parts, strict=True))
        whole = DeepImage(scene_images.evaluate(self.scene, points), *hits)
        nearest = count * np.arange(len(pixels)) + whole.distance.reshape(-1, count).argmin(axis=1)
        color = whole.color.reshape(-1, count, 3).mean(axis=1).astype(np.float32)
        return DeepImage(*(a[nearest] for a in whole))._replace(color=color)

    def predict(self, left: DeepImage, right: DeepImage, step: Step) -> tuple[DeepImage, NDArray[np.bool_]]:
        """Predict the image between two others, and return which pixels are predicted."""
        (one, sees), (other, also) = (
            self._move(deep, step.middle - start) for deep, start in ((left, step.left), (right, step.right))
        )
        y, x = np.divmod(np.arange(len(sees)), self.side)
        result = _merge(np.where(sees & also, ((x ^ y) & 1).astype(bool), also), other, one)
        mean = np.where((sees & also)[:, None], 0.5 * (one.color + other.color), result.color)
        return result._replace(color=mean), sees | also

    def correct(
        self,
        predicted: DeepImage,
        covered: NDArray[np.bool_],
        step: Step,
        count: int,
        fail: int,
        contrast: float,
    ) -> tuple[DeepImage, NDArray[np.int32]]:
        """Sample the pixels where prediction fails, and return how many samples each pixel took."""
        taken, bad, checked = np.full(len(covered), count, np.int32), ~covered, None
        if count:
            checked = self.sample(step.middle, np.arange(len(covered)), count, 0)
            apart, total = abs(checked.color - predicted.color), checked.color + predicted.color
            bad = bad | (apart > contrast * total).any(axis=1)
        pixels = np.flatnonzero(bad)
        if not len(pixels):
            return predicted, taken
        taken[pixels], more = fail, fail - count
        new = self.sample(step.middle, pixels, more, 1)
        if checked is not None:
            first = DeepImage(*(a[pixels] for a in checked))
            color = (count * first.color + more * new.color) / np.float32(fail)
            new = _merge(new.distance < first.distance, new, first)._replace(color=color)
        for mine, other in zip(predicted, new, strict=True):
            mine[pixels] = other
        return predicted, taken

    def _move(self, deep: DeepImage, intervals: int) -> tuple[DeepImage, NDArray[np.bool_]]:
        """Return an image moved by so many intervals, and the pixels that are covered.

        A pixel moves from its centre by the displacement of the stored point on the screen. Moving the stored
        points themselves, which lie anywhere in their pixels, would blur still objects.
        """
        opened, closed = np.asarray(self.scene.camera.shutter, np.float64)
        later = (deep.time + intervals * (closed - opened) / self.intervals).astype(np.float32)
        then, now = (
            [np.asarray(a) for a in _project(self.scene, deep.inside, deep.number, time)]
            for time in (deep.time, later)
        )
        y, x = np.divmod(np.arange(len(later)), self.side)
        x, y = x + (now[0] - then[0]) * self.side, y + (now[1] - then[1]) * self.side
        given = x, y, np.where(deep.number < 0, FAR, now[2]), (now[2] > 0) & (then[2] > 0)
        drawn = draw_triangles(*(a.reshape(self.side, self.side) for a in given))
        vertices, weights = drawn.vertices.reshape(-1, 3), drawn.weights.reshape(-1, 3)
        nearest = np.take_along_axis(vertices, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
        color = np.sum(weights[:, :, None] * deep.color[vertices], axis=1).astype(np.float32)
        moved = DeepImage(color, now[2][nearest], deep.inside[nearest], later[nearest], deep.number[nearest])
        return moved, drawn.covered.ravel()


def _merge(which: NDArray[np.bool_], one: DeepImage, other: DeepImage) -> DeepImage:
    return DeepImage(
        *(np.where(which.reshape(-1, *(1,) * (a.ndim - 1)), a, b) for a, b in zip(one, other, strict=True))
    )


@jit("needs")
def _points(place: Array, size: Array, key: Array, needs: tuple[str, ...]) -> Array:
    """Return random points at the given (x, y, interval), shape (3, n)."""
    points = draws.uniform(key, (place.shape[1], len(needs)), place.dtype)
    for j, name in enumerate(("x", "y", "time")):
        column = needs.index(name)
        moved = (place[j] + points[:, column]) / size[j]
        points = points.at[:, column].set(jnp.minimum(moved, below_one(moved.dtype)))
    return points


@jit()
def what_is_hit(scene: tracing.DirectLight, points: Array) -> tuple[Array, ...]:
    """Return what the rays of points hit, as in a `DeepImage` after the colours.

    The scene has a program of its own, which other images of it share.
    """
    x, y, time = (points[:, scene.needs.index(name)] for name in ("x", "y", "time"))
    time = scene.camera.times(time)
    sight = scene.camera.rays(x, y, time, ())
    at = intersect(in_dtype(scene.world, points.dtype), sight.origin, sight.direction, time)
    inside = jax.tree.map(partial(jnp.where, at.valid), at.inside, sight.direction)
    distance = jnp.where(at.valid, at.distance, jnp.inf)
    return distance, jnp.stack(inside, axis=-1), time, at.number


@jit()
def _project(
    scene: tracing.DirectLight, inside: Array, number: Array, time: Array
) -> tuple[Array, Array, Array]:
    """Return the screen positions of stored points at some times, and their depths."""
    point, hit = (inside[:, 0], inside[:, 1], inside[:, 2]), number >= 0
    frame = frames(in_dtype(scene.world, time.dtype), number, time)
    if frame is not None:
        moved = jax.tree.map(jnp.add, frame.outside(point), frame.translation)
        point = jax.tree.map(partial(jnp.where, hit), moved, point)
    return project(scene.camera, point, hit.astype(time.dtype), time)


def project(camera: tracing.Camera, point: Any, weight: Array, time: Array) -> tuple[Array, Array, Array]:
    """Return the screen positions of points at some times, and depths along the view, positive in front.

    Points of weight 0 are directions (points at infinity).
    """
    half = jnp.full_like(time, 0.5)
    view = camera.view(half, half)
    frame = tracing.Object((), camera.motion, None).frame(time)
    if frame is not None:
        point = frame.inside(jax.tree.map(lambda p, t: p - weight * t, point, frame.translation))
    seen = jax.tree.map(lambda p, t: p - weight * t, point, view.origin)
    depth = _dot(seen, view.seen)
    safe = jnp.where(depth == 0, 1, depth)
    number = cast({"fov": camera.fov, "aspect": camera.aspect}, time.dtype)
    above = jnp.tan(number["fov"] * (np.pi / 360))
    x = _dot(seen, view.right) / (safe * above * number["aspect"])
    y = _dot(seen, view.upward) / (safe * above)
    return 0.5 * (1 + x), 0.5 * (1 - y), depth


def _dot(a: Any, b: Any) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

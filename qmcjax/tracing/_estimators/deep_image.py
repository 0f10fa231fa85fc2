"""Deep framebuffers: sampled, predicted from two others, and corrected (thesis, Sect. 3.3.4, Fig. 3.6)."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import draws
from qmcjax.core.bits import below_one
from qmcjax.core.pytrees import jit
from qmcjax.tracing._estimators.estimator import Estimator
from qmcjax.tracing._shapes.vectors import components, plus, stacked, where
from qmcjax.tracing.search.intersection import frames, in_dtype, intersect
from qmcjax.tracing.search.rasterization import rasterize

_FAR = 1e30
"""The depth of pixels without a hit."""

_ROWS = 2**14
"""Samples taken together, for one program that serves all numbers of pixels and samples."""


class Step(NamedTuple):
    """One prediction: of the interval half-way between two others, by their numbers."""

    left: int
    middle: int
    right: int
    level: int
    """From 1, the first level."""


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

    scene: Estimator
    width: int
    height: int
    intervals: int
    """Number of intervals."""
    key: Array

    def sample(self, interval: int, pixels: NDArray[np.intp], count: int, first: int) -> DeepImage:
        """Return some pixels by random samples of an interval; samples are numbered from a given one."""
        rows = np.repeat(pixels, count)
        block = min(_ROWS, 1 << (self.width * self.height - 1).bit_length())
        key = jax.random.fold_in(jax.random.fold_in(self.key, interval), first)
        size = jnp.asarray([self.width, self.height, self.intervals], jnp.float32)
        parts = []
        for number, start in enumerate(range(0, len(rows), block)):
            some = rows[start : start + block]
            wide = np.resize(some, block)
            place = np.stack([wide % self.width, wide // self.width, np.full_like(wide, interval)])
            of_rows = _sample_rows(
                self.scene, jnp.asarray(place.astype(np.float32)), size, jax.random.fold_in(key, number)
            )
            parts.append([np.asarray(a)[: len(some)] for a in of_rows])
        whole = DeepImage(*(np.concatenate(column) for column in zip(*parts, strict=True)))
        nearest = count * np.arange(len(pixels)) + whole.distance.reshape(-1, count).argmin(axis=1)
        color = whole.color.reshape(-1, count, 3).mean(axis=1, dtype=np.float64).astype(np.float32)
        return DeepImage(*(a[nearest] for a in whole))._replace(color=color)

    def predict(self, left: DeepImage, right: DeepImage, step: Step) -> tuple[DeepImage, NDArray[np.bool_]]:
        """Predict the image between two others, and return which pixels are predicted."""
        (one, sees), (other, also) = (
            self._move(deep, step.middle - start) for deep, start in ((left, step.left), (right, step.right))
        )
        y, x = np.divmod(np.arange(len(sees)), self.width)
        second = np.where(sees & also, ((x ^ y) & 1).astype(bool), also)
        result = _merge(second, other, one)
        both = (sees & also)[:, None]
        return result._replace(
            color=np.where(both, 0.5 * (one.color + other.color), result.color)
        ), sees | also

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
        taken = np.full(len(covered), count, np.int32)
        bad = ~covered
        checked = self.sample(step.middle, np.arange(len(covered)), count, 0) if count else None
        if checked is not None:
            apart, total = abs(checked.color - predicted.color), checked.color + predicted.color
            bad = bad | (apart > contrast * total).any(axis=1)
        pixels = np.flatnonzero(bad)
        if not len(pixels):
            return predicted, taken
        taken[pixels] = fail
        parts = [] if checked is None else [(count, DeepImage(*(a[pixels] for a in checked)))]
        if fail > count:
            parts.append((fail - count, self.sample(step.middle, pixels, fail - count, 1)))
        whole = parts[0][1]
        if len(parts) == 2:
            (n, one), (m, other) = parts
            nearer = other.distance < one.distance
            color = (n * one.color + m * other.color) / np.float32(n + m)
            whole = _merge(nearer, other, one)._replace(color=color)
        for mine, new in zip(predicted, whole, strict=True):
            mine[pixels] = new
        return predicted, taken

    def _move(self, deep: DeepImage, intervals: int) -> tuple[DeepImage, NDArray[np.bool_]]:
        """Return an image moved by so many intervals, and the pixels that are covered."""
        camera = self.scene.camera
        opened, closed = (0.0, 0.0) if camera.still else np.asarray(camera.shutter, np.float64)
        later = (deep.time + intervals * (closed - opened) / self.intervals).astype(np.float32)
        then, now = (
            [np.asarray(a) for a in _project(self.scene, deep.inside, deep.number, time)]
            for time in (deep.time, later)
        )
        y, x = np.divmod(np.arange(len(later)), self.width)
        x, y = x + (now[0] - then[0]) * self.width, y + (now[1] - then[1]) * self.height
        depth = np.where(deep.number < 0, _FAR, now[2])
        shape = self.height, self.width
        drawn = rasterize(*(a.reshape(shape) for a in (x, y, depth, (now[2] > 0) & (then[2] > 0))))
        vertices, weights = drawn.vertices.reshape(-1, 3), drawn.weights.reshape(-1, 3)
        nearest = np.take_along_axis(vertices, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
        color = np.sum(weights[:, :, None] * deep.color[vertices], axis=1).astype(np.float32)
        moved = DeepImage(color, now[2][nearest], deep.inside[nearest], later[nearest], deep.number[nearest])
        return moved, drawn.covered.ravel()


def _merge(which: NDArray[np.bool_], one: DeepImage, other: DeepImage) -> DeepImage:
    return DeepImage(
        *(np.where(which.reshape(-1, *(1,) * (a.ndim - 1)), a, b) for a, b in zip(one, other, strict=True))
    )


@jit()
def _sample_rows(scene: Estimator, place: Array, size: Array, key: Array) -> DeepImage:
    """Return one random sample per row at the given (x, y, interval), shape (3, n)."""
    needs = scene.needs
    points = draws.uniform(key, (place.shape[1], len(needs)), place.dtype)
    column = {name: j for j, name in enumerate(needs)}
    for j, name in enumerate(("x", "y", "time")):
        if name in column:
            moved = (place[j] + points[:, column[name]]) / size[j]
            points = points.at[:, column[name]].set(jnp.minimum(moved, below_one(moved.dtype)))
    world = in_dtype(scene.world, points.dtype)
    x, y = (points[:, column[name]] for name in "xy")
    time = scene.camera.times(points[:, column["time"]] if "time" in column else jnp.zeros_like(x))
    sight = scene.camera.rays(x, y, time, ())
    at = intersect(world, sight.origin, sight.direction, time)
    inside = where(at.valid, at.inside, sight.direction)
    distance = jnp.where(at.valid, at.distance, jnp.inf)
    return DeepImage(scene(points), distance, stacked(inside), time, at.number)


@jit()
def _project(scene: Estimator, inside: Array, number: Array, time: Array) -> tuple[Array, Array, Array]:
    """Return the screen positions of stored points at some times, and their depths."""
    local, hit = components(inside), number >= 0
    frame = frames(in_dtype(scene.world, time.dtype), number, time)
    point = local
    if frame is not None:
        point = plus(frame.outside(local), frame.translation)
        point = where(hit, point, local)
    return scene.camera.projected(point, hit.astype(time.dtype), time)

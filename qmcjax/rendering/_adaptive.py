"""Adaptive images: no unnecessary samples."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from numpy.typing import NDArray

from qmcjax.core import backends, checks, devices
from qmcjax.core.pytrees import jit
from qmcjax.rendering import _accumulation
from qmcjax.rendering._render import render_task
from qmcjax.rendering._task import Task, in_one_pass, refuse

Group = tuple[tuple[int, ...], NDArray[np.intp]]
"""Coordinates, and the pixels in which exactly these vary."""


class AdaptiveImage(NamedTuple):
    """An image and its sample counts."""

    image: Array
    """Shape (height, width) or (height, width, 3)."""
    counts: NDArray[np.uint32]
    """Shape (height, width): samples taken in each pixel."""
    saving: float
    """Fraction saved of all width * height * spp samples."""


def skip_constant(task: Task, mesh: Mesh | None, progress: Callable[[float], None]) -> AdaptiveImage:
    """Take one sample where the scene is constant; elsewhere sample only the coordinates that vary."""
    if getattr(task.scene, "varies", None) is None:
        image = render_task(task, mesh, progress, None)
        return AdaptiveImage(image, np.full(image.shape[:2], task.spp, np.uint32), 0.0)
    image, groups = plan(task)
    counts = np.ones(image.shape[:2], np.uint32)
    total, done = sum(len(pixels) for _, pixels in groups), 0
    for dims, pixels in groups:
        for part, values in means(task, dims, pixels, mesh):
            flat(image)[part] = values
            done += len(part)
            if done < total:
                progress(done / total)
        counts.ravel()[pixels] = task.spp
    progress(1.0)
    return result(task, image, counts)


def plan(task: Task) -> tuple[NDArray, list[Group]]:
    """Return the image at pixel centres, and the pixels where the scene varies."""
    scene, size = task.scene, (task.width, task.height)
    every = tuple(range(len(scene.needs)))
    with checks.precision(task.dtype):
        codes = None
        if getattr(scene, "varies", None) is not None:
            codes = np.asarray(_codes(scene, *size, task.dtype)).ravel()
        if codes is None or codes.all():
            image = np.array(_accumulation.zeros(scene, size[::-1], task.dtype)[0])
        else:
            image = np.array(_centres(scene, *size, task.dtype))
    rest = np.arange(task.width * task.height) if codes is None else np.flatnonzero(codes)
    if codes is None or task.long:
        return image, [(every, rest)]
    codes = codes[rest]
    groups = []
    while len(rest):
        code = codes[0]
        same = codes == code
        dims = tuple(j for j in every if int(code) >> _bit(j) & 1)
        groups.append((dims, rest[same]))
        rest, codes = rest[~same], codes[~same]
    return image, groups


def _bit(dim: int) -> int:
    """Return the bit of a coordinate: x and y share one, and so do all from 32 on."""
    return min(max(dim - 1, 0), 31)


@jit("width", "height", "dtype")
def _centres(scene: Any, width: int, height: int, dtype: np.dtype) -> Array:
    x, y = _accumulation.of_image(width, height)
    half = jnp.full((*x.shape, len(scene.needs)), 0.5, dtype)
    return scene(_accumulation.on_screen(half, x, y, width, height))


@jit("width", "height", "dtype")
def _codes(scene: Any, width: int, height: int, dtype: np.dtype) -> Array:
    """Return a word for each pixel whose bits mark the coordinates on which the scene depends there."""
    x, y = _accumulation.of_image(width, height)
    count = len(scene.needs)
    # Points are rounded, and so are these edges: one unit for the product, one for the reciprocal.
    margin = 4 * jnp.finfo(dtype).eps
    low, high = [], []
    for pixel, side in ((x, width), (y, height)):
        pixel, scale = pixel.astype(dtype), np.asarray(1 / side, dtype)
        low.append(pixel * (scale * (1 - margin)))
        high.append((pixel + 1) * (scale * (1 + margin)))
    rest = [jnp.full(x.shape, edge, dtype) for edge in (0, 1)]
    bits = scene.varies(
        jnp.stack([*low, *[rest[0]] * (count - 2)], axis=-1),
        jnp.stack([*high, *[rest[1]] * (count - 2)], axis=-1),
    )
    if bits.shape != (*x.shape, count) or bits.dtype != bool:
        raise ValueError(
            f"scene.varies must return bool of shape {(*x.shape, count)}, got {bits.dtype} of {bits.shape}"
        )
    codes = jnp.zeros(x.shape, jnp.uint32)
    for j in range(count):
        codes |= bits[..., j].astype(jnp.uint32) << np.uint32(_bit(j))
    return codes


def means(
    task: Task, dims: tuple[int, ...], pixels: NDArray[np.intp], mesh: Mesh | None
) -> Iterator[tuple[NDArray, NDArray]]:
    """Yield the means of all samples, one part of the pixels at a time."""
    sampler = task.sampler.up_to(task.spp)
    batch, together = in_one_pass(task.scene, sampler, task.spp, dims)
    count = devices.count(mesh)
    backend = backends.current()
    sizes = backend.listed
    if task.long:
        large, small = backend.listed_traced
        sizes = (small if task.width * task.height < 4 * large else large,)
    with checks.precision(task.dtype):
        pair = devices.place((task.scene, sampler), mesh)
        begun = []
        for part, padded in _parts(pixels, tuple(size * count for size in sizes)):
            size = len(padded) // count
            whole = together > 1 and batch * together == task.spp
            how = _accumulation.How(
                size, task.width, task.height, batch, together, whole, dims, task.dtype, mesh
            )
            arguments = devices.place((padded.reshape(count, size), np.uint32(task.spp)), mesh)
            made = _accumulation.means(pair, *arguments, how)
            begun.append((part, devices.local(made, mesh)))
        for part, values in begun:
            yield part, flat(np.asarray(values))[: len(part)]


def _parts(
    pixels: NDArray[np.intp], sizes: tuple[int, ...]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.uint32]]]:
    """Split a list into parts, each padded to one of the descending sizes."""
    start = 0
    for size in sizes:
        while len(pixels) - start >= size or (size == sizes[-1] and start < len(pixels)):
            part = pixels[start : start + size]
            yield part, np.resize(part, size).astype(np.uint32)
            start += size


def flat(image: NDArray) -> NDArray:
    return image.reshape(image.shape[0] * image.shape[1], *image.shape[2:])


def result(task: Task, image: NDArray, counts: NDArray[np.uint32]) -> AdaptiveImage:
    """Return the image with its sample counts and savings, unless a value is not finite."""
    if not np.isfinite(image).all():
        refuse(task, image)
    every = task.width * task.height * task.spp
    with checks.precision(task.dtype):
        return AdaptiveImage(jnp.asarray(image), counts, 1 - int(counts.sum(dtype=np.uint64)) / every)

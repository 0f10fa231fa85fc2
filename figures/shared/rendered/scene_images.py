"""Images of traced scenes by one compiled program per scene, whatever the sampler, size and count."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

import qmcjax as qj
from figures.making import finished_cells
from qmcjax import samplers
from qmcjax.core.checkpoints import digest
from qmcjax.core.pytrees import jit

POINTS = 2**12
"""In one call of a scene, or of a sampler that is compiled: small images have little to fill it up."""

SAMPLES = 2**14
"""In one call of a sampler, whose steps are compiled one by one, for each size."""


@jit()
def _values(scene: Any, points: Array) -> Array:
    return scene(points)


@jit("dims")
def _compiled(sampler: samplers.Sampler, x: Array, y: Array, sample: Array, dims: tuple[int, ...]) -> Array:
    return sampler(x, y, sample, dims)


def image(
    scene: Any, sampler: samplers.Sampler, side: int, spp: int, of_many: bool = False
) -> NDArray[np.float64]:
    """Return what `qmcjax.render` does, by a program that knows nothing of the sampler.

    To compile a scene takes longer than a small image of it. ``of_many`` says that there will be many images
    by the same sampler but for its key, which is then compiled, too.
    """
    y, x = np.divmod(np.arange(side**2, dtype=np.uint32), np.uint32(side))
    return at_pixels(scene, sampler, side, spp, x, y, of_many).reshape(side, side, -1)


def of_keys(scene: Any, keyed: Sequence[samplers.Sampler], side: int, spp: int) -> NDArray[np.float64]:
    """Return images, of any channels, by samplers that differ in numbers only, such as those of several keys.

    Each step of the samplers is called once for all.
    """
    for sampler in keyed:
        sampler.check(side, side, spp)
    y, x = np.divmod(np.arange(side**2, dtype=np.uint32), np.uint32(side))
    found = _means(scene, side, spp, x, y, partial(_points_of_keys, keyed))
    return found.reshape(-1, side, side, found.shape[-1])


def of_area(
    scene: Any, sampler: samplers.Sampler, side: int, spp: int, left: int, upper: int, part: int
) -> NDArray[np.float64]:
    """Return a square area of such an image: what a draft shows of it."""
    y, x = np.mgrid[upper : upper + part, left : left + part].astype(np.uint32)
    return at_pixels(scene, sampler, side, spp, x, y)


def at_pixels(
    scene: Any,
    sampler: samplers.Sampler,
    side: int,
    spp: int,
    x: NDArray[np.uint32],
    y: NDArray[np.uint32],
    of_many: bool = False,
) -> NDArray[np.float64]:
    """Return the pixels of such an image at columns ``x`` and rows ``y`` of one shape, with their colours."""
    sampler.check(side, side, spp)
    found = _means(scene, side, spp, x.ravel(), y.ravel(), partial(_points, sampler, of_many))
    return found.reshape(*x.shape, found.shape[-1])


def _means(
    scene: Any,
    side: int,
    spp: int,
    x: NDArray[np.uint32],
    y: NDArray[np.uint32],
    points_of: Callable[..., NDArray[np.float32]],
) -> NDArray[np.float64]:
    """Return means over the samples of pixels, shape (..., pixels, channels).

    ``points_of``: from columns, rows and samples, shape (pixels, samples), and dims to points.
    """
    pixels, total = np.stack([x, y], axis=-1), np.zeros(())
    together = max(1, 2**16 // x.size)
    for first in range(0, spp, together):
        samples = np.arange(first, min(first + together, spp), dtype=np.uint32)
        given = np.broadcast_arrays(pixels[:, :1], pixels[:, 1:], samples)
        points = points_of(*given, tuple(range(len(scene.needs))))
        points[..., :2] = (points[..., :2] + pixels[:, None]) / side
        total = total + _evaluate(scene, points).sum(axis=-2)
    return total / spp


def replicate(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    """Return one image of many."""
    return image(scene, sampler, side, spp, of_many=True)


def render_image(
    scene: Any, sampler: samplers.Sampler, side: int, spp: int, quality: str
) -> NDArray[np.float64]:
    """Return an image by `qmcjax.render`, in drafts by the program that all samplers share."""
    if quality == "paper":
        return np.asarray(qj.render(scene, sampler, side, side, spp), np.float64)
    return replicate(scene, sampler, side, spp)


def compare(
    scene: Any,
    side: int,
    ways: Mapping[int, Mapping[str, samplers.Sampler]],
    progress: Callable[[float], None] = lambda part: None,
) -> dict[tuple[int, str], NDArray[np.float64]]:
    """Return images by samples per pixel and name of the sampler, shared by the processes of a job."""
    cells = {
        f"{name}, {spp} spp": partial(image, scene, sampler, side, spp)
        for spp, of_count in ways.items()
        for name, sampler in of_count.items()
    }
    images = finished_cells.shared(f"images of {digest('scene', scene)[0]}, {side}", cells, progress)
    names = [(spp, name) for spp, of_count in ways.items() for name in of_count]
    return dict(zip(names, images.values(), strict=True))


def _points(
    sampler: samplers.Sampler, of_many: bool, x: NDArray, y: NDArray, sample: NDArray, dims: tuple[int, ...]
) -> NDArray[np.float32]:
    """Return points of pixels and samples of any shape, in calls of one size."""
    made, size = (partial(_compiled, sampler), POINTS) if of_many else (sampler, SAMPLES)
    calls = (_calls(each.ravel(), size) for each in (x, y, sample))
    points = np.concatenate(
        [
            np.asarray(made(jnp.asarray(columns), jnp.asarray(rows), jnp.asarray(samples), dims))
            for columns, rows, samples in zip(*calls, strict=True)
        ]
    )
    return points[: x.size].reshape(*x.shape, len(dims))


def _points_of_keys(
    keyed: Sequence[samplers.Sampler], x: NDArray, y: NDArray, sample: NDArray, dims: tuple[int, ...]
) -> NDArray[np.float32]:
    """Return the points of each sampler, in the order of the samplers."""
    leaves = list(zip(*map(jax.tree.leaves, keyed), strict=True))
    structure = jax.tree.structure(keyed[0])
    differ = [any(not np.array_equal(of[0], leaf) for leaf in of[1:]) for of in leaves]
    stacked = [jnp.stack(of) for of, varies in zip(leaves, differ, strict=True) if varies]

    def points(x: Array, y: Array, sample: Array, varied: list[Array]) -> Array:
        rest = iter(varied)
        chosen = [next(rest) if varies else of[0] for of, varies in zip(leaves, differ, strict=True)]
        return jax.tree.unflatten(structure, chosen)(x, y, sample, dims)

    found = []
    for call in zip(*(_calls(each.ravel(), SAMPLES) for each in (x, y, sample)), strict=True):
        # Pixels and samples are no arguments of what is mapped: samplers look at their values.
        of_call = partial(points, *map(jnp.asarray, call))
        found.append(np.asarray(jax.vmap(of_call, axis_size=len(keyed))(stacked)))
    return np.concatenate(found, axis=1)[:, : x.size].reshape(len(keyed), *x.shape, len(dims))


def _calls(values: NDArray, size: int) -> NDArray:
    """Return rows of a size, the last one filled up with its last value."""
    padding = [(0, -len(values) % size)] + [(0, 0)] * (values.ndim - 1)
    return np.pad(values, padding, mode="edge").reshape(-1, size, *values.shape[1:])


def _evaluate(scene: Any, points: NDArray) -> NDArray[np.float64]:
    flat = points.reshape(-1, points.shape[-1])
    calls = _calls(flat, POINTS)
    values = np.concatenate([np.asarray(_values(scene, jnp.asarray(call)), np.float64) for call in calls])
    return values[: len(flat)].reshape(*points.shape[:-1], -1)

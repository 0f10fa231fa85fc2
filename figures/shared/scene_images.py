"""Images of traced scenes by one compiled program a scene, whatever the sampler, size and count."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

import qmcjax as qj
from figures.making import finished_cells
from qmcjax import samplers
from qmcjax.core.digests import digest
from qmcjax.core.pytrees import jit

POINTS = 2**14
"""In one call of a scene."""

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
    return at_pixels(scene, sampler, side, spp, x, y, of_many).reshape(side, side, 3)


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
    dims = tuple(range(len(scene.needs)))
    pixels = np.stack([x.ravel(), y.ravel()], axis=-1)
    total = np.zeros((x.size, 3))
    together = max(1, 2**16 // x.size)
    for first in range(0, spp, together):
        samples = np.arange(first, min(first + together, spp), dtype=np.uint32)
        columns, rows, each = np.broadcast_arrays(pixels[:, :1], pixels[:, 1:], samples)
        points = _points(sampler, columns, rows, each, dims, of_many)
        points[..., :2] = (points[..., :2] + pixels[:, None]) / side
        total += _evaluated(scene, points).sum(axis=1)
    return (total / spp).reshape(*x.shape, 3)


def replicate(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    """Return one image of many."""
    return image(scene, sampler, side, spp, of_many=True)


def rendered(scene: Any, sampler: samplers.Sampler, side: int, spp: int, quality: str) -> NDArray[np.float64]:
    """Return an image by `qmcjax.render`, in drafts by the program that all samplers share."""
    if quality == "paper":
        return np.asarray(qj.render(scene, sampler, side, side, spp), np.float64)
    return replicate(scene, sampler, side, spp)


def compared(
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
    sampler: samplers.Sampler, x: NDArray, y: NDArray, sample: NDArray, dims: tuple[int, ...], of_many: bool
) -> NDArray[np.float32]:
    """Return points of pixels and samples of any shape, in calls of one size."""
    made = partial(_compiled, sampler) if of_many else sampler
    calls = (_calls(each.ravel(), SAMPLES) for each in (x, y, sample))
    points = np.concatenate(
        [
            np.asarray(made(jnp.asarray(columns), jnp.asarray(rows), jnp.asarray(samples), dims))
            for columns, rows, samples in zip(*calls, strict=True)
        ]
    )
    return points[: x.size].reshape(*x.shape, len(dims))


def _calls(values: NDArray, size: int) -> NDArray:
    """Return rows of a size, the last one filled up with its last value."""
    padding = [(0, -len(values) % size)] + [(0, 0)] * (values.ndim - 1)
    return np.pad(values, padding, mode="edge").reshape(-1, size, *values.shape[1:])


def _evaluated(scene: Any, points: NDArray) -> NDArray[np.float64]:
    """Evaluate a scene at points of any shape, in calls of one size."""
    flat = points.reshape(-1, points.shape[-1])
    calls = _calls(flat, POINTS)
    values = np.concatenate([np.asarray(_values(scene, jnp.asarray(call)), np.float64) for call in calls])
    return values[: len(flat)].reshape(*points.shape[:-1], 3)

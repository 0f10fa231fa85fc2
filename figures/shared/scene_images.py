"""Images of traced scenes by one compiled program a scene, whatever the sampler, size and count."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from figures.making import finished_cells
from qmcjax import samplers
from qmcjax.core.digests import digest
from qmcjax.core.pytrees import jit

POINTS = 2**14
"""In one call of a scene."""


@jit()
def _values(scene: Any, points: Array) -> Array:
    return scene(points)


def image(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    """Return what `qmcjax.render` does, by a program that knows nothing of the sampler.

    To compile a scene takes longer than a small image of it.
    """
    sampler.check(side, side, spp)
    dims = tuple(range(len(scene.needs)))
    y, x = np.divmod(np.arange(side**2, dtype=np.uint32), np.uint32(side))
    columns, rows = jnp.asarray(x[:, None]), jnp.asarray(y[:, None])
    pixels = np.stack([x, y], axis=-1)
    total = np.zeros((side**2, 3))
    together = max(1, 2**16 // side**2)
    for first in range(0, spp, together):
        samples = jnp.arange(first, min(first + together, spp), dtype=jnp.uint32)
        points = np.array(sampler(columns, rows, samples, dims))
        points[..., :2] = (points[..., :2] + pixels[:, None]) / side
        total += _evaluated(scene, points).sum(axis=1)
    return (total / spp).reshape(side, side, 3)


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


def _evaluated(scene: Any, points: NDArray) -> NDArray[np.float64]:
    """Evaluate a scene at points of any shape, in calls of one size."""
    flat = points.reshape(-1, points.shape[-1])
    calls = np.pad(flat, ((0, -len(flat) % POINTS), (0, 0)), mode="edge").reshape(-1, POINTS, flat.shape[1])
    values = np.concatenate([np.asarray(_values(scene, jnp.asarray(call)), np.float64) for call in calls])
    return values[: len(flat)].reshape(*points.shape[:-1], 3)

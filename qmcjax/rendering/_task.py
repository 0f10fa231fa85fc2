"""Validated arguments of rendering, and the progress bar."""

import math
import sys
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from numpy.typing import NDArray

from qmcjax.core import backends, checkpoints, checks
from qmcjax.core.pytrees import is_traced
from qmcjax.rendering import _accumulation
from qmcjax.rendering._accumulation import Levels
from qmcjax.samplers import Sampler, as_sampler
from qmcjax.scenes import as_scene

_SEARCHED = 2**16
"""Samples of a pixel searched at a time for a non-finite value."""


class Task(NamedTuple):
    """A scene and a sampler that match each other and the image."""

    scene: Any
    sampler: Any
    width: int
    height: int
    spp: int
    dtype: np.dtype
    levels: Levels = ()
    """How samples of split dimensions share those of the others; ``spp`` counts all sub-samples."""

    @property
    def traced(self) -> bool:
        return is_traced((self.scene, self.sampler))

    @property
    def long(self) -> bool:
        """Whether compiling the scene takes longer than many samples, as for ray-traced scenes."""
        return getattr(self.scene, "unrolled", 0) == 1


def task(scene: Any, sampler: Any, width: Any, height: Any, spp: Any, dtype: Any, split: Any = None) -> Task:
    scene = as_scene("scene", scene)
    sampler = as_sampler("sampler", sampler)
    width, height = checks.image_size(width, height)
    spp = checks.integer("spp", spp, 1, checks.INDEX_LIMIT - 1)
    dtype = checks.floating(dtype)
    if hasattr(scene, "with_size"):
        scene = scene.with_size(width, height)
    if sampler.dims < len(scene.needs):
        raise ValueError(
            f"sampler must have the {len(scene.needs)} dimensions that the scene needs {scene.needs}, got "
            f"{sampler.dims}: {scene.needs[sampler.dims :]} are missing"
        )
    levels: Levels = ()
    if split is not None:
        sampler, levels, spp = _split(sampler, scene.needs, spp, split)
    sampler.check(width, height, spp)
    return Task(scene, sampler, width, height, spp, dtype, levels)


def _split(sampler: Sampler, needs: tuple[str, ...], spp: int, split: Any) -> tuple[Sampler, Levels, int]:
    """Return a sampler that is split in the named dimensions, its levels, and its samples per pixel."""
    if not isinstance(split, Mapping):
        raise TypeError(f"split must be a mapping such as {{'light': 4}}, got {checks.shown(split)}")
    levels, left = [], range(len(needs))
    for name, count in split.items():
        dims = tuple(
            j for j in left if j > 1 and isinstance(name, str) and f"{needs[j]}_".startswith(f"{name}_")
        )
        if not dims:
            raise ValueError(
                f"split must name dimensions of the scene, each once and none of the screen: {needs[2:]}, "
                f"got {checks.shown(name)}"
            )
        count = checks.integer("split", count, 1, (checks.INDEX_LIMIT - 1) // spp)
        sampler, left, spp = sampler.split(dims, count), [j for j in left if j not in dims], spp * count
        levels.append((dims, count))
    return sampler, ((tuple(left), 1), *levels), spp


def in_one_pass(
    scene: Any, sampler: Any, spp: int, dims: tuple[int, ...], levels: Levels = ()
) -> tuple[int, int]:
    """Return the number of samples that a thread evaluates, and the number of such batches along an axis.

    Their product divides ``spp``.
    """
    backend = backends.current()
    if backend.coordinates is None:
        unrolled = sampler.unrolled(dims)
    else:
        unrolled = 1 << (max(backend.coordinates // len(dims), 1).bit_length() - 1)
    own = math.gcd(spp, unrolled, getattr(scene, "unrolled", 0))
    batch = math.prod(count for _, count in levels) if levels else own
    return batch, max(k for k in range(1, backend.together + 1) if spp // batch % k == 0)


def refuse(task: Task, image: Array | NDArray) -> None:
    """Raise a ValueError that names the first sample with a point outside [0, 1) or a non-finite value."""
    with checks.precision(task.dtype):
        flat = np.asarray(image).reshape(task.width * task.height, -1)
        pixel = int(np.argmin(np.isfinite(flat).all(axis=1)))
        x, y, dims = pixel % task.width, pixel // task.width, tuple(range(len(task.scene.needs)))
        for first in range(0, task.spp, _SEARCHED):
            samples = jnp.arange(first, min(first + _SEARCHED, task.spp), dtype=jnp.uint32)
            points = task.sampler(jnp.uint32(x), jnp.uint32(y), samples, dims, task.dtype)
            outside = np.flatnonzero(~((points >= 0) & (points < 1)).all(axis=1))
            if len(outside):
                point = np.asarray(points[outside[0]]).tolist()
                raise ValueError(
                    f"sampler must return points in [0, 1), got {point} in pixel ({x}, {y}), sample "
                    f"{first + outside[0]}"
                )
            where = jnp.full(samples.shape, x, jnp.uint32), jnp.full(samples.shape, y, jnp.uint32)
            points = _accumulation.on_screen(points, *where, task.width, task.height)
            values = np.asarray(task.scene(points)).reshape(len(samples), -1)
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            if len(bad):
                raise ValueError(
                    f"scene must return finite values, got {values[bad[0]].squeeze()} in pixel ({x}, {y}), "
                    f"sample {first + bad[0]}, point {np.asarray(points[bad[0]]).tolist()}"
                )
        raise ValueError(
            f"scene must return finite values, got {flat[pixel]} as the mean of pixel ({x}, {y})"
        )


def check_progress(progress: Any, task: Task) -> None:
    """Raise unless ``progress`` is None, or a function outside ``jax.jit``."""
    checks.progress(progress)
    if progress is not None:
        _check_outside("progress", progress, task)


def open_checkpoint(
    checkpoint: Any, function: str, task: Task, mesh: Mesh | None, **made_of: Any
) -> checkpoints.File | None:
    """Return the checkpoint for a result that depends on a task and further arguments."""
    if checkpoint is None:
        return None
    _check_outside("checkpoint", checkpoint, task)
    made_of = made_of or {"sampler": task.sampler, "spp": task.spp, "split": task.levels}
    size = {"width": task.width, "height": task.height, "dtype": task.dtype.name}
    return checkpoints.begin(checkpoint, mesh, function=function, scene=task.scene, **size, **made_of)


def _check_outside(name: str, value: Any, task: Task) -> None:
    if task.traced:
        raise TypeError(
            f"{name} must be None inside jax.jit and other transformations, which run after the call, got "
            f"{checks.shown(value)}"
        )


def progress_bar(label: str = "") -> Callable[[float], None]:
    """Return a progress bar with the remaining time, for any argument ``progress``.

    It is drawn on ``sys.stderr``, only in a terminal or notebook, to keep logs of batch jobs short.

    Parameters
    ----------
    label : str
        Text before the bar.

    Returns
    -------
    callable
        A function of the finished part, in [0, 1]. The part finished at the first call, such as work from a
        checkpoint, does not count for the remaining time. After 1, or when the part decreases, a new bar
        begins.

    Examples
    --------
    >>> from qmcjax import progress_bar, render, samplers, scenes, sequences
    >>> sampler = samplers.independent(sequences.sobol(2), key=1)
    >>> image = render(scenes.disc(), sampler, 16, 16, spp=4, progress=progress_bar("disc"))
    """
    if not isinstance(label, str):
        raise TypeError(f"label must be a str, got {checks.shown(label)}")
    from tqdm import tqdm  # Imported only for a bar.

    bar: Any = None

    def report(finished: float) -> None:
        nonlocal bar
        if bar is not None and finished < bar.n:
            bar.close()
            bar = None
        if bar is None:
            seen = sys.stderr.isatty() or "ipykernel" in sys.modules
            bar = tqdm(
                desc=label or None,
                total=1.0,
                initial=finished,
                bar_format="{desc}{percentage:3.0f}%|{bar}| {elapsed}<{remaining}",
                smoothing=0,
                disable=not seen,
            )
        bar.update(finished - bar.n)
        if finished >= 1:
            bar.close()
            bar = None

    return report

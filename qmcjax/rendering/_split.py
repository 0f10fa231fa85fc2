"""Splitting by names: a scene that averages sub-samples, and a sampler of all their coordinates."""

from collections.abc import Mapping
from dataclasses import field
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.core.summation import pairwise
from qmcjax.rendering._task import Task, task
from qmcjax.samplers import Sampler

Levels = tuple[tuple[tuple[int, ...], int], ...]
"""Coordinates that are split together, and into how many: first those that are not split, 1."""


@frozen_pytree
class SplitScene:
    """The mean of a scene over sub-samples. Its coordinates are those of all sub-samples, level by level."""

    scene: Any
    levels: Levels = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        """The names of the coordinates, with the number of a sub-sample."""
        return tuple(
            self.scene.needs[j] if copies == 1 else f"{self.scene.needs[j]}[{k}]"
            for dims, copies in _copies(self.levels)
            for k in range(copies)
            for j in dims
        )

    @property
    def unrolled(self) -> int:
        """As that of the scene."""
        return getattr(self.scene, "unrolled", 0)

    def __call__(self, point: Array) -> Array:
        """Evaluate the scene, what does not depend on a split coordinate once for all its sub-samples."""
        flat, given, start = point.reshape(-1, point.shape[-1]), {}, 0
        counts: list[int] = []
        for dims, copies in _copies(self.levels):
            counts.append(copies // int(np.prod(counts, dtype=int)))
            part = flat[:, start : start + copies * len(dims)].T.reshape(*counts[1:], len(dims), -1)
            given |= {j: part[..., k, :] for k, j in enumerate(dims)}
            start += copies * len(dims)
        mean = self._mean(given, 1)
        return mean.reshape(*point.shape[:-1], *mean.shape[1:])

    def _mean(self, given: dict[int, Array], level: int) -> Array:
        """Return the mean over the sub-samples of a level and those below."""
        if level == len(self.levels):
            ordered = [given[j] for j in range(len(given))]
            separate = getattr(self.scene, "of_coordinates", None)
            if separate is None:
                return self.scene(jnp.stack(ordered, axis=-1))
            return separate(dict(zip(self.scene.needs, ordered, strict=True)))
        axes = {j: 0 for dims, _ in self.levels[level:] for j in dims}
        values = jax.vmap(partial(self._mean, level=level + 1), ({j: axes.get(j) for j in given},))(given)
        count = self.levels[level][1]
        return pairwise([values[k] for k in range(count)]) / np.asarray(count, values.dtype)


@frozen_pytree
class SubSamples(Sampler):
    """Sample s has the coordinates of all sub-samples of sample s, in the order of a :class:`SplitScene`."""

    sampler: Sampler
    """Split at each level."""
    levels: Levels = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        return sum(len(dims) * copies for dims, copies in _copies(self.levels))

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        return tuple(self.sampler.prepare(x, y, own) for own, _ in self.levels)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        parts, total = [], _copies(self.levels)[-1][1]
        for (own, copies), prepared in zip(_copies(self.levels), state, strict=True):

            def sub_sample(number: Array, own: Any = own, prepared: Any = prepared) -> Array:
                return self.sampler.points(prepared, sample * np.uint32(total) + number, own, dtype)

            numbers = np.arange(copies, dtype=np.uint32) * np.uint32(total // copies)
            made = jax.vmap(sub_sample, out_axes=-2)(jnp.asarray(numbers))
            parts.append(made.reshape(*sample.shape, copies * len(own)))
        whole = jnp.concatenate(parts, axis=-1)
        return whole if dims == tuple(range(self.dims)) else whole[..., np.array(dims)]

    def check(self, width: int, height: int, spp: int) -> None:
        self.sampler.check(width, height, spp * _copies(self.levels)[-1][1])

    def up_to(self, spp: int) -> "SubSamples":
        return SubSamples(self.sampler.up_to(spp * _copies(self.levels)[-1][1]), self.levels)


def _copies(levels: Levels) -> list[tuple[tuple[int, ...], int]]:
    """Return the coordinates of each level, and how many of each a sample has."""
    counts = np.cumprod([count for _, count in levels], dtype=object)
    return [(dims, int(count)) for (dims, _), count in zip(levels, counts, strict=True)]


def split_task(whole: Task, split: Any) -> Task:
    """Return a task in which the named dimensions of each sample have several sub-samples."""
    if not isinstance(split, Mapping):
        raise TypeError(f"split must be a mapping such as {{'light': 4}}, got {checks.shown(split)}")
    needs, sampler, levels, left = whole.scene.needs, whole.sampler, [], list(range(len(whole.scene.needs)))
    for name, count in split.items():
        dims = tuple(
            j for j in left if j > 1 and isinstance(name, str) and f"{needs[j]}_".startswith(f"{name}_")
        )
        if not dims:
            raise ValueError(
                f"split must name dimensions of the scene, each once and none of the screen: {needs[2:]}, "
                f"got {checks.shown(name)}"
            )
        count = checks.integer("split", count, 1, (checks.INDEX_LIMIT - 1) // whole.spp)
        sampler, left = sampler.split(dims, count), [j for j in left if j not in dims]
        levels.append((dims, count))
    levels = ((tuple(left), 1), *levels)
    scene = SplitScene(whole.scene, levels)
    return task(scene, SubSamples(sampler, levels), whole.width, whole.height, whole.spp, whole.dtype)

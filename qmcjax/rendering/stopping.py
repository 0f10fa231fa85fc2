"""Stopping independent passes at a tolerance."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.rendering._adaptive import AdaptiveImage, Group, flat, means, plan, result
from qmcjax.rendering._task import Task, refuse
from qmcjax.rendering._tolerances import Tolerance, missed
from qmcjax.samplers import Randomized

PILOT = 4
"""Passes before the first decision."""

_PILOT_KEY = 2**32 - 1
"""Folded into the key for the pilot. No pass has this number."""


def check_passes(sampler: Any, spp: int, unbiased: bool) -> None:
    """Raise unless a tolerance can stop passes of the sampler, up to ``spp`` samples."""
    if not isinstance(sampler, Randomized):
        raise TypeError(
            "sampler must be made by samplers.randomized for a tolerance, since errors are estimated from "
            f"independent passes, got {checks.shown(sampler)}"
        )
    least = (PILOT + unbiased) * sampler.spp
    if spp % sampler.spp or spp < least:
        raise ValueError(
            f"spp must be a multiple of the {sampler.spp} samples of a pass and at least {least} for a "
            f"tolerance, got {spp}"
        )


def pilot_of(sampler: Randomized) -> Randomized:
    """Return pilot passes, independent of those of the sampler, which decide their number."""
    return replace(sampler, key=jax.random.fold_in(sampler.key, _PILOT_KEY))


def until_tolerance(
    task: Task,
    tolerance: Tolerance | None,
    relative: float | None,
    unbiased: bool,
    mesh: Mesh | None,
    progress: Callable[[float], None],
) -> AdaptiveImage:
    """Take passes in each pixel that varies until its standard error is allowed."""
    centre, groups = plan(task)
    limit = task.spp // task.sampler.spp
    vary = np.zeros(task.width * task.height, bool)
    for _, pixels in groups:
        vary[pixels] = True

    pilot = pilot_of(task.sampler) if unbiased else task.sampler
    moments = _Moments(centre.shape, mesh)
    for number in range(PILOT):
        moments.add(task, pilot.of_pass(number), groups, vary)
        progress((number + 1) / limit)
    if not np.isfinite(moments.mean).all():
        refuse(task._replace(sampler=pilot, spp=PILOT * pilot.spp), moments.mean.reshape(centre.shape))
    if unbiased:
        needed = np.ceil(moments.passes_needed(tolerance, relative))
        passes = np.clip(needed, 1, limit - PILOT).astype(np.int64) * vary
        moments = _Moments(centre.shape, mesh)
        for number in range(int(passes.max(initial=0))):
            moments.add(task, task.sampler.of_pass(number), groups, passes > number)
            progress((PILOT + number + 1) / limit)
        passes += PILOT
    else:
        active = vary
        for number in range(PILOT, limit):
            active = active & (moments.passes_needed(tolerance, relative) > moments.count)
            if not active.any():
                break
            moments.add(task, task.sampler.of_pass(number), groups, active)
            progress((number + 1) / limit)
        passes = moments.count
    progress(1.0)
    counts = np.where(vary, passes * task.sampler.spp, 1).astype(np.uint32).reshape(centre.shape[:2])
    flat(centre)[vary] = moments.mean[vary]
    return result(task, centre, counts)


class _Moments:
    """Means of the passes of each pixel so far, and the sums of their squared deviations."""

    def __init__(self, shape: tuple[int, ...], mesh: Mesh | None) -> None:
        self.shape = shape
        self.mesh = mesh
        pixels = shape[0] * shape[1]
        self.count = np.zeros(pixels, np.int64)
        self.mean = np.zeros((pixels, *shape[2:]))
        self.squares = np.zeros_like(self.mean)

    def add(self, task: Task, sampler: Any, groups: list[Group], active: NDArray[np.bool_]) -> None:
        """Add a pass of the active pixels (B. P. Welford, 1962)."""
        one = task._replace(sampler=sampler, spp=task.sampler.spp)
        for dims, pixels in groups:
            for part, values in means(one, dims, pixels[active[pixels]], self.mesh):
                self.count[part] += 1
                deviation = values - self.mean[part]
                self.mean[part] += (deviation.T / self.count[part]).T
                self.squares[part] += deviation * (values - self.mean[part])

    def passes_needed(self, tolerance: Tolerance | None, relative: float | None) -> NDArray[np.float64]:
        """Return how many passes each pixel needs: the most of it, its eight neighbours and all channels.

        A few passes of one pixel may agree by chance if an edge cuts off a corner; all nine rarely do.
        """
        of_pass = (self.squares.T / np.maximum(self.count - 1, 1)).T
        of_mean = (of_pass.T / np.maximum(self.count, 1)).T
        given = (each.reshape(self.shape) for each in (self.mean, of_mean, of_pass))
        needed = missed(tolerance, relative, *given)
        padded = np.pad(needed.reshape(*self.shape[:2], -1).max(axis=2), 1)
        rows = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
        return np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:]).ravel()

"""Error and run time of ray-traced scenes: samplers of ours, and Mitsuba's where it has the scene."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from figures._errors import rms
from figures.shared.costs import timed
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.rendered import diffusion
from figures.shared.timing import speed_sweep
from qmcjax import samplers, scenes
from qmcjax.core.pytrees import jit

CALL = 2**14
"""Samples that the program of a scene takes in one call."""

OURS = ("random", "Owen, each pixel", "global Sobol', xor", "Hilbert, Owen", "Z", "lattice, rotated")
"""Of the samplers in :mod:`figures.shared.timing.speed_sweep`."""

MITSUBAS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")


def cases(bounces: int) -> dict[str, tuple[scenes.Traced, bool]]:
    """Return what is rendered, and whether Mitsuba has it, too.

    The interior is the only scene with several bounces, here without textures and what shines.
    """
    box = scenes.cornell_box(0.0, ball=False, mirror=False, blocks=True, light=0.5)
    room = scenes.interior(bounces)
    return {
        "Cornell box, area light": (box, True),
        "occluder": (scenes.occluder(), True),
        f"interior, {bounces} bounces": (replace(room, estimator=mitsuba_scenes.plain(room.estimator)), True),
        "Cornell box, moving": (scenes.cornell_box(), False),
        "helicopter": (scenes.helicopter(), False),
    }


def reference(scene: scenes.Traced, side: int, spp: int) -> diffusion.Reference:
    """Return the stored reference, or an estimate from so many samples per pixel."""
    return diffusion.reference(scene, side, spp, lambda *task: render_image(*task)[0])


def rows(
    scene: scenes.Traced, shared: bool, side: int, counts: tuple[int, ...], turns: int, exact: Any
) -> list[dict]:
    """Return a row for each sampler and number of samples; programs take turns, the first is not timed."""
    found: dict[tuple[str, int], list[tuple[float, float, float]]] = {}

    def add(sampler: str, spp: int, image: NDArray, seconds: float) -> None:
        of_image = seconds, diffusion.rms_error(image, exact), float(image.mean() / exact.image.mean())
        found.setdefault((sampler, spp), []).append(of_image)

    for turn in range(turns + 1):
        for spp in counts:
            for name in OURS:
                sampler = speed_sweep.SAMPLERS[name](side, spp, len(scene.needs), turn)
                add(name, spp, *render_image(scene, sampler, side, spp))
        if shared and mitsuba_scenes.installed():
            runs = [mitsuba_scenes.Run(name, spp, 1 + turn) for name in MITSUBAS for spp in counts]
            # The first image wakes its threads.
            images, seconds, taken = mitsuba_scenes.run(scene.estimator, side, side, [runs[0], *runs])
            for run, image, took, spp in zip(runs, images[1:], seconds[1:], taken[1:], strict=True):
                add(f"Mitsuba, {run.sampler}", spp, image, took)
    return [
        {
            "sampler": sampler,
            "spp": spp,
            # A count to which two are rounded up has two images in the first turn.
            "seconds": float(np.median([took for took, _, _ in of_count[len(of_count) // (turns + 1) :]])),
            "rms error": rms([error for _, error, _ in of_count]),
            "mean over the reference's": float(np.mean([mean for _, _, mean in of_count])),
        }
        for (sampler, spp), of_count in found.items()
    ]


def render_image(
    scene: Any, sampler: samplers.Sampler, side: int, spp: int
) -> tuple[NDArray[np.float64], float]:
    """Return an image and the seconds that it took, by one program for a scene's values and one for points.

    To compile one of both for each pair of them takes minutes.
    """
    sampler.check(side, side, spp)
    together = CALL // side**2
    if not together or spp % together:
        raise ValueError(f"samples must fill calls of {CALL}, got {spp} of {side} x {side} pixels")

    def image() -> NDArray[np.float64]:
        prepared = _prepared(sampler, side, len(scene.needs))
        total = jnp.zeros((side, side, 3))
        for block in range(spp // together):
            points = _points(sampler, prepared, np.uint32(block), side, together, len(scene.needs))
            total = _added(scene, points, total)
        return np.asarray(total, np.float64) / spp

    made, seconds = timed(image)
    return made, seconds.clock


@jit("side", "count")
def _prepared(sampler: Any, side: int, count: int) -> Any:
    y, x = jnp.indices((side, side), jnp.uint32)
    return sampler.prepare(x, y, tuple(range(count)))


@jit("side", "together", "count")
def _points(sampler: Any, prepared: Any, block: Array, side: int, together: int, count: int) -> Array:
    """Return points on the screen, (together, side, side, count)."""
    y, x = jnp.divmod(jnp.arange(side**2, dtype=jnp.uint32).reshape(side, side), np.uint32(side))
    blocks = jnp.broadcast_to(block, x.shape)
    points = sampler.consecutive(prepared, blocks, together, tuple(range(count)), jnp.float32)
    found = jnp.stack(points)
    screen = (found[..., :2] + jnp.stack([x, y], axis=-1).astype(jnp.float32)[None]) / side
    return jnp.concatenate([jnp.minimum(screen, np.float32(1 - 2**-24)), found[..., 2:]], axis=-1)


@jit()
def _added(scene: Any, points: Array, total: Array) -> Array:
    return total + scene(points).sum(axis=0)

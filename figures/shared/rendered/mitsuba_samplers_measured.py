"""Images by the samplers of Mitsuba 3 and by ours in it, their references, and their times."""

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.making import own_process
from figures.shared.mitsuba_runs import mitsuba_samplers_process as process
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.mitsuba_runs.mitsuba_scenes import Run
from figures.shared.rendered import diffusion

REFERENCE, REFERENCE_SPP = "multijitter", 64
KEY, REFERENCE_KEY = 1, 2**20
TIMED_SPP = 16


class Size(NamedTuple):
    """How much is measured."""

    scenes: tuple[str, ...]
    side: int
    counts: tuple[int, ...]
    samplers: tuple[str, ...]
    replicates: int
    """Of the reference."""

    timed_side: int
    turns: int
    """Images whose median is the time of a sampler, after the first."""


Images = dict[Run, NDArray]

Rates = dict[str, dict[str, list[float]]]
"""Seconds of the first image and the median of others, by variants and samplers."""


def rates_of(size: Size) -> Rates:
    """Return first and median seconds of images, by variants and modes of loops, and by samplers."""
    found: Rates = {}
    for variant in ("scalar_rgb", *(["llvm_ad_rgb"] if mitsuba_scenes.has_llvm() else [])):
        task = {
            "variant": variant,
            "samplers": size.samplers,
            "side": size.timed_side,
            "spp": TIMED_SPP,
            "turns": size.turns,
        }
        for mode, taken in own_process.measured(process, task).items():
            found[f"{variant}, {mode} loops" if mode else variant] = taken
    return found


def shown(sampler: str) -> str:
    """Return a name that says whose sampler it is."""
    return f"Mitsuba, {sampler}" if sampler in process.THEIRS else sampler


def area(scene: str, side: int) -> diffusion.Area:
    """Return the part of an image in which errors are measured."""
    return (slice(side // 4, side), slice(None)) if scene == "Cornell box" else diffusion.WHOLE


def images_of(scene: str, size: Size) -> Images:
    """Return images by a process of their own."""
    runs = [Run(REFERENCE, REFERENCE_SPP, REFERENCE_KEY + k) for k in range(size.replicates)]
    runs += [Run(name, spp, KEY) for name in size.samplers for spp in size.counts]
    with tempfile.TemporaryDirectory() as folder:
        task = {"scene": scene, "side": size.side, "runs": runs, "file": str(Path(folder, "images.npz"))}
        own_process.run(process, task=task)
        with np.load(task["file"]) as result:
            return dict(zip(runs, result["images"].astype(np.float64), strict=True))


def reference(images: Images) -> diffusion.Reference:
    """Return the mean of the replicates of the reference, and its standard error."""
    return diffusion.of_replicates([of for run, of in images.items() if run.seed >= REFERENCE_KEY], "")

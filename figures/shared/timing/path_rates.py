"""Paths per second of diffuse scenes, beside Mitsuba 3."""

from collections.abc import Callable
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

import qmcjax as qj
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.turns import timed
from qmcjax import scenes, tracing
from qmcjax.choosing import CANDIDATES

SIZES = {"draft": (16, 1, 1, 1), "paper": (128, 16, 9, 2)}
"""Side of the image, samples per pixel, turns, scenes."""

BOUNCES = 6
"""Paths have up to 8 edges."""

POINTS = {"qmcjax, Sobol'": CANDIDATES["(0,2), Owen"].make, "qmcjax, random": CANDIDATES["random"].make}


NOTE = (
    "Paths: images of {side} x {side} pixels, {spp} samples per pixel, {bounces} bounces, light sampled at "
    "each surface. Medians of turns, ours without compiling, Mitsuba's (scalar_rgb, all threads) without "
    "loading. Its points are independent, as ours are in one case; in the other, Sobol' points are scrambled "
    "in each pixel."
)


def measured(quality: str) -> tuple[dict[str, Any], str]:
    """Let both programs render in turns, and return what each scene took, and how it was measured."""
    side, spp, turns, count = SIZES[quality]
    found = {name: _measured(scene, side, spp, turns) for name, scene in islice(cases().items(), count)}
    missing = "" if mitsuba_scenes.installed() else " Mitsuba is not installed: pip install mitsuba."
    return found, NOTE.format(side=side, spp=spp, bounces=BOUNCES) + missing


def cases() -> dict[str, tracing.PathTracing]:
    """Return scenes of diffuse surfaces of one colour each."""
    box = scenes.cornell_box(0.0, ball=False, mirror=False, blocks=True, light=0.5, bounces=BOUNCES)
    interior = mitsuba_scenes.plain(scenes.interior(BOUNCES).estimator)
    return {"Cornell box": box.estimator, "interior": interior}


def _measured(scene: tracing.PathTracing, side: int, spp: int, turns: int) -> dict[str, Any]:
    paths = side * side * spp
    compiling = {name: _ours(scene, side, spp, points, 0)[1] for name, points in POINTS.items()}
    seconds: dict[str, list[float]] = {name: [] for name in POINTS}
    means: dict[str, list[float]] = {name: [] for name in POINTS}
    for turn in range(1, turns + 1):
        for name, points in POINTS.items():
            image, took = _ours(scene, side, spp, points, turn)
            seconds[name].append(took)
            means[name].append(float(image.mean()))
        if mitsuba_scenes.installed():
            # The first of two wakes its threads.
            images, both = mitsuba_scenes.rendered(scene, side, side, spp, [2 * turn, 2 * turn + 1])
            seconds.setdefault("Mitsuba", []).append(both[1])
            means.setdefault("Mitsuba", []).append(float(images.mean()))
    rates = {name: paths / float(np.median(times)) for name, times in seconds.items()}
    return {
        "primitives": scene.world.count,
        "paths per second": rates,
        "seconds of the first image": compiling,
        "mean of the images": {name: float(np.mean(values)) for name, values in means.items()},
    }


def _ours(
    scene: tracing.PathTracing, side: int, spp: int, points: Callable[..., Any], key: int
) -> tuple[NDArray[np.float32], float]:
    sampler = points(len(scene.needs), side, side, spp, key)
    image, seconds = timed(qj.render, scene, sampler, side, side, spp)
    return np.asarray(image), seconds.clock

"""Paths a second of diffuse scenes, against Mitsuba 3."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures.shared import mitsuba_scenes
from figures.shared.turns import timed
from qmcjax import scenes, tracing
from qmcjax.choosing import CANDIDATES

SIZES = {"draft": (32, 4, 2), "paper": (128, 16, 9)}
"""Side of the image, samples per pixel, turns."""

BOUNCES = 6
"""Paths have up to 8 edges."""


POINTS = {"qmcjax, Sobol'": CANDIDATES["(0,2), Owen"].make, "qmcjax, random": CANDIDATES["random"].make}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Let both programs render by turns, and draw bars."""
    side, spp, turns = SIZES[quality]
    measured = {}
    listed = cases()
    for done, (name, scene) in enumerate(listed.items(), start=1):
        measured[name] = _measured(scene, side, spp, turns)
        progress(done / len(listed))
    numbers = {
        "measured": measured,
        "note": f"{side} x {side} pixels, {spp} samples, {BOUNCES} bounces, light sampled at each surface. "
        "Medians of turns, ours not compiling, Mitsuba's (scalar_rgb, all threads) not loading. "
        "Mitsuba's points are independent, as ours are in one case; in the other, Sobol' points are "
        "scrambled in each pixel. Each ratio is that to Mitsuba's rate. "
        "Drafts are small and say little."
        + ("" if mitsuba_scenes.installed() else " Mitsuba is not installed: pip install mitsuba."),
    }
    return _drawn(measured), numbers


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
    result: dict[str, Any] = {
        "primitives": scene.world.count,
        "paths a second": rates,
        "seconds of the first image": compiling,
        "mean of the images": {name: float(np.mean(values)) for name, values in means.items()},
    }
    if "Mitsuba" in rates:
        result["ours / Mitsuba's"] = {name: rates[name] / rates["Mitsuba"] for name in POINTS}
    return result


def _ours(
    scene: tracing.PathTracing, side: int, spp: int, points: Callable[..., Any], key: int
) -> tuple[NDArray[np.float32], float]:
    sampler = points(len(scene.needs), side, side, spp, key)
    image, seconds = timed(qj.render, scene, sampler, side, side, spp)
    return np.asarray(image), seconds.clock


def _drawn(measured: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(8, 1.2 + 0.8 * len(measured)), layout="constrained")
    axes = figure.subplots()
    names = list(next(iter(measured.values()))["paths a second"])
    for k, (name, color) in enumerate(zip(names, ("C0", "C1", "0.6"), strict=False)):
        rates = [entry["paths a second"][name] for entry in measured.values()]
        axes.barh(np.arange(len(measured)) + 0.27 * k, rates, 0.27, color=color, label=name)
    axes.set_yticks(np.arange(len(measured)) + 0.135 * (len(names) - 1), list(measured))
    axes.invert_yaxis()
    axes.set(xlabel="paths a second", title=f"Paths of up to {BOUNCES + 2} edges (higher is better)")
    axes.grid(axis="x", alpha=0.3)
    figure.legend(loc="outside right center", frameon=False)
    return figure

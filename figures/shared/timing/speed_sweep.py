"""Run time and error of images by scene, sampler and spp, in a separate process.

Samplers take turns, each call with a new key, so that noise hits all; the first one of each compiles.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import qmcjax as qj
from figures._errors import rms
from figures.shared.costs import timed
from qmcjax import scenes
from qmcjax.choosing import CANDIDATES

SIZES = {"draft": (64, (4, 16), 2), "paper": (256, (1, 4, 16, 64, 256), 5)}
"""Side of the image, samples per pixel, calls after the first."""

SCENES = {
    "checkerboard": scenes.checkerboard(),
    "zone plate": scenes.zone_plate(),
    "disc": scenes.disc(),
    "Gaussian bump": scenes.gaussian(),
    "ball": scenes.ball(),
    "soft shadow": scenes.soft_shadow(),
}
DRAFTED = ("checkerboard",)

Make = Callable[[int, int, int, int], Any]
"""From side, samples per pixel, dimensions and key to a sampler."""


def _candidate(name: str) -> Make:
    make = CANDIDATES[name].make
    return lambda side, spp, dims, key: make(dims, side, side, spp, key)


SAMPLERS = {
    "random": _candidate("random"),
    "Owen, each pixel": _candidate("(0,2), Owen"),
    "global Sobol', xor": _candidate("Sobol', full screen"),
    "raster, Owen": _candidate("raster, Owen-Sobol'"),
    "Hilbert, Owen": _candidate("Hilbert, Owen-Sobol'"),
    "Hilbert, Halton": _candidate("Hilbert, Halton (2,3)"),
    "Z": _candidate("Z, hash"),
    "lattice, rotated": _candidate("rank-1 lattice"),
}
ADAPTIVE = "Hilbert, Owen"
"""Also measured where constant pixels are skipped."""


def compare(
    scene: Any, entries: Mapping[str, tuple[Make, bool]], side: int, spp: int, calls: int
) -> dict[str, tuple[list[float], list[float]]]:
    """Return seconds and RMS errors of images, the first of which compiles, pixels skipped or not."""
    exact, _ = scene.reference(side, side)
    found: dict[str, tuple[list[float], list[float]]] = {who: ([], []) for who in entries}
    for key in range(calls + 1):
        for who, (make, adaptive) in entries.items():
            sampler, render = make(side, spp, len(scene.needs), key), _adaptive if adaptive else qj.render
            image, seconds = timed(render, scene, sampler, side, side, spp)
            found[who][0].append(seconds.clock)
            found[who][1].append(rms(np.asarray(image) - exact))
    return found


def _adaptive(*given: Any) -> Any:
    return qj.render_adaptive(*given).image


def sweep(name: str, side: int, spp: int, calls: int) -> list[dict]:
    """Return a row for each sampler."""
    scene = SCENES[name]
    _, bound = scene.reference(side, side)
    entries = {who: (make, False) for who, make in SAMPLERS.items()}
    if hasattr(scene, "varies"):
        entries[f"{ADAPTIVE}, adaptive"] = SAMPLERS[ADAPTIVE], True
    rows = []
    for who, (seconds, errors) in compare(scene, entries, side, spp, calls).items():
        low, median, high = np.quantile(seconds[1:], [0.25, 0.5, 0.75])
        rows.append(
            {
                "scene": name,
                "sampler": who,
                "spp": spp,
                "seconds": float(median),
                "seconds, lower quartile": float(low),
                "seconds, upper quartile": float(high),
                "seconds, first call": seconds[0],
                "rms error": rms(errors),
                "reference bound": bound,
            }
        )
    return rows


def measure(quality: str) -> dict[str, Any]:
    """Return the rows of all scenes."""
    side, counts, calls = SIZES[quality]
    shown = SCENES if quality == "paper" else DRAFTED
    return {
        "side": side,
        "rows": [row for name in shown for spp in counts for row in sweep(name, side, spp, calls)],
    }

"""Run time and error of images by scene, sampler and spp: ``python -m figures.shared.speed_sweep draft``.

Prints JSON. Samplers take turns, each call with a new key, so that noise hits all; what a call compiles is
in the first one.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import qmcjax as qj
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
DRAFTED = ("ball",)

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


def timed(scene: Any, make: Make, side: int, spp: int, key: int, adaptive: bool) -> tuple[float, Any]:
    """Return the time that an image takes, and the image."""
    sampler = make(side, spp, len(scene.needs), key)
    start = time.perf_counter()
    if adaptive:
        image = qj.render_adaptive(scene, sampler, side, side, spp).image
    else:
        image = qj.render(scene, sampler, side, side, spp)
    image = np.asarray(image)
    return time.perf_counter() - start, image


def sweep(name: str, side: int, spp: int, calls: int) -> list[dict]:
    """Return a row for each sampler."""
    scene = SCENES[name]
    exact, bound = scene.reference(side, side)
    entries = {who: (make, False) for who, make in SAMPLERS.items()}
    if hasattr(scene, "varies"):
        entries[f"{ADAPTIVE}, adaptive"] = SAMPLERS[ADAPTIVE], True
    times: dict[str, list[float]] = {who: [] for who in entries}
    errors: dict[str, list[float]] = {who: [] for who in entries}
    for key in range(calls + 1):
        for who, (make, adaptive) in entries.items():
            seconds, image = timed(scene, make, side, spp, key, adaptive)
            times[who].append(seconds)
            errors[who].append(float(np.sqrt(np.mean((image - exact) ** 2))))
    rows = []
    for who in entries:
        low, median, high = np.quantile(times[who][1:], [0.25, 0.5, 0.75])
        rows.append(
            {
                "scene": name,
                "sampler": who,
                "spp": spp,
                "seconds": float(median),
                "seconds, lower quartile": float(low),
                "seconds, upper quartile": float(high),
                "seconds, first call": times[who][0],
                "rms error": float(np.sqrt(np.mean(np.square(errors[who])))),
                "reference bound": bound,
            }
        )
    return rows


def main(quality: str) -> None:
    """Measure and print."""
    side, counts, calls = SIZES[quality]
    rows = []
    for name in SCENES if quality == "paper" else DRAFTED:
        for spp in counts:
            rows += sweep(name, side, spp, calls)
        print(f"{name} done", file=sys.stderr)
    print(json.dumps({"side": side, "rows": rows}))


if __name__ == "__main__":
    main(sys.argv[1])

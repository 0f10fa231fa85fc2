"""Run time and error of images by scene, sampler and spp, in a separate process.

Samplers take turns, each call with a new key, so that noise hits all; the first one of each compiles.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import qmcjax as qj
from figures._errors import rms
from figures.shared.costs import timed
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.rendered import diffusion
from qmcjax import scenes
from qmcjax.choosing import CANDIDATES

SIZES = {"draft": (64, (4, 16), 2), "paper": (256, (1, 4, 16, 64, 256), 5)}
"""Of scenes with exact pixel means: side of the image, samples per pixel, calls after the first."""

TRACED = {"draft": (64, (4, 16), 1, 512), "paper": (128, (1, 4, 16, 64), 3, 1024)}
"""Of traced scenes: the same, and samples per pixel of references that are not stored."""

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

OURS = {
    "draft": ("random", "Hilbert, Owen", "Z"),
    "paper": ("random", "Owen, each pixel", "global Sobol', xor", "Hilbert, Owen", "Z", "lattice, rotated"),
}
"""Samplers of traced scenes."""


def exact_scenes(quality: str) -> dict[str, Any]:
    """Return scenes with exact pixel means."""
    found = {
        "checkerboard": scenes.checkerboard(),
        "zone plate": scenes.zone_plate(),
        "disc": scenes.disc(),
        "Gaussian bump": scenes.gaussian(),
        "ball": scenes.ball(),
        "soft shadow": scenes.soft_shadow(),
    }
    return found if quality == "paper" else {"checkerboard": found["checkerboard"]}


def traced_scenes(quality: str) -> dict[str, scenes.Traced]:
    """Return scenes that are traced; the interior has no textures and nothing that shines."""
    box = scenes.cornell_box(0.0, ball=False, mirror=False, blocks=True, light=0.5)
    if quality == "draft":
        return {"Cornell box, area light": box}
    room = scenes.interior(4)
    return {
        "Cornell box, area light": box,
        "occluder": scenes.occluder(),
        "interior, 4 bounces": replace(room, estimator=mitsuba_scenes.plain(room.estimator)),
        "Cornell box, moving": scenes.cornell_box(),
        "helicopter": scenes.helicopter(),
    }


def compare(
    scene: Any,
    entries: Mapping[str, tuple[Make, bool]],
    side: int,
    spp: int,
    calls: int,
    error: Callable[[NDArray], float] | None = None,
) -> dict[str, tuple[list[float], list[float]]]:
    """Return seconds and RMS errors of images, the first of which compiles, pixels skipped or not.

    ``error``: that of an image, by default from the scene's exact pixel means.
    """
    if error is None:
        exact, _ = scene.reference(side, side)
        error = partial(_error, exact)
    found: dict[str, tuple[list[float], list[float]]] = {who: ([], []) for who in entries}
    for key in range(calls + 1):
        for who, (make, adaptive) in entries.items():
            sampler, render = make(side, spp, len(scene.needs), key), _adaptive if adaptive else qj.render
            image, seconds = timed(render, scene, sampler, side, side, spp)
            found[who][0].append(seconds.clock)
            found[who][1].append(error(np.asarray(image)))
    return found


def _error(exact: NDArray, image: NDArray) -> float:
    return rms(image - exact)


def _adaptive(*given: Any) -> Any:
    return qj.render_adaptive(*given).image


def _rows(name: str, spp: int, found: Mapping[str, tuple[list[float], list[float]]]) -> list[dict]:
    """Return a row for each sampler, with quartiles of times."""
    rows = []
    for who, (seconds, errors) in found.items():
        low, median, high = np.quantile(seconds[1:], [0.25, 0.5, 0.75]).tolist()
        row = {"scene": name, "sampler": who, "spp": spp, "seconds": median, "rms error": rms(errors)}
        rows.append(row | {"seconds, lower quartile": low, "seconds, upper quartile": high})
    return rows


def measure(quality: str) -> dict[str, Any]:
    """Return the rows of exact and of traced scenes, and errors of the latter's references."""
    side, counts, calls = SIZES[quality]
    exact, traced, floors, origins = [], [], {}, []
    for name, scene in exact_scenes(quality).items():
        entries = {who: (make, False) for who, make in SAMPLERS.items()}
        if hasattr(scene, "varies"):
            entries[f"{ADAPTIVE}, adaptive"] = SAMPLERS[ADAPTIVE], True
        for spp in counts:
            exact += _rows(name, spp, compare(scene, entries, side, spp, calls))
    entries = {who: (SAMPLERS[who], False) for who in OURS[quality]}
    side, counts, calls, most = TRACED[quality]
    for name, scene in traced_scenes(quality).items():
        known = diffusion.reference(scene, side, most)
        floors[name] = rms(known.error)
        origins.append(f"{name}, {known.origin}, RMS error {floors[name]:.1e}.")
        error = partial(diffusion.rms_error, exact=known)
        for spp in counts:
            traced += _rows(name, spp, compare(scene, entries, side, spp, calls, error))
    return {"exact": exact, "traced": traced, "floors": floors, "origins": " ".join(origins)}

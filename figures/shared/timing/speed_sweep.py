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


NAMES = {
    "random": "random",
    "Owen, each pixel": "(0,2), Owen",
    "global Sobol', xor": "Sobol', full screen",
    "raster, Owen": "raster, Owen-Sobol'",
    "Hilbert, Owen": "Hilbert, Owen-Sobol'",
    "Hilbert, Halton": "Hilbert, Halton (2,3)",
    "Z": "Z, hash",
    "lattice, rotated": "rank-1 lattice",
}
SAMPLERS: dict[str, Make] = {
    short: lambda side, spp, dims, key, name=name: CANDIDATES[name].make(dims, side, side, spp, key)
    for short, name in NAMES.items()
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


def _sweep(
    name: str,
    scene: Any,
    entries: Mapping[str, tuple[Make, bool]],
    size: tuple[int, tuple[int, ...], int],
    error: Callable[[NDArray], float],
) -> list[dict]:
    """Return a row for each sampler and count, with quartiles of times; constant pixels are skipped or not.

    ``size``: side, counts, and calls after the first, which compiles. ``error``: that of an image.
    """
    side, counts, calls = size
    rows = []
    for spp in counts:
        seconds: dict[str, list[float]] = {who: [] for who in entries}
        errors: dict[str, list[float]] = {who: [] for who in entries}
        for key in range(calls + 1):
            for who, (make, adaptive) in entries.items():
                sampler = make(side, spp, len(scene.needs), key)
                image, taken = timed(_adaptive if adaptive else qj.render, scene, sampler, side, side, spp)
                seconds[who].append(taken.clock)
                errors[who].append(error(np.asarray(image)))
        for who, of in seconds.items():
            low, median, high = np.quantile(of[1:], [0.25, 0.5, 0.75]).tolist()
            row = {
                "scene": name,
                "sampler": who,
                "spp": spp,
                "seconds": median,
                "rms error": rms(errors[who]),
            }
            rows.append(row | {"seconds, lower quartile": low, "seconds, upper quartile": high})
    return rows


def _adaptive(*given: Any) -> Any:
    return qj.render_adaptive(*given).image


def measure(quality: str) -> dict[str, Any]:
    """Return the rows of exact and of traced scenes, and errors of the latter's references."""
    exact, traced, floors, origins = [], [], {}, []
    for name, scene in exact_scenes(quality).items():
        entries = {who: (make, False) for who, make in SAMPLERS.items()}
        if hasattr(scene, "varies"):
            entries[f"{ADAPTIVE}, adaptive"] = SAMPLERS[ADAPTIVE], True
        means = scene.reference(SIZES[quality][0], SIZES[quality][0])[0]
        exact += _sweep(name, scene, entries, SIZES[quality], lambda image, means=means: rms(image - means))
    entries = {who: (SAMPLERS[who], False) for who in OURS[quality]}
    *size, most = TRACED[quality]
    for name, scene in traced_scenes(quality).items():
        known = diffusion.reference(scene, size[0], most)
        floors[name] = rms(known.error)
        origins.append(f"{name}, {known.origin}, RMS error {floors[name]:.1e}.")
        traced += _sweep(name, scene, entries, tuple(size), partial(diffusion.rms_error, exact=known))
    return {"exact": exact, "traced": traced, "floors": floors, "origins": " ".join(origins)}

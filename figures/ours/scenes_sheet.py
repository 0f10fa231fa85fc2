"""Every scene with its exact image, and what low discrepancy does for its error."""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures._errors import rms
from figures.shared.sheets.image_grid import Panel, image_grid
from qmcjax import scenes
from qmcjax.choosing import CANDIDATES
from qmcjax.scenes import traced

SPP = 16
SIDE = {"draft": 64, "paper": 256}
KEYS = {"draft": 2, "paper": 4}
DRAFTED = ("disc", "gaussian", "ball")
"""Scenes that a draft renders: each compiles two programs."""

SUMMED = ((1, 7), (37, 23), (64, 64), (256, 256))
"""Width and height of the images whose sums are compared with the integral."""

GENZ_DIMS = 4
FAMILIES = ("oscillatory", "product_peak", "corner_peak", "gaussian", "continuous", "discontinuous")

WITH_ARGUMENTS = ("genz", "function", "as_scene")
"""Functions of `qmcjax.scenes` that do not make a scene when asked for nothing."""

NOTE = (
    "Exact means of {side} x {side} pixels; gray values from the least to the largest, which the captions "
    "give in brackets. 'bound' is of the error of every pixel. 'sum against integral' is the largest "
    "difference between the mean of all pixels and the integral, over images of {summed} pixels. 'error over "
    "random' is the RMS error of {spp} Owen-scrambled Sobol' samples per pixel, in contiguous blocks "
    "along the "
    "Hilbert curve, over that of {spp} random samples, both against the exact image and over {keys} keys."
)


def every_scene() -> dict[str, Any]:
    """Return the scenes with exact images that `qmcjax.scenes` makes when asked for nothing special."""
    factories = {
        name: make for name, make in vars(scenes).items() if inspect.isfunction(make) and name[0] != "_"
    }
    named = {name: make() for name, make in factories.items() if name not in WITH_ARGUMENTS}
    exact = {name: scene for name, scene in named.items() if not isinstance(scene, traced.Traced)}
    return exact | {f"genz, {family}": scenes.genz(family, GENZ_DIMS, 3.0) for family in FAMILIES}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the exact image of each scene, and measure."""
    side, keys, every = SIDE[quality], KEYS[quality], every_scene()
    measured, panels = {}, []
    for done, (name, scene) in enumerate(every.items(), start=1):
        exact, bound = scene.reference(side, side)
        numbers = {"needs": list(scene.needs), **_integral(scene), "bound": bound}
        # Rounding is no value: a 0 that is off by 1e-15 is written as 0.
        low, high = (float(end) if abs(end) > bound else 0.0 for end in (exact.min(), exact.max()))
        ratio = ""
        if quality == "paper" or name in DRAFTED:
            along, random = (_error(scene, exact, keys, name) for name in ("Hilbert, Owen-Sobol'", "random"))
            numbers["error over random"] = along / random
            ratio = f", error / random {numbers['error over random']:.2f}"
        measured[name] = numbers
        caption = f"{name} [{low:.3g}, {high:.3g}]\n{_shortened(scene.needs)}\nbound {bound:.0e}{ratio}"
        panels.append(Panel(caption, exact, (low, high) if high > low else (low - 1, high + 1)))
        progress(done / len(every))
    summed = ", ".join(f"{width} x {height}" for width, height in SUMMED)
    return image_grid(
        f"Scenes and their exact images, {side} x {side} pixels", panels, 5, max(320, 2 * side)
    ), {
        "measured": measured,
        "note": NOTE.format(side=side, summed=summed, spp=SPP, keys=keys),
    }


def _integral(scene: Any) -> dict[str, float]:
    """Return the integral with its bound, and how far from it the means of images are."""
    image, bound = scene.reference(1, 1)
    integral = float(image[0, 0])
    off = max(abs(float(scene.reference(*size)[0].mean()) - integral) for size in SUMMED)
    return {"integral": integral, "bound of the integral": bound, "sum against integral": off}


def _error(scene: Any, exact: NDArray[np.float64], keys: int, name: str) -> float:
    """Return the RMS error of a candidate over several keys."""
    side, make = len(exact), CANDIDATES[name].make
    made = [make(len(scene.needs), side, side, SPP, key) for key in range(keys)]
    images = [qj.render(scene, sampler, side, side, SPP) for sampler in made]
    return rms([np.asarray(image, np.float64) - exact for image in images])


def _shortened(needs: tuple[str, ...]) -> str:
    """Return all names, or the first ones and the last."""
    names = [*needs] if len(needs) <= 6 else [*needs[:4], "...", needs[-1]]
    return ", ".join(names)

"""Thesis Fig. 3.5: the same times in all pixels against times of their own, and other ways of Sect. 3.1."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
import qmcjax as qj
from figures._errors import rms
from figures.shared.sheets.image_sheets import Panel, image_grid
from qmcjax import samplers, scenes, sequences

KEY = 1
SPP = 32
SIDE = {"draft": 128, "paper": 384}

BALL = scenes.ball([[0.05, 0.2], [0.75, 0.95]], [[0.95, 0.5], [0.25, 0.75]], times=[0.5], radius=0.1)

STILL_SPP = 4

NOTE = (
    "The scene is ours: a disc that crosses the picture, jumps, and crosses again. {spp} samples per pixel, "
    "{side} x {side} pixels, gray values from 0 to the highest. Positions inside the pixel are "
    "Owen-scrambled in each pixel but in the accumulation buffer, where all pixels have the same. 'filtered' "
    "is the RMS error after a Gaussian of 1.5 pixels, about what an eye sees. The last two: the disc before "
    "a zone plate, random samples. Where the disc passes, all {spp} samples shade the zone plate, too, and "
    "it has less noise there than beside, where 4 are taken; the variance invariant method takes 4 in both. "
    "Its noise is measured between keys where the disc covers 0.5 to 30 %, over that of 4 samples alone."
)


def ways(spp: int, tile: int = 4) -> dict[str, Any]:
    """Return the samplers of Sect. 3.1."""
    times, own = sequences.van_der_corput(), samplers.independent(sequences.sobol(2), KEY)
    return {
        "same times in all pixels (dependent tests)": samplers.interleaved(times, spp, 1, own),
        "rotated in each pixel (Cranley-Patterson)": samplers.independent(
            sequences.sobol(3), KEY, randomize="shift"
        ),
        "interleaved, 4 x 4 pixels": samplers.interleaved(times, spp, tile, own),
        "accumulated images": samplers.interleaved(sequences.sobol(3), spp),
        "Owen-scrambled in each pixel": samplers.independent(sequences.sobol(3), KEY),
    }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render all ways, and the two adaptive ones, and measure their errors."""
    side = SIDE[quality]
    exact = BALL.reference(side, side)[0]
    images, errors = {"exact": exact}, {}
    for done, (name, sampler) in enumerate(ways(SPP).items(), start=1):
        image = np.asarray(qj.render(BALL, sampler, side, side, SPP), np.float64)
        images[name] = image
        errors[name] = {"rms": rms(image - exact), "filtered": analysis.filtered_error(image, exact)}
        progress(0.1 * done)
    layers, noise = _layers(side, exact, 32 if quality == "paper" else 12)

    title = (
        f"A disc that moves and jumps, {SPP} samples per pixel (thesis, Fig. 3.5 and Sect. 3.1)\n"
        f"{side} x {side} pixels; filtered: RMS error after a Gaussian of 1.5 pixels"
    )
    brightest = float(exact.max())
    panels = [Panel(f"exact\nwhite: visible {100 * brightest:.0f} % of the time", exact, (0.0, brightest))]
    for name, of in errors.items():
        caption = f"{name}\nRMS error {of['rms']:.4f}, filtered {of['filtered']:.4f}"
        panels.append(Panel(caption, images[name], (0.0, brightest)))
    for name, image in layers.items():
        caption = f"before a zone plate: {name}\nnoise on / off the path {noise[name]:.2f}"
        panels.append(Panel(caption, image))
    figure = image_grid(title, panels, 4, 384)
    numbers = {
        "measured": {"errors": errors, "noise on / off the path": noise},
        "claims": _claims(errors, noise),
        "note": NOTE.format(spp=SPP, side=side),
    }
    return figure, numbers


def _claims(errors: dict[str, dict[str, float]], noise: dict[str, float]) -> dict[str, Any]:
    same, rotated, interleaved, accumulated, _ = (of["filtered"] for of in errors.values())
    shaded, invariant = noise.values()
    return {
        "times of their own look better: less than half the filtered error": rotated < 0.5 * same,
        "interleaving reduces artefacts drastically: less than half the filtered error": (
            interleaved < 0.5 * same
        ),
        "accumulated images show them, too: more than twice the filtered error of times of their own": (
            accumulated > 2 * rotated
        ),
        "much less noise where all samples shade what is behind: less than half": shaded < 0.5,
        "even noise by the variance invariant method: within 10 %": abs(invariant - 1) < 0.1,
    }


def _layers(side: int, cover: NDArray, keys: int) -> tuple[dict[str, NDArray], dict[str, float]]:
    """Return an image of each adaptive way, and the noise of the still scene on the path over that off it."""
    plate = scenes.zone_plate(2.0 * side)

    def sampler(key: int) -> samplers.Sampler:
        return samplers.independent(sequences.uniform(3, key), key)

    def still(key: int, spp: int) -> NDArray[np.float64]:
        return np.asarray(qj.render(plate, sampler(key), side, side, spp), np.float64)

    def all_shade(key: int) -> NDArray[np.float64]:
        seen = np.asarray(qj.render(BALL, sampler(key), side, side, SPP), np.float64)
        behind = np.where(cover > 0, still(key, SPP), still(key, STILL_SPP))
        return seen + (1 - seen) * behind

    def invariant(key: int) -> NDArray[np.float64]:
        return np.asarray(qj.render_layers(BALL, plate, sampler(key), side, side, SPP, STILL_SPP).image)

    alone = np.var([still(key, STILL_SPP) for key in range(keys)], axis=0, ddof=1)
    passed = (cover > 0.005) & (cover < 0.3)
    images, noise = {}, {}
    for name, render in {"all samples shade": all_shade, "variance invariant": invariant}.items():
        drawn = [render(key) for key in range(keys)]
        images[name] = drawn[0]
        noise[name] = float(np.sqrt(np.var(drawn, axis=0, ddof=1)[passed].mean() / alone[passed].mean()))
    return images, noise

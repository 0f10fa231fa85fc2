"""One scene by eight samplers, from 1 to 256 samples per pixel: images for the page's slider."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures._sheets import Row, image_sheet
from qmcjax import orders, samplers, scenes, sequences

SIDE = 128
KEY = 1
COUNTS = (1, 4, 16, 64, 256)

NOTE = (
    f"The checkerboard, {SIDE} x {SIDE} pixels, box filter, one key for what is random; errors are against "
    "the exact pixel means. (0,2), lattice and dither: the same sequence in each pixel, Owen-scrambled, "
    "rotated at random, or rotated by a mask of blue noise. Ranked: keys optimised for blue noise. Global: "
    "one sequence over the screen. Z: Morton order, scrambled by hashing. Hilbert: contiguous blocks of one "
    "Owen-scrambled sequence along the curve."
)


def ways(spp: int) -> dict[str, samplers.Sampler]:
    """Return the samplers by name."""
    sobol, lattice = sequences.sobol(2), sequences.lattice(2)
    return {
        "random": samplers.contiguous(orders.raster(SIDE, SIDE), sequences.uniform(2, KEY), spp),
        "(0,2), Owen": samplers.independent(sobol, KEY),
        "lattice, rotated": samplers.independent(lattice, KEY, "shift"),
        "dither": samplers.dither(samplers.blue_noise_mask(2), lattice),
        "ranked": samplers.ranked(2, KEY),
        "global Sobol'": samplers.full_screen(sobol, SIDE, SIDE),
        "Z": samplers.z(SIDE, SIDE, spp, KEY),
        "Hilbert, Owen": samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.owen(sobol, KEY), spp),
    }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render all, show the images of a few samples, and hand all of them out; drafts are whole."""
    scene = scenes.checkerboard()
    reference, bound = scene.reference(SIDE, SIDE)
    images: dict[str, NDArray] = {"exact reference": np.asarray(reference)}
    rows: dict[str, dict[str, NDArray]] = {}
    errors: dict[str, dict[str, float]] = {}
    for done, spp in enumerate(COUNTS, start=1):
        row = rows.setdefault(f"{spp} spp", {})
        for name, sampler in ways(spp).items():
            image = np.asarray(qj.render(scene, sampler, SIDE, SIDE, spp))
            images[f"{name}, {spp} spp"] = row[name] = image
            errors.setdefault(name, {})[f"{spp} spp"] = float(np.sqrt(np.mean((image - reference) ** 2)))
        progress(done / len(COUNTS))
    measured = {"rms_error": errors, "reference_error_bound": float(bound)}
    title = "The checkerboard, from 1 to 256 samples per pixel"
    figure = image_sheet(title, {count: Row(row) for count, row in rows.items()}, panel=SIDE)
    return figure, {"measured": measured, "note": NOTE}, images

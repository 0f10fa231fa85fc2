"""One scene by eight samplers, from 1 to 256 samples per pixel: images for the page's slider."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures._errors import rms
from figures.shared.image_grid import Panel, image_grid
from qmcjax import orders, samplers, scenes, sequences

SIDE = 128
KEY = 1
COUNTS = (1, 4, 16, 64, 256)
DRAWN = {"draft": ("random", "Z", "Hilbert, Owen")}
"""Samplers of drafts; otherwise all."""

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
    """Render all, show the images of a few samples, and hand all of them out; drafts have fewer samplers."""
    scene = scenes.checkerboard()
    reference, bound = scene.reference(SIDE, SIDE)
    images: dict[str, NDArray] = {"exact reference": np.asarray(reference)}
    panels: list[Panel] = []
    errors: dict[str, dict[str, float]] = {}
    for done, spp in enumerate(COUNTS, start=1):
        for name, sampler in ways(spp).items():
            if name not in DRAWN.get(quality, (name,)):
                continue
            image = np.asarray(qj.render(scene, sampler, SIDE, SIDE, spp))
            images[f"{name}, {spp} spp"] = image
            error = rms(image - reference)
            errors.setdefault(name, {})[f"{spp} spp"] = error
            panels.append(Panel(f"{name}, {spp} spp\nRMS error {error:.4f}", image))
        progress(done / len(COUNTS))
    measured = {"rms_error": errors, "reference_error_bound": float(bound)}
    columns = len(panels) // len(COUNTS)
    figure = image_grid("The checkerboard, from 1 to 256 samples per pixel", panels, columns, 2 * SIDE)
    return figure, {"measured": measured, "note": NOTE}, images

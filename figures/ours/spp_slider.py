"""One scene by several samplers, from 1 to 256 samples per pixel: images for the page's slider, and errors.

With it go measured errors of all samplers, for the page "Which sampler?".
"""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures import plot
from figures._errors import rms
from figures.shared.rendered import scene_images
from figures.shared.sampler_errors import which_sampler
from figures.shared.sheets.panels import new_figure
from qmcjax import orders, samplers, scenes, sequences

SIDE = 128
KEY = 1
DIMS = 4
"""Of the scene: the pixel and the light."""

COUNTS = (1, 4, 16, 64, 256)
DRAWN = {"draft": ("random", "Z", "Hilbert, Owen")}
"""Samplers of drafts; otherwise all."""

NOTE = (
    f"A soft shadow, {SIDE} x {SIDE} pixels, box filter, one key; errors are against the exact pixel "
    "means. (0,2), lattice and dither: the same sequence in each pixel, Owen-scrambled, rotated at "
    "random, or rotated by a mask of blue noise. Ranked: keys optimised for blue noise. Global: one "
    "sequence over the screen. Z: Morton order, scrambled by hashing. Hilbert: contiguous blocks of one "
    "Owen-scrambled sequence along the curve."
)


def ways(spp: int) -> dict[str, Callable[[], samplers.Sampler]]:
    """Return what makes the samplers, by name."""
    sobol, lattice, curve = sequences.sobol(DIMS), sequences.lattice(DIMS), orders.hilbert(SIDE, SIDE)
    return {
        "random": lambda: samplers.contiguous(orders.raster(SIDE, SIDE), sequences.uniform(DIMS, KEY), spp),
        "(0,2), Owen": lambda: samplers.independent(sobol, KEY),
        "lattice, rotated": lambda: samplers.independent(lattice, KEY, "shift"),
        "dither": lambda: samplers.dither(samplers.blue_noise_mask(2), lattice),
        "ranked": lambda: samplers.ranked(DIMS, KEY),
        "global Sobol'": lambda: samplers.full_screen(sobol, SIDE, SIDE),
        "Z": lambda: samplers.z(SIDE, SIDE, spp, KEY, dims=DIMS),
        "Hilbert, Owen": lambda: samplers.contiguous(curve, sequences.owen(sobol, KEY), spp),
    }


def make(
    quality: str, progress: Callable[[float], None]
) -> tuple[Figure, dict, dict[str, NDArray], dict[str, bytes]]:
    """Render all, draw their errors, and hand them out; drafts have fewer samplers."""
    scene = scenes.soft_shadow()
    reference, bound = scene.reference(SIDE, SIDE)
    images: dict[str, NDArray] = {"exact reference": np.asarray(reference)}
    errors: dict[str, dict[str, float]] = {}
    for done, spp in enumerate(COUNTS, start=1):
        for name, sampler in ways(spp).items():
            if name not in DRAWN.get(quality, (name,)):
                continue
            if quality == "paper":
                image = np.asarray(qj.render(scene, sampler(), SIDE, SIDE, spp))
            else:  # To compile a program for a sampler and a count takes longer than to do without, if few.
                image = scene_images.image(scene, sampler(), SIDE, spp)[..., 0]
            images[f"{name}, {spp} spp"] = image
            errors.setdefault(name, {})[f"{spp} spp"] = rms(image - reference)
        progress(done / (1 + len(COUNTS)))
    measured = {"rms_error": errors, "reference_error_bound": float(bound)}
    last = {name: of[f"{COUNTS[-1]} spp"] for name, of in errors.items()}
    factor = last["random"] / min(last.values())
    figure = new_figure(
        f"Random samples have {factor:.1f} times the error of the best sampler at {COUNTS[-1]} spp\n"
        f"soft shadow, {SIDE} x {SIDE} pixels, one key",
        3.4,
    )
    plot.convergence(COUNTS, {name: list(of.values()) for name, of in errors.items()}, ax=figure.subplots())
    return figure, {"measured": measured, "note": NOTE}, images, {"which.html": which_sampler().encode()}

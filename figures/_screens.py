"""The thesis's two planar test scenes: the samplers it compares, as images and as convergence graphs."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import analysis
import qmcjax as qj
from qmcjax import samplers, sequences
from qmcjax.orders import log_side

REGIONS = ("whole", "upper", "lower")
KEYS = 4
"""Jittered grids are random: their errors are averaged over so many."""

DPI = 150


def _net(make: Callable[[int], Any], side: int) -> Callable[[int], samplers.Sampler]:
    """Return spp -> the sampler of one net over a square screen."""
    return lambda spp: samplers.full_screen(make(2 * log_side(side, side) + spp.bit_length() - 1), side, side)


def _jittered(side: int, key: int) -> Callable[[int], samplers.Sampler]:
    return lambda spp: samplers.full_screen(sequences.jittered(side * round(spp**0.5), 2, key), side, side)


def nets(side: int) -> dict[str, Callable[[int], samplers.Sampler]]:
    """Return the deterministic samplers of chapter 6 for a square screen."""
    return {
        "Hammersley": _net(sequences.hammersley_net, side),
        "Larcher-Pillichshammer": _net(sequences.larcher_pillichshammer_net, side),
        "permutation": _net(sequences.permutation_net, side),
    }


def pictures(
    scene: Any, title: str, crop: tuple[float, float, float], quality: str, progress
) -> tuple[Figure, dict]:
    """Show reference and samplers at 64 samples per pixel, with a magnified area below each.

    ``crop`` is the left and upper edge and the side of the area, in parts of the image.
    """
    side, spp = (512, 64) if quality == "paper" else (256, 64)
    makers = {"jittered grid": _jittered(side, key=0), **nets(side)}
    reference, bound = scene.reference(side, side)
    progress(0.5)
    images = {name: np.asarray(qj.render(scene, make(spp), side, side, spp)) for name, make in makers.items()}
    errors = {name: float(np.sqrt(np.mean((image - reference) ** 2))) for name, image in images.items()}
    captions = {name: f"{name}\nRMS error {error:.5f}" for name, error in errors.items()}
    progress(0.9)
    figure = _sheet({"exact reference": reference, **images}, captions, title, crop)
    numbers = {
        "measured": {"rms_error": errors, "reference_error_bound": float(bound)},
        "printed": "images only; the convergence graphs that follow order the samplers",
        "note": f"{side} x {side} pixels, {spp} samples per pixel, box filter; the camera is ours where the "
        "thesis gives none. Its rank-1 lattice and its optimised matrices are not in this sheet.",
    }
    return figure, numbers


def _sheet(images: dict[str, np.ndarray], captions: dict[str, str], title: str, crop) -> Figure:
    """Lay images out so that one image pixel is one pixel of the PNG, and whole ones in the magnification."""
    side = next(iter(images.values())).shape[0]
    gap, top = 12, 80
    width, height = len(images) * (side + gap) + gap, 2 * (side + gap) + gap + top
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    figure.suptitle(title, y=1 - 18 / height, fontsize=9)
    left, upper, part = (round(c * side) for c in crop)
    for k, (name, image) in enumerate(images.items()):
        area = image[upper : upper + part, left : left + part]
        for row, shown in enumerate((image, area)):
            x, y = gap + k * (side + gap), gap + (1 - row) * (side + gap)
            axes = figure.add_axes((x / width, y / height, side / width, side / height))
            axes.imshow(shown, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
            axes.set_axis_off()
            if row == 0:
                axes.set_title(captions.get(name, name), fontsize=7, pad=3)
                axes.add_patch(
                    Rectangle((left - 0.5, upper - 0.5), part, part, fill=False, color="tab:red", lw=0.8)
                )
    return figure


def convergence(
    scene: Any, title: str, claims: Callable[[dict], dict[str, bool]], quality: str, progress
) -> tuple[Figure, dict]:
    """Plot error over samples per pixel, log-log, for the whole image and its halves."""
    side, largest = (512, 7) if quality == "paper" else (128, 6)
    spps = [4**k for k in range(largest + 1)]
    makers = {f"jittered grid {key}": _jittered(side, key) for key in range(KEYS)} | nets(side)
    table = analysis.convergence(scene, makers, spps, width=side, height=side, repeats=1, progress=progress)
    errors = {
        name: {region: [float(e) for e in table.errors(name, region)[1]] for region in REGIONS}
        for name in nets(side)
    }
    jittered = {
        region: np.sqrt(
            np.mean([table.errors(f"jittered grid {key}", region)[1] ** 2 for key in range(KEYS)], axis=0)
        )
        for region in REGIONS
    }
    errors = {"jittered grid": {region: jittered[region].tolist() for region in REGIONS}, **errors}

    figure = Figure(figsize=(15, 5), layout="constrained")
    figure.suptitle(title)
    for axes, region in zip(figure.subplots(1, 3, sharey=True), REGIONS, strict=True):
        for (name, of_region), marker in zip(errors.items(), "xov^", strict=True):
            axes.loglog(spps, of_region[region], marker=marker, ms=4, lw=1, label=name)
        for power in (-0.5, -0.75):
            start = errors["jittered grid"][region][0]
            axes.loglog(spps, start * np.array(spps, float) ** power, "k:", lw=0.6)
            axes.annotate(f"$n^{{{power}}}$", (spps[-1], start * float(spps[-1]) ** power), fontsize=7)
        axes.set(
            title=f"{region} image" if region == "whole" else f"{region} half", xlabel="samples per pixel"
        )
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("root mean square error")
    figure.axes[0].legend()
    numbers = {
        "measured": {"spp": spps, "rms_error": errors, "slope": _slopes(spps, errors)},
        "printed": claims(errors),
        "note": f"{side} x {side} pixels. The thesis plots the norm of the error image, the RMS error times "
        f"{side}. Jittered grids: root mean square over {KEYS} keys. 'printed' lists the thesis's sentences "
        "and whether they hold in these numbers.",
    }
    return figure, numbers


def _slopes(spps: list[int], errors: dict[str, dict[str, list[float]]]) -> dict[str, dict[str, float]]:
    return {
        name: {
            region: float(np.polyfit(np.log(spps), np.log(values), 1)[0])
            for region, values in regions.items()
        }
        for name, regions in errors.items()
    }

"""Hilbert paper Fig. 5: an interior by one sequence over the screen, and along the Hilbert curve."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import ndimage

from figures import plot
from figures._errors import rms
from figures.shared import judged
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import DPI, Panel, Row, add_axes, image_sheet, place_panel
from figures.shared.sheets.panels import curve, name_axes
from qmcjax import orders, samplers, scenes, sequences

SIDE = {"draft": 128, "paper": 256}
BOUNCES = {"draft": 2, "paper": 6}
REFERENCE_SPP = {"draft": 256, "paper": 16384}
COUNTS = {"draft": (1, 4, 16), "paper": (1, 4, 16, 64)}
"""Samples per pixel."""

GLOBAL = "global Halton"
ALONG = {
    "shifted lattice": "Hilbert, shifted lattice",
    "partitioned": "Hilbert, partitioned",
    "contiguous": "Hilbert, Halton",
}
"""Ways along the curve, and as what they are drawn."""
ITSELF, PASSES = "Halton shifted by itself", "four randomised passes"
FILTERED, SMOOTH, ELSEWHERE = "filtered error", "filtered error where smooth", "filtered error elsewhere"

SHOWN, CROP, BESIDE = (GLOBAL, "shifted lattice", "partitioned"), 64, 800
"""The paper's columns; side of insets, of the table top and back rests; room for the large image."""

SIGMA = 1.5
"""Of the filter, in pixels."""

SAME = 1.1
"""Up to this factor errors are about the same."""

STEP = 1 / 255
"""Of the display: smaller differences are not observable."""

NOTE = (
    "{side} x {side} pixels, the package's interior with {bounces} bounces, {dims} dimensions; the "
    "reference is {origin}, with an RMS error of {error:.2g}. Halton sequences have Faure and Lemieux's "
    "digits, as in the paper. The extensible lattice has the vector of Cools, Kuo and Nuyens: that from "
    "primitive polynomials [16] is not in the paper, and we have not found its construction. At 64 points "
    "it is the worst of the four, because of its vector: with 16 random odd ones the error is within 10 % of "
    "the global sequence's (64 x 64 pixels, two bounces). We read the caption's 'in contiguous blocks "
    "(Sect. 4.4)' as the partitioned sequence in its simplified form, and also measure the contiguous "
    "segments of Sect. 3. At one sample these equal the shifted lattice. 'About the same l2-error' means "
    f"within a factor of {SAME}. In this scene the noise of the global sequence is not less uniform: at "
    "one sample its errors are diffused, too, to about half of white noise at low frequencies (0.05 to "
    "0.14 on the simple integrands of figure screen-space). Its aligned blocks of 2**a x 3**b "
    "pixels share a sequence with a common stride, as uniform as contiguous points in the other bases. "
    "'Smooth' is the half of the pixels with the least relative gradient. " + diffusion.EXPLAINED
)


def ways(dims: int, side: int, spp: int) -> dict[str, samplers.Sampler]:
    """Return the paper's three columns, the segments of its Sect. 3, and what Sect. 4.1 advises against."""
    halton, curve = sequences.halton(dims, "faure_lemieux"), orders.hilbert(side, side)
    return {
        GLOBAL: samplers.full_screen(halton, side, side),
        "shifted lattice": samplers.shifted(curve, halton, sequences.lattice(dims)),
        "partitioned": samplers.partitioned(curve, sequences.halton(dims + 1, "faure_lemieux")),
        "contiguous": samplers.contiguous(curve, halton, spp),
        ITSELF: samplers.shifted(curve, halton, halton),
    }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render all ways at 1, 4, 16 and in paper quality 64 samples per pixel; hand the images out.

    Drafts render the insets only, by the ways that are drawn.
    """
    side, counts, scene = SIDE[quality], COUNTS[quality], scenes.interior(BOUNCES[quality])
    exact = whole = diffusion.reference(scene, side, REFERENCE_SPP[quality])
    progress(0.5)
    left, top = side * 3 // 10, side * 9 // 20
    area, near, inset = diffusion.beside_window(side), np.s_[top : top + CROP, left : left + CROP], None
    if quality == "draft":
        area, near, inset = diffusion.WHOLE, diffusion.WHOLE, (left, top, CROP)
        exact = whole.part(*inset)
    smooth = _smooth(exact.image[area])
    insets: dict[str, dict[str, NDArray]] = {f"{spp} spp": {} for spp in counts}
    images = {"reference": exact.image[area]}  # without the window, as they are measured
    measured: dict[str, dict[str, Any]] = {}
    compared = {spp: ways(len(scene.needs), side, spp) for spp in counts}
    if inset:
        compared = {spp: {name: of[name] for name in (GLOBAL, *ALONG)} for spp, of in compared.items()}
    found = scene_images.compare(
        scene, side, compared, lambda part: progress(0.5 + 0.5 * part), len(counts), inset
    )
    for (spp, name), image in found.items():
        images[f"{name}, {spp} spp"] = image[area]
        of = diffusion.measures(image, exact, area) | _by_area(image, exact, area, smooth)
        measured.setdefault(name, {})[f"{spp} spp"] = of
        if name in SHOWN:
            insets[f"{spp} spp"][name] = diffusion.shown(image)[near]
    rows = {
        count: Row(
            row, captions={name: f"filtered error {measured[name][count][FILTERED]:.4f}" for name in row}
        )
        for count, row in insets.items()
    }
    title = (
        "Along the Hilbert curve the RMS error is mostly about that of the global sequence\n"
        f"Hilbert paper, Fig. 5; our interior, {side} x {side} pixels, paths of {BOUNCES[quality]} bounces\n"
        "insets are of the red square; filtered error: RMS after a Gaussian of 1.5 pixels"
        + (", in the square" if inset else "")
    )
    figure = image_sheet(title, rows, room=BESIDE)
    _draw_beside(figure, Panel("reference", diffusion.shown(whole.image), marked=(left, top, CROP)), measured)
    note = ("All is measured in the insets. " if inset else diffusion.BESIDE_WINDOW) + NOTE.format(
        side=side,
        bounces=BOUNCES[quality],
        dims=len(scene.needs),
        origin=exact.origin,
        error=rms(exact.error[area]),
    )
    if inset:
        return figure, {"measured": measured, "note": note}, images
    passes = _render_passes(scene, side, counts[-1])
    measured[PASSES] = {f"{counts[-1]} spp": diffusion.measures(passes, exact, area)}
    return figure, {"measured": measured, "claims": _claims(measured, counts), "note": note}, images


def _draw_beside(figure: Figure, large: Panel, measured: dict[str, dict[str, Any]]) -> None:
    """Draw the whole image right of the insets, and below it errors relative to the global sequence."""
    width, height = (round(inches * DPI) for inches in figure.get_size_inches())
    place_panel(figure, large, width - BESIDE + 20, height - 225, BESIDE - 32)
    axes = add_axes(figure, width - BESIDE + 150, 120, BESIDE - 170, height - 225 - (BESIDE - 32) - 190)
    axes.axhspan(1 / SAME, SAME, color="0.9")
    for name, drawn in ALONG.items():
        ratios = {
            count.removesuffix(" spp"): of["RMS error"] / measured[GLOBAL][count]["RMS error"]
            for count, of in measured[name].items()
        }
        curve(axes, ratios, plot.style(drawn), label=name)
    ticks = [float(count.removesuffix(" spp")) for count in measured[GLOBAL]]
    name_axes(axes, "samples per pixel", "RMS error / global's", log="x", ticks=ticks, legend="upper left")
    axes.set(ylim=(0.8, 1.6))


def _render_passes(scene: Any, side: int, spp: int) -> NDArray[np.float64]:
    """Return the mean of four passes in contiguous blocks, each with digits permuted anew."""
    curve, dims = orders.hilbert(side, side), len(scene.needs)
    passes = [samplers.contiguous(curve, sequences.halton(dims, "random", key), spp // 4) for key in range(4)]
    return np.mean([scene_images.image(scene, each, side, spp // 4, len(passes)) for each in passes], axis=0)


def _smooth(image: NDArray) -> NDArray[np.bool_]:
    """Return the half of the pixels where the image varies least, relatively."""
    grey = image.mean(axis=2)
    level = np.maximum(ndimage.gaussian_filter(grey, 1.0), 1e-6)
    steep = ndimage.gaussian_gradient_magnitude(grey, 1.0) / level
    return steep < np.median(steep)


def _by_area(
    image: NDArray, exact: diffusion.Reference, area: diffusion.Area, smooth: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return filtered errors of parts, less the reference's own."""
    left = ndimage.gaussian_filter((image - exact.image)[area], (SIGMA, SIGMA, 0), mode="wrap")
    # The square of the filter is, up to its sum, a Gaussian narrower by sqrt(2).
    noise = ndimage.gaussian_filter(exact.error[area] ** 2, (SIGMA / 2**0.5, SIGMA / 2**0.5, 0), mode="wrap")
    noise /= 4 * np.pi * SIGMA**2

    def filtered(squares: NDArray, of_noise: NDArray) -> float:
        return float(np.sqrt(max(np.mean(squares) - np.mean(of_noise), np.mean(of_noise))))

    parts = zip(diffusion.in_parts(left**2), diffusion.in_parts(noise), strict=True)
    return {
        "filtered error of parts": [filtered(*part) for part in parts],
        SMOOTH: filtered(left[smooth] ** 2, noise[smooth]),
        ELSEWHERE: filtered(left[~smooth] ** 2, noise[~smooth]),
    }


def _claims(measured: dict[str, dict[str, Any]], counts: Sequence[int]) -> dict[str, Any]:
    few, most = counts[:2], counts[-1]

    def of(name: str, spp: int, measure: str) -> float:
        return measured[name][f"{spp} spp"][measure]

    def ratio(name: str, spp: int, measure: str) -> float:
        return of(GLOBAL, spp, measure) / of(name, spp, measure)

    def parts(name: str, spp: int) -> list[float]:
        return measured[name][f"{spp} spp"]["filtered error of parts"]

    def cases(counts: Sequence[int]) -> list[tuple[str, int]]:
        """Return names and counts: at one sample contiguous blocks are the shifted lattice."""
        return [(name, spp) for name in ALONG for spp in counts if (name, spp) != ("contiguous", 1)]

    return {
        "about the same l2-error as the global sequence": {
            f"{name}, {spp} spp": 1 / SAME < ratio(name, spp, "RMS error") < SAME
            for name, spp in cases(counts)
        },
        "noise more uniformly distributed, less splotchy: less filtered error": {
            f"{name}, {spp} spp": judged.smaller(parts(name, spp), parts(GLOBAL, spp))
            for name, spp in cases(counts)
        },
        "especially in smooth areas: there filtered errors are less by a tenth, and by more than elsewhere": {
            f"{name}, {spp} spp": ratio(name, spp, SMOOTH) > max(SAME, ratio(name, spp, ELSEWHERE))
            for name, spp in cases(few)
        },
        "observable differences vanish: filtered errors differ by less than 1/255 at the most samples": {
            name: abs(of(GLOBAL, most, FILTERED) - of(name, most, FILTERED)) < STEP for name in ALONG
        },
        "randomising each pass sacrifices convergence: more error than as many samples of one sequence": (
            of(PASSES, most, "RMS error") > of("contiguous", most, "RMS error")
        ),
        "one sequence to shift and to sample shows artefacts: more filtered error than a shifted lattice": {
            f"{spp} spp": of(ITSELF, spp, FILTERED) > of("shifted lattice", spp, FILTERED) for spp in (4, 16)
        },
        "rotations suit lattices best: less error than of the Halton sequence": {
            f"{spp} spp": of("shifted lattice", spp, "RMS error") < of(ITSELF, spp, "RMS error")
            for spp in counts[1:]
        },
    }

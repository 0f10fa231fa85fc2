"""Hilbert paper Fig. 5: an interior by one sequence over the screen, and along the Hilbert curve."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import ndimage

from figures._errors import rms
from figures.shared import judged
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import Row, image_sheet
from qmcjax import orders, samplers, scenes, sequences

SIDE = {"draft": 32, "paper": 256}
BOUNCES = {"draft": 2, "paper": 6}
REFERENCE_SPP = {"draft": 256, "paper": 16384}
COUNTS = (1, 4, 16, 64)

PARTS = 4
"""Along each side: the image in parts, over which errors are compared."""

GLOBAL, ALONG = "global Halton", ("shifted lattice", "partitioned", "contiguous")
ITSELF, PASSES = "Halton shifted by itself", "four randomised passes of 16 samples"

MAGNIFIED = 16
"""Samples per pixel of the table top and the back rests that are magnified."""

SAME = 1.25
"""Up to this factor errors are about the same."""

STEP = 1 / 255
"""Of the display: smaller differences are not observable."""

NOTE = (
    "{side} x {side} pixels, the package's interior with {bounces} bounces, {dims} dimensions; the "
    "reference is {origin}, with an RMS error of {error:.2g}. Halton sequences have Faure and Lemieux's "
    "digits, as in the paper; the extensible lattice is ours, not that of primitive polynomials, and "
    "the worst of the four at 64 points. We read the caption's 'in contiguous blocks (Sect. 4.4)' as "
    "the partitioned sequence in its simplified form, and also show the contiguous segments of Sect. 3. "
    "At one sample these equal the shifted lattice. 'About the same l2-error' means within a factor of "
    "1.25. In this scene the noise of the global sequence is not less uniform: at one sample its errors "
    "are diffused, too, to about half of white noise at low frequencies (0.05 to 0.14 on the simple "
    "integrands of figure screen-space). Its aligned blocks of 2**a x 3**b pixels share a sequence with "
    "a common stride, as uniform as contiguous points in the other bases. 'Smooth' is the half of the "
    "pixels with the least relative gradient. " + diffusion.BESIDE_WINDOW + diffusion.EXPLAINED
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
    """Render all ways at 1, 4, 16 and 64 samples per pixel; hand the images out."""
    side, scene = SIDE[quality], scenes.interior(BOUNCES[quality])
    exact = diffusion.reference(scene, side, REFERENCE_SPP[quality])
    progress(0.5)
    area = diffusion.beside_window(side)
    smooth = _smooth(exact.image[area])
    shown: dict[str, dict[str, NDArray]] = {}
    images = {"reference": exact.image[area]}  # without the window, as they are measured
    measured: dict[str, dict[str, Any]] = {}
    compared = {spp: ways(len(scene.needs), side, spp) for spp in COUNTS}
    found = scene_images.compare(scene, side, compared, lambda part: progress(0.5 + 0.5 * part))
    for (spp, name), image in found.items():
        images[f"{name}, {spp} spp"] = image[area]
        shown.setdefault(f"{spp} spp", {})[name] = diffusion.shown(image)
        measured.setdefault(name, {})[f"{spp} spp"] = diffusion.measures(image, exact, area) | _by_area(
            (image - exact.image)[area], smooth
        )
    measured[PASSES] = {"64 spp": diffusion.measures(_render_passes(scene, side), exact, area)}
    shown["1 spp"]["reference"] = diffusion.shown(exact.image)
    rows = {}
    for count, row in shown.items():
        errors = {name: measured[name][count]["filtered error"] for name in row if name in measured}
        rows[count] = Row(row, captions={name: f"filtered error {of:.4f}" for name, of in errors.items()})
    left, top, part = side // 4, side * 2 // 5, side // 2
    near = np.s_[top : top + part, left : left + part]
    count = f"{MAGNIFIED} spp"
    rows[count] = rows[count]._replace(marked=(left, top, part))
    of_table = {"reference": shown["1 spp"]["reference"], **shown[count]}
    rows[f"{count}, magnified"] = Row({name: image[near] for name, image in of_table.items()})
    title = (
        "Along the Hilbert curve the error is about that of the global sequence\n"
        "Hilbert paper, Fig. 5\n"
        f"our interior, {side} x {side} pixels, paths of {BOUNCES[quality]} bounces, digits of Faure and "
        "Lemieux; filtered error: RMS after a Gaussian of 1.5 pixels; at 1 spp three columns are the same"
    )
    figure = image_sheet(title, rows, panel=256)
    note = NOTE.format(
        side=side,
        bounces=BOUNCES[quality],
        dims=len(scene.needs),
        origin=exact.origin,
        error=rms(exact.error[area]),
    )
    return figure, {"measured": measured, "claims": _claims(measured), "note": note}, images


def _render_passes(scene: Any, side: int) -> NDArray[np.float64]:
    """Return the mean of four passes of 16 samples in contiguous blocks, each with digits permuted anew."""
    curve, dims = orders.hilbert(side, side), len(scene.needs)
    passes = [
        samplers.contiguous(curve, sequences.halton(dims, "random", key), 16) for key in range(64 // 16)
    ]
    return np.mean([scene_images.replicate(scene, sampler, side, 16) for sampler in passes], axis=0)


def _smooth(image: NDArray) -> NDArray[np.bool_]:
    """Return the half of the pixels where the image varies least, relatively."""
    grey = image.mean(axis=2)
    level = np.maximum(ndimage.gaussian_filter(grey, 1.0), 1e-6)
    steep = ndimage.gaussian_gradient_magnitude(grey, 1.0) / level
    return steep < np.median(steep)


def _by_area(error: NDArray, smooth: NDArray[np.bool_]) -> dict[str, Any]:
    left = ndimage.gaussian_filter(error, (1.5, 1.5, 0), mode="wrap")
    parts = [part for rows in np.array_split(left, PARTS) for part in np.array_split(rows, PARTS, axis=1)]
    return {
        "filtered error of parts": [rms(part) for part in parts],
        "filtered error where smooth": rms(left[smooth]),
        "filtered error elsewhere": rms(left[~smooth]),
    }


def _claims(measured: dict[str, dict[str, Any]]) -> dict[str, Any]:
    def of(name: str, spp: int, measure: str) -> float:
        return measured[name][f"{spp} spp"][measure]

    def ratio(name: str, spp: int, measure: str) -> float:
        return of(GLOBAL, spp, measure) / of(name, spp, measure)

    def parts(name: str, spp: int) -> list[float]:
        return measured[name][f"{spp} spp"]["filtered error of parts"]

    return {
        "about the same l2-error as the global sequence, at 1 to 64 samples": {
            name: all(1 / SAME < ratio(name, spp, "RMS error") < SAME for spp in COUNTS) for name in ALONG
        },
        "noise more uniformly distributed, less splotchy: less filtered error": {
            f"{name}, {spp} spp": judged.smaller(parts(name, spp), parts(GLOBAL, spp))
            for name in ALONG
            for spp in COUNTS
        },
        "especially in smooth areas: there filtered errors differ by the larger factor at 1 sample": {
            name: ratio(name, 1, "filtered error where smooth") > ratio(name, 1, "filtered error elsewhere")
            for name in ALONG
        },
        "observable differences vanish: filtered errors differ by less than 1/255 at 64 samples": {
            name: abs(of(GLOBAL, 64, "filtered error") - of(name, 64, "filtered error")) < STEP
            for name in ALONG
        },
        "randomising each pass sacrifices convergence: more error than 64 samples of one sequence": (
            of(PASSES, 64, "RMS error") > of("contiguous", 64, "RMS error")
        ),
        "one sequence to shift and to sample shows artefacts: more filtered error than a shifted lattice": {
            f"{spp} spp": of(ITSELF, spp, "filtered error") > of("shifted lattice", spp, "filtered error")
            for spp in (4, 16)
        },
        "rotations suit lattices best: less error than of the Halton sequence": {
            f"{spp} spp": of("shifted lattice", spp, "RMS error") < of(ITSELF, spp, "RMS error")
            for spp in (4, 16, 64)
        },
    }

"""Hilbert paper Sect. 5: halftones by error diffusion along the Hilbert curve, beside other ways."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import ndimage

import analysis
from figures._errors import rms
from figures.making.schema import Claims
from figures.shared import judged
from figures.shared.rendered import diffusion
from figures.shared.sheets.curve_tables import Curve, curve_of
from figures.shared.sheets.image_sheets import Panel, image_grid
from qmcjax import orders, scenes

SIDE = 128
HILBERT, MORTON, ROWS = "Hilbert", "Morton", "rows"
PLANE, RANDOM = "Floyd-Steinberg", "random thresholds"
ANISOTROPY, FILTERED = "anisotropy below 1/4 cycle per pixel, dB", "filtered error of parts"

NOTE = (
    "Grey values of our interior, linear and clipped at the 98 % quantile. Along a curve each pixel is black "
    "or white, whichever is closer to its value plus the error so far, and hands its own error to the next: "
    "sums along the curve err by 1/2 at most. Rows go from left to right, each begins with the error of the "
    "row above. Velho and Gomes [28] also make clusters of pixels, which printers need; here all have one "
    "pixel. Floyd and Steinberg hand the error to four pixels of the plane. Anisotropy is the variation of "
    "the error's power among directions, in decibels: 0 or less in noise that has no preferred one. "
    "Filtered is the RMS error after a Gaussian of 1.5 pixels, compared over 16 parts of the image. "
    "The image is encoded for a screen, dots are not: seen from afar, both emit the same light."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Show an image and its halftones, and measure their errors."""
    kept = diffusion.find_kept(scenes.interior(2), SIDE)
    assert kept is not None, "the reference of the interior is another scene's"
    grey = kept.image.mean(axis=2)
    grey = np.minimum(grey / np.quantile(grey, 0.98), 1)
    made = {
        HILBERT: halftone(grey, curve_of(orders.hilbert(SIDE, SIDE))),
        PLANE: _diffuse_in_plane(grey),
        MORTON: halftone(grey, curve_of(orders.morton(SIDE, SIDE))),
        ROWS: halftone(grey, curve_of(orders.raster(SIDE, SIDE))),
        RANDOM: (np.random.default_rng(1).uniform(size=grey.shape) < grey).astype(float),
    }
    measured = {name: _measure(image, grey) for name, image in made.items()}
    panels = [Panel("image", grey, transfer="srgb")]
    for name, image in made.items():
        of = measured[name]
        text = f"{of[ANISOTROPY]:.1f} dB, filtered error {of['filtered error']:.3f}"
        panels.append(Panel(f"{name}\n{text}", image))
    title = (
        "Halftones along the Hilbert curve have no preferred direction\n"
        f"Hilbert paper, Sect. 5; {SIDE} x {SIDE} pixels, black or white\n"
        "dB: anisotropy of the error, 0 or less without preferred direction"
    )
    figure = image_grid(title, panels, 3)
    return figure, {"measured": measured, "claims": _claims(measured), "note": NOTE}


def halftone(image: NDArray[np.float64], curve: Curve) -> NDArray[np.float64]:
    """Return black and white pixels whose sums along a curve are those of the image, rounded."""
    x, y = curve.path()
    made = np.empty_like(image)
    made[y, x] = np.diff(np.floor(np.cumsum(image[y, x]) + 0.5), prepend=0)
    return made


def _diffuse_in_plane(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the halftone of Floyd and Steinberg, 1976."""
    height, width = image.shape
    rest = np.pad(image, ((0, 1), (1, 1)))
    for y in range(height):
        for x in range(1, width + 1):
            error = rest[y, x] - (rest[y, x] >= 0.5)
            rest[y, x] -= error
            rest[y, x + 1] += 7 / 16 * error
            rest[y + 1, x - 1 : x + 2] += np.array([3, 5, 1]) / 16 * error
    return rest[:height, 1:-1]


def _measure(image: NDArray[np.float64], grey: NDArray[np.float64]) -> dict:
    error = image - grey
    left = ndimage.gaussian_filter(error, 1.5, mode="wrap")
    _, variation = analysis.radial_anisotropy(analysis.error_spectrum(image, grey))
    return {
        "filtered error": rms(left),
        FILTERED: [rms(part) for part in diffusion.in_parts(left)],
        ANISOTROPY: float(variation[: SIDE // 4].mean()),
    }


def _claims(measured: dict) -> Claims:
    others = (PLANE, MORTON, ROWS)
    return {
        "halftones along the Hilbert curve have no preferred direction: less anisotropy than others": {
            name: measured[HILBERT][ANISOTROPY] < min(0, measured[name][ANISOTROPY]) for name in others
        },
        "halftones along the Hilbert curve have less filtered error": {
            name: judged.smaller(measured[HILBERT][FILTERED], measured[name][FILTERED])
            for name in (*others, RANDOM)
        },
    }

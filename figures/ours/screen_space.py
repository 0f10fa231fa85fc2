"""Images of all screen-space methods for the page's slider, and radial spectra of their errors."""

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.making.schema import Claims
from figures.shared.integrands import screen_space
from figures.shared.integrands.screen_space import FAMILIES, INTEGRALS, Measures
from figures.shared.sheets.curves import titled

COUNTS = (1, 4, 16, 64)
BINS = 32
"""Of the frequencies of a radial spectrum."""
HANDED_OUT = 128
"""Pixels a side, at most, of the images of the slider."""

OPTIMISED = ("dither, vectors", "ranked keys")

ALIKE, DIFFUSED = 1.25, 0.5
"""Up to which factor errors are comparable, and below which power at low frequencies they are diffused."""

LARGE = 64
"""Samples per pixel from which on optimised keys are said to diffuse errors no more; masks are from 2 on."""

NOTE = (
    "{side} x {side} pixels, {counts} samples per pixel. Each pixel estimates integrals of the two "
    f"coordinates that it samples, the same in every pixel: x y, a disc of radius {screen_space.RADIUS}, x + "
    f"y < 1, and exp(-{screen_space.SHARPNESS:.0f} |p - {screen_space.CENTRE}|^2), the bump. An image of the "
    "slider has one of them in each quarter, in this order, and would be flat there without error. Errors "
    "are against the exact integrals; power is 1 for white noise, low is the radial mean below 1/16 of a "
    "cycle per pixel, filtered the RMS error after a Gaussian of 1.5 pixels; images are taken as periodic. "
    "The global sequences show their dimensions 2 and 3, since 0 and 1 are the pixel. Peano's curve fills "
    "3**k pixels a side, of which a part is used. One key for what is random. At one sample per pixel, "
    "segments and the shifted lattice are the contiguous blocks of their Halton components."
)

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]


def make(
    quality: str, progress: Callable[[float], None]
) -> tuple[Figure, dict, dict[str, NDArray[np.float64]]]:
    """Measure all methods, draw spectra of their errors by families, and hand their images out."""
    side = screen_space.SIDE[quality]
    exact = np.broadcast_to(list(INTEGRALS.values()), (side, side, len(INTEGRALS)))
    images = {f"exact: {', '.join(INTEGRALS)}": _quarters(exact)}
    powers: dict[int, dict[str, Curve]] = {}
    measured: dict[str, dict[str, Measures]] = {}
    claims: Claims = {}
    for done, spp in enumerate(COUNTS, start=1):
        powers[spp], found = {}, {}
        for name, method in screen_space.methods().items():
            image, found[name] = screen_space.measure(method, side, spp)
            powers[spp][name] = _radial_power(image - exact)
            images[f"{name}, {spp} spp"] = _quarters(image)
        measured[f"{spp} spp"] = found
        claims |= {f"{claim}, at {spp} spp": held for claim, held in _claims(found, spp).items()}
        progress(done / len(COUNTS))
    table = [
        {"sampler": name, "spp": spp, "cycles per pixel": float(cycles), "power": float(value)}
        for spp, of in powers.items()
        for name, curve in of.items()
        for cycles, value in zip(*curve, strict=True)
    ]
    note = NOTE.format(side=side, counts=", ".join(map(str, COUNTS)))
    return (
        _drawn(powers, side),
        {"measured": measured, "claims": claims, "table": table, "note": note},
        images,
    )


def _quarters(image: NDArray) -> NDArray[np.float64]:
    """Return one image of four integrands, shape (side, side, 4), with each in its quarter."""
    side = min(len(image), HANDED_OUT)
    y, x = np.indices((side, side))
    return np.asarray(image[y, x, 2 * (y >= side // 2) + (x >= side // 2)], np.float64)


def _radial_power(errors: NDArray[np.float64]) -> Curve:
    """Return frequencies, in cycles per pixel, and the mean power over the integrands, in BINS of them."""
    none = np.zeros(errors.shape[:2])
    spectra = [analysis.error_spectrum(of, none) for of in np.moveaxis(errors, -1, 0) if np.ptp(of)]
    frequency, power = analysis.radial_average(np.mean(spectra, axis=0))
    return frequency.reshape(BINS, -1).mean(axis=1) / len(errors), power.reshape(BINS, -1).mean(axis=1)


def _drawn(powers: Mapping[int, Mapping[str, Curve]], side: int) -> Figure:
    """Draw radial spectra: a row for each number of samples, a column for each family."""
    figure = titled(
        "Consecutive blocks of one sequence along a curve keep errors out of low frequencies, at all counts\n"
        f"radial power spectra of errors, {len(INTEGRALS)} integrands, {side} x {side} pixels, one key",
        3 * len(FAMILIES),
        2.4 * len(powers) + 1.6,
    )
    panels = figure.subplots(len(powers), len(FAMILIES), sharex=True, sharey=True, squeeze=False)
    for row, (spp, of) in zip(panels, powers.items(), strict=True):
        for axes, names in zip(row, FAMILIES.values(), strict=True):
            axes.axhline(1, color="0.6", lw=0.8, zorder=0)
            for k, name in enumerate(names):
                drawn = plot.style(name)
                look = {"color": drawn.color, "marker": drawn.marker, "ms": 5, "lw": 1.2, "label": name}
                axes.plot(*of[name], drawn.line, markevery=(k, len(names)), **look)
            axes.grid(alpha=0.3)
        samples = f"{spp} sample{'s' * (spp > 1)} per pixel"
        row[0].set_ylabel(f"{samples}\npower (white noise: 1)")
    panels[0, 0].set(yscale="log", ylim=(0.01, 20), xlim=(0, 0.5))
    for axes, family in zip(panels[0], FAMILIES, strict=True):
        axes.set_title(family)
    for axes in panels[-1]:
        axes.set_xlabel("cycles per pixel")
        axes.legend(loc="upper left", bbox_to_anchor=(0, -0.25), frameon=False, handlelength=3)
    return figure


def _claims(measured: Mapping[str, Measures], spp: int) -> Claims:
    def least(names: tuple[str, ...], integrand: str) -> float:
        return min(measured[name][integrand]["filtered error"] for name in names)

    def low(name: str) -> dict[str, float]:
        return {integrand: of["low-frequency power"] for integrand, of in measured[name].items()}

    def diffuses(what: str, name: str) -> dict[str, dict[str, bool]]:
        claim = f"{what}: less than half of white noise at low frequencies"
        return {claim: {integrand: power < DIFFUSED for integrand, power in low(name).items()}}

    def fails(what: str, name: str) -> dict[str, dict[str, bool]]:
        claim = f"{what} no more: at least half of white noise at low frequencies"
        return {claim: {integrand: power >= DIFFUSED for integrand, power in low(name).items()}}

    along = tuple(name for name in measured if name.startswith("Hilbert"))
    mask, keys = OPTIMISED
    return (
        {
            "along the Hilbert curve errors are as small from afar as with optimised masks and keys": {
                integrand: least(along, integrand) < ALIKE * least(OPTIMISED, integrand)
                for integrand in INTEGRALS
            }
        }
        | (diffuses if spp == 1 else fails)("a mask diffuses errors", mask)
        | (diffuses if spp < LARGE else fails)("optimised keys diffuse errors", keys)
        | diffuses("Z diffuses errors", "Z, tree")
    )

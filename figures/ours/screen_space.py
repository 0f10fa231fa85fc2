"""Images of all screen-space methods for the page's slider, and radial spectra of their errors."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.special import erf

import analysis
from figures import plot
from figures._errors import rms
from figures._rc import LETTERS
from figures.making.schema import UNDECIDED, Claims, Found
from figures.shared import judged
from figures.shared.sheets.panels import new_figure
from qmcjax import orders, samplers, sequences

KEY, KEYS = 1, 16
"""The first key, of images and spectra, and how many keys filtered errors are compared over."""
SIDE = {"draft": 64, "paper": 256}
RADIUS, SHARPNESS, CENTRE = 0.4, 10.0, (0.4, 0.55)


def _integrands(point: Array) -> Array:
    x, y = point[..., 0], point[..., 1]
    inside = (x - 0.5) ** 2 + (y - 0.5) ** 2 < RADIUS**2
    bump = jnp.exp(-SHARPNESS * ((x - CENTRE[0]) ** 2 + (y - CENTRE[1]) ** 2))
    return jnp.stack([x * y, 1.0 * inside, 1.0 * (x + y < 1), bump], axis=-1)


def _bump() -> float:
    root = np.sqrt(SHARPNESS)
    parts = [0.5 * np.sqrt(np.pi) / root * (erf(root * (1 - c)) + erf(root * c)) for c in CENTRE]
    return float(np.prod(parts))


INTEGRALS = {"x y": 0.25, "disc": np.pi * RADIUS**2, "x + y < 1": 0.5, "bump": _bump()}


def _placed(key: int) -> NDArray[np.float64]:
    return np.roll(np.rot90(samplers.blue_noise_mask(2), key - KEY), 17 * (key - KEY), axis=(0, 1))


Measures = dict[str, dict[str, float]]
"""By integrand."""


class Method(NamedTuple):
    """A sampler of a square image for some samples per pixel."""

    make: Callable[[int, int], samplers.Sampler]
    dims: tuple[int, int] = (0, 1)
    """The coordinates that are shown."""


def _along(order, sequence) -> Method:
    return Method(lambda side, spp: samplers.contiguous(order(side, side), sequence, spp))


def methods(key: int = KEY) -> dict[str, Method]:
    """Return the methods by name, each as its paper has it; a mask is placed anew for each key."""
    sobol, halton = sequences.sobol(2), sequences.halton(2)
    dithered = sequences.lattice(2)
    permuted = sequences.halton(3, "faure_lemieux")
    return {
        "random": _along(orders.raster, sequences.uniform(2, key)),
        "(0,2), xor per pixel": Method(lambda side, spp: samplers.independent(sobol, key, "xor")),
        "(0,2), Owen per pixel": Method(lambda side, spp: samplers.independent(sobol, key)),
        "lattice, rotated": Method(lambda side, spp: samplers.independent(dithered, key, "shift")),
        "global Sobol'": Method(
            lambda side, spp: samplers.full_screen(sequences.sobol(4), side, side), dims=(2, 3)
        ),
        "global Halton": Method(
            lambda side, spp: samplers.full_screen(sequences.halton(4), side, side), dims=(2, 3)
        ),
        "dither, vectors": Method(lambda side, spp: samplers.dither(_placed(key), dithered)),
        "ranked keys": Method(lambda side, spp: samplers.ranked(2, key)),
        "Z0": Method(lambda side, spp: samplers.z(side, side, spp, None, "plain")),
        "Z, hash": Method(lambda side, spp: samplers.z(side, side, spp, key)),
        "Z, tree": Method(lambda side, spp: samplers.z(side, side, spp, key, "tree")),
        "Z, ART": Method(lambda side, spp: samplers.z(side, side, spp, key, "art")),
        "Hilbert, Halton (2,3)": _along(orders.hilbert, halton),
        "Hilbert, Halton (3,5)": _along(orders.hilbert, sequences.components(sequences.halton(3), (1, 2))),
        "Hilbert, Owen-Sobol'": _along(orders.hilbert, sequences.owen(sobol, key)),
        "Moore, Halton (2,3)": _along(orders.moore, halton),
        "Peano, Halton (2,5)": _along(orders.peano, sequences.components(sequences.halton(3), (0, 2))),
        "Hilbert, shifted lattice": Method(
            lambda side, spp: samplers.shifted(orders.hilbert(side, side), permuted, sequences.lattice(3))
        ),
        "Hilbert, segments (3,5)": Method(
            lambda side, spp: samplers.segments(
                orders.hilbert(side, side), sequences.components(sequences.halton(3), (1, 2)), 1
            )
        ),
        "Hilbert, partitioned": Method(
            lambda side, spp: samplers.partitioned(
                orders.hilbert(side, side), sequences.halton(3), exact=True
            )
        ),
    }


def measure(method: Method, side: int, spp: int) -> tuple[NDArray[np.float64], Measures]:
    """Return an image of each integrand, shape (side, side, 4), and the measures of their errors."""
    image = analysis.pixel_means(_integrands, method.make(side, spp), side, side, spp, method.dims)
    image = np.asarray(image, np.float64)
    measured = {}
    for k, (name, exact) in enumerate(INTEGRALS.items()):
        error, none = image[..., k] - exact, np.zeros((side, side))
        measured[name] = {
            "RMS error": rms(error),
            # An error that is the same in all pixels has no spectrum.
            "low-frequency power": analysis.low_frequency_power(error, none) if np.ptp(error) else 0.0,
            "filtered error": analysis.filtered_error(error, none),
        }
    return image, measured


FAMILIES = {
    "in each pixel": ("random", "(0,2), xor per pixel", "(0,2), Owen per pixel", "lattice, rotated"),
    "over the screen, or optimised": ("global Sobol'", "global Halton", "dither, vectors", "ranked keys"),
    "along Morton's curve": ("Z0", "Z, hash", "Z, tree", "Z, ART"),
    "blocks of samples along a curve": (
        "Hilbert, Halton (2,3)",
        "Hilbert, Halton (3,5)",
        "Hilbert, Owen-Sobol'",
        "Moore, Halton (2,3)",
        "Peano, Halton (2,5)",
    ),
    "otherwise along Hilbert's curve": (
        "Hilbert, shifted lattice",
        "Hilbert, segments (3,5)",
        "Hilbert, partitioned",
    ),
}


COUNTS = (1, 4, 16, 64)
BINS = 32
"""Of the frequencies of a radial spectrum."""
HANDED_OUT = 128
"""Pixels a side, at most, of the images of the slider."""

ZERO_TWO = ("(0,2), xor per pixel", "(0,2), Owen per pixel")
SHIFTS, MASK, RANKED, Z = "lattice, rotated", "dither, vectors", "ranked keys", "Z, tree"
KEYED = (*ZERO_TWO, SHIFTS, MASK, RANKED, Z, "Hilbert, Owen-Sobol'")
"""Methods that have a key."""

ALONG = tuple(name for of in FAMILIES.values() for name in of if name.startswith("Hilbert"))

ALIKE = 1.25
"""Up to which factor filtered errors are comparable."""

LARGE = 64
"""Samples per pixel from which on optimised keys are said to diffuse errors no more."""

NOTE = (
    f"{{side}} x {{side}} pixels, {{counts}} samples per pixel. Each pixel estimates the same integrals "
    f"of its two coordinates: x y, a disc of radius {RADIUS}, x + y < 1, and exp(-{SHARPNESS:.0f} |p - "
    f"{CENTRE}|^2), the bump. Images of the slider show one in each quarter, in this order; without "
    "error, quarters are flat. Errors are against the exact integrals; power is 1 for white noise, "
    "'low' its radial mean below 1/16 cycle per pixel, 'filtered' the RMS error after a Gaussian of 1.5 "
    "pixels; images are periodic. Global sequences show their dimensions 2 and 3, as 0 and 1 are the "
    "pixel. Peano's curve fills 3**k x 3**k pixels, of which a part is used. Images and spectra are of "
    f"one key; filtered errors are compared over {KEYS}, for each of which the mask is turned and moved; "
    "deterministic methods have the same error for all. At one sample per pixel, segments and the "
    "shifted lattice equal contiguous blocks of their Halton components."
)

Errors = dict[str, NDArray[np.float64]]
Curve = tuple[NDArray[np.float64], NDArray[np.float64]]


def make(
    quality: str, progress: Callable[[float], None]
) -> tuple[Figure, dict, dict[str, NDArray[np.float64]]]:
    """Measure all methods, draw spectra of their errors by families, and hand their images out."""
    side = SIDE[quality]
    exact = np.broadcast_to(list(INTEGRALS.values()), (side, side, len(INTEGRALS)))
    images = {f"exact: {', '.join(INTEGRALS)}": _quarters(exact)}
    powers: dict[int, dict[str, Curve]] = {}
    measured: dict[str, dict[str, Measures]] = {}
    errors: dict[int, Errors] = {}
    for done, spp in enumerate(COUNTS, start=1):
        powers[spp], found = {}, {}
        for name, method in methods().items():
            image, found[name] = measure(method, side, spp)
            powers[spp][name] = _radial_power(image - exact)
            images[f"{name}, {spp} spp"] = _quarters(image)
        measured[f"{spp} spp"] = found
        errors[spp] = _filtered(side, spp)
        progress(done / len(COUNTS))
    table = [
        {"sampler": name, "spp": spp, "cycles per pixel": float(cycles), "power": float(value)}
        for spp, of in powers.items()
        for name, curve in of.items()
        for cycles, value in zip(*curve, strict=True)
    ]
    ratios = {f"filtered errors, {spp} spp": _ratios(of) for spp, of in errors.items()}
    claims = {
        f"{claim}, at {spp} spp": held
        for spp, of in errors.items()
        for claim, held in _claims(of, errors[1], spp).items()
    }
    note = NOTE.format(side=side, counts=", ".join(map(str, COUNTS)))
    return (
        _draw(powers, side),
        {"measured": measured | ratios, "claims": claims, "table": table, "note": note},
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


def _draw(powers: Mapping[int, Mapping[str, Curve]], side: int) -> Figure:
    """Draw radial spectra: a row for each family, a column for the least and the most samples."""
    figure = new_figure(
        "Blocks of one sequence along a curve keep errors out of low frequencies\n"
        f"radial power spectra of errors, {len(INTEGRALS)} integrands, {side} x {side} pixels, one key",
        8.2,
    )
    shown = (COUNTS[0], COUNTS[-1])
    panels = figure.subplots(len(FAMILIES), len(shown), sharex=True, sharey=True)
    for row, (family, names) in zip(panels, FAMILIES.items(), strict=True):
        for axes, spp in zip(row, shown, strict=True):
            axes.axhline(1, color="0.6", lw=0.8, zorder=0)
            for k, name in enumerate(names):
                drawn = plot.style(name)
                look = {"color": drawn.color, "marker": drawn.marker, "ms": 4, "lw": 1, "label": name}
                axes.plot(*powers[spp][name], drawn.line, markevery=(k, len(names)), **look)
            axes.grid(alpha=0.3)
        title = family.replace(" along", "\nalong").replace(", or", ",\nor")
        row[-1].legend(
            loc="upper left", bbox_to_anchor=(1, 1.1), frameon=False, title=title, alignment="left"
        )
    panels[0, 0].set(yscale="log", ylim=(0.01, 20), xlim=(0, 0.5))
    for axes, spp in zip(panels[0], shown, strict=True):
        axes.set_title(f"{spp} sample{'s' * (spp > 1)} per pixel")
    figure.supxlabel("cycles per pixel", fontsize=LETTERS)
    figure.supylabel("power (white noise: 1)", fontsize=LETTERS)
    return figure


def _filtered(side: int, spp: int) -> Errors:
    """Return filtered errors, (keys, integrands), of the methods that are compared."""
    of_keys = [methods(KEY + k) for k in range(KEYS)]
    found = {}
    for name in dict.fromkeys((*KEYED, *ALONG)):
        made = [each[name] for each in (of_keys if name in KEYED else of_keys[:1])]
        errors = [[of["filtered error"] for of in measure(each, side, spp)[1].values()] for each in made]
        found[name] = np.broadcast_to(errors, (KEYS, len(INTEGRALS)))
    return found


def _along_over_optimised(errors: Errors) -> dict[str, NDArray[np.float64]]:
    """Return logarithms, (keys,), of the mean ratio over integrands to the better of mask and ranked keys."""
    least = np.minimum(errors[MASK], errors[RANKED])
    return {name: np.log(errors[name] / least).mean(axis=1) for name in ALONG}


def _diffuses(errors: Errors, name: str) -> dict[str, Found]:
    """Return whether filtered errors are below those of both scramblings of the (0,2)-sequence."""
    return {
        integrand: judged.all_of(*(judged.smaller(errors[name][:, k], errors[of][:, k]) for of in ZERO_TWO))
        for k, integrand in enumerate(INTEGRALS)
    }


def _ratios(errors: Errors) -> dict[str, dict[str, dict[str, float]]]:
    pairs = [(one, other) for one in (Z, RANKED) for other in ZERO_TWO] + [(MASK, SHIFTS)]
    logs = _along_over_optimised(errors)
    return {
        f"{one} over {other}": {
            integrand: judged.ratio(errors[one][:, k], errors[other][:, k])
            for k, integrand in enumerate(INTEGRALS)
        }
        for one, other in pairs
    } | {"over mask or keys": {name: judged.of_logarithms(of)._asdict() for name, of in logs.items()}}


def _claims(errors: Errors, single: Errors, spp: int) -> Claims:
    """Return what holds of the filtered errors of a count; ``single`` are those at one sample per pixel."""
    claims: Claims = {
        "along the Hilbert curve errors are as small from afar as with optimised masks and keys": {
            name: judged.below(logs, float(np.log(ALIKE)))
            for name, logs in _along_over_optimised(errors).items()
        },
        "Z diffuses errors: less filtered error than (0,2)": _diffuses(errors, Z),
    }
    now, then = (of[MASK] / of[SHIFTS] for of in (errors, single))
    if spp == 1:
        claims["a mask diffuses errors: less filtered error than random shifts"] = {
            integrand: judged.smaller(now[:, k], np.ones(KEYS)) for k, integrand in enumerate(INTEGRALS)
        }
    else:
        claims["the effect of a mask diminishes: less gain over random shifts than at 1 spp"] = {
            integrand: judged.smaller(then[:, k], now[:, k]) for k, integrand in enumerate(INTEGRALS)
        }
    keys = _diffuses(errors, RANKED)
    if spp < LARGE:
        claims["optimised keys diffuse errors: less filtered error than (0,2)"] = keys
    else:
        claims["optimised keys diffuse errors no more: not less filtered error than (0,2)"] = {
            integrand: held if held == UNDECIDED else not held for integrand, held in keys.items()
        }
    return claims

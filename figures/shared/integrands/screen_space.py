"""Methods of both rendering papers and their competitors, on integrands that are the same in every pixel."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.special import erf

import analysis
from figures._errors import rms
from qmcjax import orders, samplers, sequences

KEY = 1
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


Measures = dict[str, dict[str, float]]
"""By integrand."""


class Method(NamedTuple):
    """A sampler of a square image for some samples per pixel."""

    make: Callable[[int, int], samplers.Sampler]
    dims: tuple[int, int] = (0, 1)
    """The coordinates that are shown."""


def _along(order, sequence) -> Method:
    return Method(lambda side, spp: samplers.contiguous(order(side, side), sequence, spp))


def methods() -> dict[str, Method]:
    """Return the methods by name, each as its paper has it."""
    sobol, halton = sequences.sobol(2), sequences.halton(2)
    dithered = sequences.lattice(2)
    permuted = sequences.halton(3, "faure_lemieux")
    return {
        "random": _along(orders.raster, sequences.uniform(2, KEY)),
        "(0,2), xor per pixel": Method(lambda side, spp: samplers.independent(sobol, KEY, "xor")),
        "(0,2), Owen per pixel": Method(lambda side, spp: samplers.independent(sobol, KEY)),
        "lattice, rotated": Method(lambda side, spp: samplers.independent(dithered, KEY, "shift")),
        "global Sobol'": Method(
            lambda side, spp: samplers.full_screen(sequences.sobol(4), side, side), dims=(2, 3)
        ),
        "global Halton": Method(
            lambda side, spp: samplers.full_screen(sequences.halton(4), side, side), dims=(2, 3)
        ),
        "dither, vectors": Method(lambda side, spp: samplers.dither(samplers.blue_noise_mask(2), dithered)),
        "ranked keys": Method(lambda side, spp: samplers.ranked(2, KEY)),
        "Z0": Method(lambda side, spp: samplers.z(side, side, spp, None, "plain")),
        "Z, hash": Method(lambda side, spp: samplers.z(side, side, spp, KEY)),
        "Z, tree": Method(lambda side, spp: samplers.z(side, side, spp, KEY, "tree")),
        "Z, ART": Method(lambda side, spp: samplers.z(side, side, spp, KEY, "art")),
        "Hilbert, Halton (2,3)": _along(orders.hilbert, halton),
        "Hilbert, Halton (3,5)": _along(orders.hilbert, sequences.components(sequences.halton(3), (1, 2))),
        "Hilbert, Owen-Sobol'": _along(orders.hilbert, sequences.owen(sobol, KEY)),
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

"""Z paper Fig. 3: a soft shadow at one sample per pixel, with the (0,2)-sequence and in Morton order."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
import qmcjax as qj
from figures._errors import rms
from figures.shared import image_sheets
from figures.shared.curve_tables import EXPLAINED, structure
from figures.shared.image_sheets import Row
from qmcjax import orders, samplers, sequences
from qmcjax.core.pytrees import pytree

SIDE, KEY = 256, 1
REFERENCE_SPP = {"draft": 256, "paper": 4096}

SECTORS = 16
LOW = "power at low frequencies"
DIRECTIONS = "standard deviation of the power over directions / mean"

TOP, LEFT, CROP = 32, 96, 64
"""The magnified area, in pixels: in the penumbra."""

NOTE = (
    "The paper renders a scene of its own; here a disc casts the shadow of a square light onto the floor, "
    "seen from above: four dimensions, two of the pixel and two of the light. At one sample per pixel, the "
    "(0,2)-sequence with its xor scrambling is one random point in each pixel. Z0 has the same samples for "
    "pixel and light, as the paper says of it. The reference has {spp} samples per pixel; the error is the "
    f"difference from it, black where the image is too dark. {EXPLAINED}"
)


@pytree
@dataclass(frozen=True)
class SoftShadow:
    """The part of a square light above the floor's middle that a disc, halfway up, leaves visible."""

    light: Array | float
    """Side of the light; that of the floor is 1."""

    radius: Array | float
    """Of the disc."""

    needs: ClassVar[tuple[str, ...]] = ("x", "y", "light", "light")

    def __call__(self, point: Array) -> Array:
        """Return 1 where the floor sees the point on the light, else 0."""
        light, radius = (jnp.asarray(value).astype(point.dtype) for value in (self.light, self.radius))
        x, y, u, v = (point[..., j] - 0.5 for j in range(4))
        squared = (0.5 * (x + light * u)) ** 2 + (0.5 * (y + light * v)) ** 2
        return jnp.where(squared < radius**2, 0.0, 1.0).astype(point.dtype)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render the shadow with the samplers, show the spectra of their errors, and hand the images out."""
    scene, spp = SoftShadow(0.5, 0.2), REFERENCE_SPP[quality]
    compared = {
        "(0,2)-sequence, xor-scrambled": samplers.independent(sequences.sobol(4), KEY, randomize="xor"),
        "Z0": samplers.z(SIDE, SIDE, 1, None, "plain", dims=4),
        "Z, of the next section": samplers.z(SIDE, SIDE, 1, KEY, dims=4),
    }
    images = {
        name: np.asarray(qj.render(scene, sampler, SIDE, SIDE, 1), np.float64)
        for name, sampler in compared.items()
    }
    progress(0.3)
    many = samplers.contiguous(orders.morton(SIDE, SIDE), sequences.owen(sequences.sobol(4), KEY), spp)
    reference = np.asarray(qj.render(scene, many, SIDE, SIDE, spp), np.float64)
    progress(0.9)
    shown = {**images, f"reference, {spp} spp": reference}
    area = np.s_[TOP : TOP + CROP, LEFT : LEFT + CROP]
    spectra = {name: analysis.error_spectrum(image, reference) for name, image in images.items()}
    title = (
        "A soft shadow at one sample per pixel, with and without Morton order (Z paper, Fig. 3)\n"
        f"a disc below a square light, {SIDE} x {SIDE} pixels, one key; low frequencies: power below 1/16 "
        "of a cycle per pixel"
    )
    measured = {
        name: {"RMS error": rms(image - reference)}
        | structure(image - reference)
        | {DIRECTIONS: _directions(spectra[name])}
        for name, image in images.items()
    }
    captions = {name: f"RMS error {of['RMS error']:.3f}" for name, of in measured.items()}
    low = {name: f"low frequencies: {of[LOW]:.2f}" for name, of in measured.items()}
    rows = {
        "image": Row(shown, marked=(LEFT, TOP, CROP)),
        f"magnified {SIDE // CROP} times": Row({name: image[area] for name, image in shown.items()}),
        "image - reference": image_sheets.errors(images, reference, captions),
        "spectrum of the error": image_sheets.spectra(spectra, low),
    }
    numbers = {"measured": measured, "claims": _claims(*measured.values()), "note": NOTE.format(spp=spp)}
    return image_sheets.image_sheet(title, rows, panel=SIDE), numbers, {"reference": reference, **images}


def _directions(spectrum: NDArray) -> float:
    """Return how much the power differs between directions, below a quarter of a cycle per pixel."""
    y, x = np.meshgrid(*(np.fft.fftfreq(side) for side in spectrum.shape), indexing="ij")
    radius, angle = np.hypot(x, y), np.arctan2(y, x) % np.pi
    seen = (radius > 0) & (radius < 0.25)
    sector = (angle[seen] / (np.pi / SECTORS)).astype(int) % SECTORS
    power = np.bincount(sector, spectrum[seen]) / np.bincount(sector)
    return float(power.std() / power.mean())


def _claims(
    random: dict[str, float], morton: dict[str, float], scrambled: dict[str, float]
) -> dict[str, bool]:
    share = "share of the strongest 1 % of frequencies"
    return {
        "excellent error diffusion: Z0 has less than half the power at low frequencies": morton[LOW]
        < 0.5 * random[LOW],
        "significant aliasing: Z0 has more than twice the share of the strongest frequencies": morton[share]
        > 2 * random[share],
        "Z0 prefers directions: its power differs more than twice as much as that of (0,2)": morton[
            DIRECTIONS
        ]
        > 2 * random[DIRECTIONS],
        "scrambling makes it more isotropic: less than half of that": scrambled[DIRECTIONS]
        < 0.5 * morton[DIRECTIONS],
    }

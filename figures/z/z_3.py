"""Z paper Fig. 3: a soft shadow at one sample per pixel, with the (0,2)-sequence and in Morton order."""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures._errors import rms
from figures.shared import judged
from figures.shared.rendered import scene_images
from figures.shared.sheets import image_sheets
from figures.shared.sheets.curve_tables import EXPLAINED, POWER, SHARE, structure
from figures.shared.sheets.image_sheets import Row
from qmcjax import samplers, sequences
from qmcjax.core.pytrees import pytree

SIDE, KEY, KEYS = 256, 1, 16
NODES = 128
"""Of each of three intervals of the exact image: errors are below 1e-5."""

EXCELLENT = 0.7
SECTORS = 16
DIRECTIONS = "standard deviation of the power over directions / mean"

TOP, LEFT, CROP = 32, 96, 64
"""The magnified area, in pixels: in the penumbra."""

NOTE = (
    "Our scene: a disc casts the shadow of a square light onto the floor, seen from above, with two "
    "dimensions each for pixel and light. At one sample per pixel, the xor-scrambled (0,2)-sequence is "
    "one random point per pixel. Z0 uses the same samples for pixel and light, as the paper says. The "
    f"reference is exact up to 1e-5. {EXPLAINED}"
)


@pytree
@dataclass(frozen=True)
class SoftShadow:
    """The part of a square light above the floor's middle that a disc, halfway up, leaves visible."""

    light: Array | float
    """Side of the light; that of the floor is 1."""

    radius: Array | float
    """Of the disc."""

    needs = ("x", "y", "light", "light")

    def __call__(self, point: Array) -> Array:
        """Return 1 where the floor sees the point on the light, else 0."""
        light, radius = (jnp.asarray(value).astype(point.dtype) for value in (self.light, self.radius))
        x, y, u, v = (point[..., j] - 0.5 for j in range(4))
        squared = (0.5 * (x + light * u)) ** 2 + (0.5 * (y + light * v)) ** 2
        return jnp.where(squared < radius**2, 0.0, 1.0).astype(point.dtype)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render the shadow with the samplers, show the spectra of their errors, and hand the images out."""
    scene = SoftShadow(0.5, 0.2)
    compared = {
        "(0,2)-sequence, xor-scrambled": _zero_two(KEY),
        "Z0": samplers.z(SIDE, SIDE, 1, None, "plain", dims=4),
        "Z, scrambled": samplers.z(SIDE, SIDE, 1, KEY, dims=4),
    }
    drawn = scene_images.quickly_compiled(scene, quality)
    images = {name: scene_images.rendered(drawn, sampler, SIDE, 1) for name, sampler in compared.items()}
    progress(0.5)
    reference = exact(scene, SIDE)
    area = np.s_[TOP : TOP + CROP, LEFT : LEFT + CROP]
    spectra = {name: analysis.error_spectrum(image, reference) for name, image in images.items()}
    title = (
        "The Morton order diffuses the error, scrambling removes its preferred directions\n"
        "Z paper, Fig. 3; a soft shadow at one sample per pixel\n"
        f"a disc below a square light, {SIDE} x {SIDE} pixels, one key; low: mean power below 1/16 cycle "
        "per pixel"
    )
    measured = {
        name: {"RMS error": rms(image - reference)}
        | structure(image - reference)
        | {DIRECTIONS: _directions(spectra[name])}
        for name, image in images.items()
    }
    captions = {name: f"RMS error {of['RMS error']:.3f}" for name, of in measured.items()}
    low = {name: f"low: {of[POWER]:.2f}" for name, of in measured.items()}
    rows = {
        "image": Row(images, captions=captions, marked=(LEFT, TOP, CROP)),
        f"magnified {SIDE // CROP} times": Row({name: image[area] for name, image in images.items()}),
        "spectrum of the error": image_sheets.spectra(spectra, low),
    }
    random = [_zero_two(KEY + k) for k in range(KEYS)]
    filtered = [
        analysis.filtered_error(scene_images.rendered(drawn, each, SIDE, 1), reference) for each in random
    ]
    of_morton = np.full(KEYS, analysis.filtered_error(images["Z0"], reference))
    claims = {
        "excellent error diffusion: Z0 has less than 0.7 times the filtered error of (0,2)": (
            judged.smaller(of_morton, filtered, EXCELLENT)
        ),
    } | _claims(*measured.values())
    measured["filtered error, Z0 over (0,2)"] = judged.ratio(of_morton, filtered)
    numbers = {"measured": measured, "claims": claims, "note": NOTE}
    return image_sheets.image_sheet(title, rows), numbers, {"reference": reference, **images}


def _zero_two(key: int) -> samplers.Sampler:
    return samplers.independent(sequences.sobol(4), key, randomize="xor")


def exact(scene: SoftShadow, side: int) -> NDArray[np.float64]:
    """Return the mean over each pixel.

    A ray meets the disc's plane halfway: each coordinate there is half the sum of two uniform ones, of the
    pixel and of the light, and light arrives where the squares of both sums exceed that of the diameter. One
    integral over an angle remains.
    """
    light, diameter, pixel = float(scene.light), 2 * float(scene.radius), 0.5 / side
    inner, outer = abs(light / 2 - pixel), light / 2 + pixel
    centre = (np.arange(side) + 0.5) / side - 0.5

    def integrated(z: NDArray) -> NDArray:
        """Return the antiderivative of the distribution function of the light's coordinate."""
        inside = np.square(z + light / 2) / (2 * light)
        return np.where(z < -light / 2, 0, np.where(z < light / 2, inside, z))

    def below(z: NDArray) -> NDArray:
        """Return the probability of a sum below a value."""
        return (integrated(z + pixel) - integrated(z - pixel)) / (2 * pixel)

    def density(z: NDArray) -> NDArray:
        return np.clip((outer - abs(z)) / (2 * pixel * light), 0, 1 / max(light, 2 * pixel))

    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    kinks = np.array([-outer, -inner, inner, outer])
    shadow = np.zeros((side, side))
    for column, x in enumerate(centre):
        ends = np.arcsin(np.clip((x + kinks) / diameter, -1, 1))
        half = np.diff(ends)[:, None] / 2
        angle = ((ends[:-1] + ends[1:])[:, None] / 2 + half * nodes).ravel()
        chord = diameter * np.cos(angle)
        weight = (half * weights).ravel() * density(diameter * np.sin(angle) - x) * chord
        covered = below(chord - centre[:, None]) - below(-chord - centre[:, None])
        shadow[:, column] = covered @ weight
    return np.clip(1 - shadow, 0, 1)


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
    return {
        "significant aliasing: Z0 has more than twice the share of the strongest frequencies": (
            morton[SHARE] > 2 * random[SHARE]
        ),
        "Z0 prefers directions: its power differs more than twice as much as that of (0,2)": (
            morton[DIRECTIONS] > 2 * random[DIRECTIONS]
        ),
        "scrambling makes it more isotropic: less than half of that": (
            scrambled[DIRECTIONS] < 0.5 * morton[DIRECTIONS]
        ),
    }

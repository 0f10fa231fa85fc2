"""References of rendered scenes, and filtered errors of images, about what the eye sees at a distance.

Run as a program, the module estimates the reference anew that is kept beside it: means of pixels over
randomised replicates.
"""

from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.making import finished_cells
from figures.shared.rendered import scene_images
from qmcjax import samplers, scenes, sequences
from qmcjax.core.checkpoints import digest
from qmcjax.scenes import traced

FILE = Path(__file__).with_name("interior_of_two_bounces.npz")
"""The drafts of four figures show it; the package has the reference of six bounces."""

KEPT_SIDE, KEPT_SPP = 128, 16
"""Pixels along a side, and samples per pixel of each randomised image."""


class Kept(NamedTuple):
    image: NDArray[np.float64]
    """(side, side, 3)."""
    error: NDArray[np.float64]
    """Standard errors, in the image's shape."""
    spp: int
    """Samples of each pixel."""


def find_kept(scene: Any, side: int) -> Kept | None:
    """Return the reference of a scene if it is kept, for an image whose side divides that of the kept one."""
    image, error, content = _read()
    if side > len(image) or len(image) % side or not content.matches(traced.content(scene)):
        return None
    step = len(image) // side
    blocks = side, step, side, step, 3
    means, variances = (of.reshape(blocks).mean(axis=(1, 3)) for of in (image, np.square(error)))
    return Kept(means, np.sqrt(variances) / step, step**2 * REPLICATES * KEPT_SPP)


@cache
def _read() -> tuple[NDArray[np.float64], NDArray[np.float64], traced.Content]:
    with np.load(FILE) as kept:
        image, error = (kept[name].astype(np.float64) for name in ("image", "error"))
        return image, error, traced.Content(kept["numbers"], str(kept["choices"]))


REPLICATES = 16

DEVIATIONS = 5
"""Standard errors in the bound of a stored reference."""

Area = tuple[slice, slice]
WHOLE: Area = (slice(None), slice(None))


def beside_window(side: int) -> Area:
    """Return the part of the interior's image without the window, through which the lamp itself is seen."""
    return slice(None), slice(side // 4, side)


BESIDE_WINDOW = (
    "Errors are measured in the right three quarters of the image: at its left, a few pixels see the "
    "lamp through the window, and dominate the squared error. "
)

EXPLAINED = (
    "Filtered is the RMS error after a Gaussian of 1.5 pixels; power is 1 for white noise, low is its mean "
    "below 1/16 cycle per pixel. Measures are over three colours, less the reference's own error, which "
    "is white noise."
)


class Reference(NamedTuple):
    image: NDArray[np.float64]
    error: NDArray[np.float64]
    """Standard errors, in the image's shape."""
    origin: str

    def part(self, left: int, upper: int, size: int) -> "Reference":
        """Return that of a square area."""
        where = np.s_[upper : upper + size, left : left + size]
        return Reference(self.image[where], self.error[where], self.origin)


def of_replicates(images: Sequence[NDArray], origin: str) -> Reference:
    """Return the mean of randomised images, with its standard errors."""
    error = np.std(images, axis=0, ddof=1) / np.sqrt(len(images))
    return Reference(np.mean(images, axis=0), error, origin)


def reference(
    scene: Any,
    side: int,
    spp: int,
    image: Callable[[Any, Any, int, int], NDArray] = scene_images.replicate,
) -> Reference:
    """Return the stored reference of a scene, or else an estimate from randomised replicates.

    One that is kept with the figures will do if it has as many samples. ``image`` renders: from scene,
    sampler, side and samples per pixel.
    """
    try:
        stored, bound = scene.reference(side, side)
    except ValueError:
        kept = find_kept(scene, side)
        if kept is not None and kept.spp >= spp:
            origin = f"kept with the figures, estimated from {kept.spp} samples per pixel"
            return Reference(kept.image, kept.error, origin)
        sobol = sequences.sobol(len(scene.needs))
        replicates = {
            f"{k}": partial(image, scene, samplers.independent(sobol, 2**20 + k), side, spp // REPLICATES)
            for k in range(REPLICATES)
        }
        label = f"reference of {digest('scene', scene)[0]}, {side}, {spp}"
        images = list(finished_cells.shared(label, replicates).values())
        return of_replicates(images, f"estimated from {spp} samples per pixel")
    return Reference(stored, bound / DEVIATIONS, "stored with the package")


@cache
def reference_of(name: str, side: int, spp: int) -> Reference:
    """Return the reference of a scene of the package, by replicates of ``spp`` samples if it is estimated."""
    return reference(getattr(scenes, name)(), side, spp * REPLICATES)


def rms_error(found: NDArray, exact: Reference) -> float:
    """Return the RMS error over pixels and colours, without the reference's: no less than that.

    Errors of both are independent, so their squares add.
    """
    noise = np.mean(np.square(exact.error))
    return float(np.sqrt(max(np.mean(np.square(found - exact.image)) - noise, noise)))


def measures(found: NDArray, exact: Reference, area: Area = WHOLE) -> dict[str, float]:
    """Return RMS error, filtered error and power at low frequencies of an area; see `EXPLAINED`."""
    image, wanted = found[area], exact.image[area]
    square, noise = (float(np.mean(np.square(values))) for values in (image - wanted, exact.error[area]))
    impulse = np.zeros(image.shape[:2])
    impulse[0, 0] = np.sqrt(impulse.size)
    # Of white noise the filter leaves the same part as of an impulse.
    left = noise * analysis.filtered_error(impulse, np.zeros_like(impulse)) ** 2
    filtered = analysis.filtered_error(image, wanted) ** 2
    low = analysis.low_frequency_power(image, wanted)
    return {
        "RMS error": float(np.sqrt(max(square - noise, noise))),
        "filtered error": float(np.sqrt(max(filtered - left, left))),
        "low-frequency power": (low * square - noise) / max(square - noise, noise),
    }


def in_parts(image: NDArray) -> list[NDArray]:
    """Return 4 x 4 parts of an image: errors of methods are compared over them."""
    return [part for rows in np.array_split(image, 4) for part in np.array_split(rows, 4, axis=1)]


def shown(image: NDArray) -> NDArray[np.float64]:
    """Return linear colours as screens expect them."""
    return plot.srgb(np.clip(np.asarray(image, np.float64), 0, 1))


def main() -> None:
    """Estimate, and write the file."""
    scene = scenes.interior(2)
    sobol = sequences.sobol(len(scene.needs))
    images = [
        scene_images.replicate(scene, samplers.independent(sobol, 2**21 + k), KEPT_SIDE, KEPT_SPP)
        for k in range(REPLICATES)
    ]
    image, error, _ = of_replicates(images, "")
    kept = {"image": image.astype(np.float32), "error": error.astype(np.float16)}
    np.savez_compressed(FILE, **kept, **vars(traced.content(scene)))


if __name__ == "__main__":
    main()

"""Images that figures export, as lossless WebPs, each with its difference from the first and its spectrum."""

import io
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

import analysis
from figures import plot
from figures._errors import rms

TRANSFER = "linear values, clipped to [0, 1], by the curve of sRGB"
AS_IT_IS = "values as they are"
SHADES = 16
DECADES = (-2.0, 2.0)
"""Powers of ten that are black and white in a spectrum; the mean power is 10^0."""

SIGMA = 1.5
"""Pixels: the standard deviation of the filter."""

DEVIATIONS = 3
"""The difference that is white, in root mean squares."""


def encode(images: Mapping[str, ArrayLike]) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Encode images of the same shape, the reference first; raises TypeError or ValueError for others.

    ``images``: finite floats, linear, or uint8, shape (height, width) or (height, width, 3). Names such as
    "Z, 16 spp" make a series. Returns the WebPs by the part of their file names after the figure's name, and
    a description: width, height, transfer, and the items. An item has a name, spp in a series, and a file;
    all except the reference also have the files of the difference, also filtered, and its spectrum,
    the root mean squares of both differences, and the scales of their pictures.
    """
    arrays = _check(images)
    first, *others = arrays
    coded = arrays[first].dtype == np.uint8
    values = {name: array / 255 if coded else array for name, array in arrays.items()}
    differences = {name: values[name] - values[first] for name in others}
    filtered = {name: _filtered(difference) for name, difference in differences.items()}
    scales, filtered_scales = _scales(differences), _scales(filtered)

    def add(name: str, pixels: NDArray[np.uint8]) -> str:
        buffer = io.BytesIO()  # A lossless WebP is a fifth smaller than a PNG.
        Image.fromarray(pixels).save(buffer, format="webp", lossless=True, exact=True)
        files[f"{name}.webp"] = buffer.getvalue()
        return f"{name}.webp"

    files: dict[str, bytes] = {}
    items: list[dict[str, Any]] = []
    for name, array in arrays.items():
        sampler, spp = _parts(name)
        shown = array if coded else np.round(255 * plot.srgb(np.clip(array, 0, 1))).astype(np.uint8)
        items.append({"name": name, "file": add(slug(name), shown)})
        if name != first:
            items[-1] |= {
                "name": sampler,
                **({} if spp is None else {"spp": spp}),
                "difference": add(f"{slug(name)}.difference", _signed(differences[name], scales[spp])),
                "filtered": add(f"{slug(name)}.filtered", _signed(filtered[name], filtered_scales[spp])),
                "spectrum": add(f"{slug(name)}.spectrum", _spectrum(values[name], values[first])),
                "rms": rms(differences[name]),
                "scale": scales[spp],
                "filtered_rms": rms(filtered[name]),
                "filtered_scale": filtered_scales[spp],
            }
    if len(files) != 1 + 4 * len(others):
        raise ValueError(f"images must have names that differ in letters or digits, got {list(images)}")
    height, width = arrays[first].shape[:2]
    transfer = AS_IT_IS if coded else TRANSFER
    return files, {"width": width, "height": height, "transfer": transfer, "items": items}


def _check(images: Mapping[str, ArrayLike]) -> dict[str, NDArray]:
    if not isinstance(images, Mapping) or not all(isinstance(name, str) for name in images):
        raise TypeError(f"images must be a mapping of names to arrays, got {type(images).__name__}")
    if not images:
        raise ValueError("images must have a reference, got none")
    arrays = {name: np.asarray(image) for name, image in images.items()}
    first = next(iter(arrays.values()))
    for name, array in arrays.items():
        if array.dtype != np.uint8 and not np.issubdtype(array.dtype, np.floating):
            raise TypeError(f"images must be of floats or uint8, got {array.dtype} for {name!r}")
        if array.shape != first.shape or array.ndim not in (2, 3) or array.shape[2:] not in ((), (3,)):
            raise ValueError(
                "images must be of one shape (height, width) or (height, width, 3), "
                f"got {array.shape} for {name!r}"
            )
        if (array.dtype == np.uint8) != (first.dtype == np.uint8):
            raise TypeError(f"images must be all of floats or all of uint8, got {array.dtype} for {name!r}")
        if not np.isfinite(array).all():
            raise ValueError(f"images must be finite, got others in {name!r}")
    return arrays


def slug(name: str) -> str:
    """Return a name in lower-case letters and digits for a file."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def _parts(name: str) -> tuple[str, int | None]:
    """Return the sampler and the samples per pixel of an image of a series."""
    parts = re.fullmatch(r"(.+), (\d+) spp", name)
    return (parts[1], int(parts[2])) if parts else (name, None)


def _scales(differences: dict[str, NDArray]) -> dict[int | None, float]:
    """Return the difference that is white, the same for all images with equal samples, to compare them."""
    largest: dict[int | None, float] = {}
    for name, difference in differences.items():
        _, spp = _parts(name)
        largest[spp] = max(largest.get(spp, 0.0), rms(_grey(difference)))
    return {spp: _round_up(DEVIATIONS * value) for spp, value in largest.items()}


def _round_up(value: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten; return 1 for 0."""
    if value == 0:
        return 1.0
    power = int(np.floor(np.log10(value)))
    steps = (float(f"{k}e{power}") for k in (1, 2, 5, 10))
    return next(step for step in steps if value <= step * (1 + 1e-6))


def _grey(image: NDArray) -> NDArray:
    return image if image.ndim == 2 else image.mean(axis=2)


def _filtered(difference: NDArray) -> NDArray:
    """Return a difference after the filter of :func:`analysis.filtered_error`: a Gaussian, on a torus."""
    sides = (SIGMA, SIGMA, 0)[: difference.ndim]
    return gaussian_filter(difference, sides, mode="wrap", truncate=8)


def _signed(difference: NDArray, scale: float) -> NDArray[np.uint8]:
    """Map a difference to greys: 0 is mid-grey, and ``scale`` is white."""
    return np.round(127.5 + 127.5 * np.clip(_grey(difference) / scale, -1, 1)).astype(np.uint8)


def _spectrum(image: NDArray, reference: NDArray) -> NDArray[np.uint8]:
    """Return the logarithm of the error's power, frequency 0 in the middle, black for no error.

    A few greys suffice, and more would not compress.
    """
    if np.ptp(image - reference, axis=(0, 1)).max() == 0:
        return np.zeros(image.shape[:2], np.uint8)
    power = np.fft.fftshift(analysis.error_spectrum(image, reference))
    low, high = DECADES
    place = (np.log10(np.maximum(power, 10**low)) - low) / (high - low)
    return np.minimum(SHADES * place, SHADES - 1).astype(np.uint8) * np.uint8(255 // (SHADES - 1))

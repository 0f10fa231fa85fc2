"""Images that figures hand out, as lossless WebPs, each with its difference from the first and spectrum."""

import io
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

import analysis
from figures import plot
from figures._errors import rms

TRANSFER = "linear values, clipped to [0, 1], by the curve of sRGB"
AS_IT_IS = "values as they are"
SHADES = 16
DECADES = (-2.0, 2.0)
"""Powers of ten that are black and white in a spectrum; 0 is the mean of any."""

DEVIATIONS = 3
"""How many root mean squares of a difference are white."""

COUNTED = re.compile(r"(.+), (\d+) spp")
"""Names of images of a series over samples per pixel."""


def encode(images: Mapping[str, ArrayLike]) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Encode images of one shape, the reference first; raise a TypeError or ValueError if they are none.

    ``images``: finite floats, linear, or uint8, shape (height, width) or (height, width, 3). Names such as
    "Z, 16 spp" make a series. Returns WebPs, by the part of the file's name that follows the figure's; and a
    description: width, height, transfer, and the items: name, spp of series, file, and of all but the
    reference the files of difference and spectrum, the difference's root mean square and the scale of its
    picture.
    """
    arrays = _checked(images)
    coded = next(iter(arrays.values())).dtype == np.uint8
    shown = {name: array if coded else _shown(array) for name, array in arrays.items()}
    values = {name: array / 255 if coded else array for name, array in arrays.items()}
    first, *others = arrays
    differences = {name: values[name] - values[first] for name in others}
    scales = _scales(differences)

    height, width = arrays[first].shape[:2]
    files = {f"{slug(first)}.webp": _webp(shown[first])}
    items: list[dict[str, Any]] = [{"name": first, "file": f"{slug(first)}.webp"}]
    for name in others:
        stem, count = slug(name), _count(name)
        parts = {
            "file": f"{stem}.webp",
            "difference": f"{stem}.difference.webp",
            "spectrum": f"{stem}.spectrum.webp",
        }
        files[parts["file"]] = _webp(shown[name])
        files[parts["difference"]] = _webp(_signed(differences[name], scales[count]))
        files[parts["spectrum"]] = _webp(_spectrum(values[name], values[first]))
        spp = {} if count is None else {"spp": count}
        items.append(
            {"name": _sampler(name), **spp, **parts, "rms": rms(differences[name]), "scale": scales[count]}
        )
    if len(files) != 1 + 3 * len(others):
        raise ValueError(f"images must have names that differ in letters or digits, got {list(images)}")
    transfer = AS_IT_IS if coded else TRANSFER
    return files, {"width": width, "height": height, "transfer": transfer, "items": items}


def _checked(images: Mapping[str, ArrayLike]) -> dict[str, NDArray]:
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
    """Return what files of images are named by: small letters and digits."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def _count(name: str) -> int | None:
    counted = COUNTED.fullmatch(name)
    return int(counted[2]) if counted else None


def _sampler(name: str) -> str:
    counted = COUNTED.fullmatch(name)
    return counted[1] if counted else name


def _shown(image: NDArray) -> NDArray[np.uint8]:
    """Return linear values as screens expect them, by the curve of sRGB."""
    return np.round(255 * plot.srgb(np.clip(image, 0, 1))).astype(np.uint8)


def _scales(differences: dict[str, NDArray]) -> dict[int | None, float]:
    """Return the difference that is white, one for all images of as many samples: they are to be compared."""
    largest: dict[int | None, float] = {}
    for name, difference in differences.items():
        largest[_count(name)] = max(largest.get(_count(name), 0.0), rms(_grey(difference)))
    return {count: _rounded_up(DEVIATIONS * value) for count, value in largest.items()}


def _rounded_up(value: float) -> float:
    """Return the next of 1, 2 or 5 times a power of ten; 1 for no difference."""
    if value == 0:
        return 1.0
    power = int(np.floor(np.log10(value)))
    steps = (float(f"{k}e{power}") for k in (1, 2, 5, 10))
    return next(step for step in steps if value <= step * (1 + 1e-6))


def _grey(image: NDArray) -> NDArray:
    return image if image.ndim == 2 else image.mean(axis=2)


def _signed(difference: NDArray, scale: float) -> NDArray[np.uint8]:
    """Return mid-grey for none, white for ``scale`` too bright."""
    return np.round(127.5 + 127.5 * np.clip(_grey(difference) / scale, -1, 1)).astype(np.uint8)


def _spectrum(image: NDArray, reference: NDArray) -> NDArray[np.uint8]:
    """Return the error's power in decades, frequency 0 in the middle, black for no error.

    In few greys: noise does not compress.
    """
    if np.ptp(image - reference, axis=(0, 1)).max() == 0:
        return np.zeros(image.shape[:2], np.uint8)
    power = np.fft.fftshift(analysis.error_spectrum(image, reference))
    low, high = DECADES
    place = (np.log10(np.maximum(power, 10**low)) - low) / (high - low)
    return np.minimum(SHADES * place, SHADES - 1).astype(np.uint8) * np.uint8(255 // (SHADES - 1))


def _webp(pixels: NDArray[np.uint8]) -> bytes:
    """Return a WebP of grey or colours, bit by bit; a fifth smaller than a PNG."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="webp", lossless=True, exact=True)
    return buffer.getvalue()

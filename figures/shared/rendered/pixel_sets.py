"""Errors at random pixels, in sets that are drawn apart: means over the sets have intervals.

An image of thousands of samples per pixel need not be rendered whole to know its error, and samplers without
a key have intervals, too: those of the choice of the pixels.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.making import finished_cells
from figures.shared.rendered import diffusion, scene_images
from qmcjax import samplers
from qmcjax.core.checkpoints import digest

SETS = 16


class Pixels(NamedTuple):
    """Distinct pixels of a square image."""

    side: int
    x: NDArray[np.uint32]
    """Columns, shape (SETS, pixels of each)."""
    y: NDArray[np.uint32]


def draw_sets(side: int, each: int, area: diffusion.Area = diffusion.WHOLE) -> Pixels:
    """Draw sets of ``each`` pixels of an area at random."""
    rows, columns = (np.arange(side, dtype=np.uint32)[part] for part in area)
    chosen = np.random.default_rng(1).permutation(rows.size * columns.size)[: SETS * each]
    y, x = np.divmod(chosen.reshape(SETS, each), columns.size)
    return Pixels(side, columns[x], rows[y])


def all_pixels(side: int) -> Pixels:
    """Divide an image into sets at random."""
    return draw_sets(side, side**2 // SETS)


def errors(values: NDArray[np.float64], exact: diffusion.Reference, pixels: Pixels) -> NDArray[np.float64]:
    """Return the RMS error of each set without the reference's, no less than that.

    ``values``: of the pixels, shape (sets, pixels of each, 3).
    """
    square, noise = (
        np.mean(np.square(of), axis=(1, 2))
        for of in (values - exact.image[pixels.y, pixels.x], exact.error[pixels.y, pixels.x])
    )
    return np.sqrt(np.maximum(square - noise, noise))


def errors_of_images(
    images: Sequence[NDArray[np.float64]], exact: diffusion.Reference, pixels: Pixels
) -> NDArray[np.float64]:
    """Return the RMS errors of all sets, which are divided among images of several keys."""
    divided = zip(images, _divide(pixels, len(images)), strict=True)
    return np.concatenate([errors(image[of.y, of.x], exact, of) for image, of in divided])


def _divide(pixels: Pixels, count: int) -> list[Pixels]:
    columns, rows = (np.array_split(each, count) for each in (pixels.x, pixels.y))
    return [Pixels(pixels.side, x, y) for x, y in zip(columns, rows, strict=True)]


def compare(
    scene: Any,
    exact: diffusion.Reference,
    pixels: Pixels,
    ways: Mapping[int, Mapping[str, Sequence[samplers.Sampler]]],
    progress: Callable[[float], None] = lambda part: None,
) -> dict[str, dict[int, NDArray[np.float64]]]:
    """Return the RMS errors of all sets by sampler and samples per pixel, shared by the processes of a job.

    ``ways`` has samplers by samples per pixel and name: the sets are divided among those of several keys.
    """
    cells = {
        f"{name}, {spp} spp": partial(_errors, scene, exact, pixels, keys, spp)
        for spp, of_count in ways.items()
        for name, keys in of_count.items()
    }
    label = f"errors of {digest('scene', scene)[0]}, {pixels.side}, {pixels.x.size}"
    found = iter(finished_cells.shared(label, cells, progress).values())
    by_name: dict[str, dict[int, NDArray[np.float64]]] = {}
    for spp, of_count in ways.items():
        for name in of_count:
            by_name.setdefault(name, {})[spp] = next(found)
    return by_name


def _errors(
    scene: Any, exact: diffusion.Reference, pixels: Pixels, keys: Sequence[samplers.Sampler], spp: int
) -> NDArray[np.float64]:
    return np.concatenate(
        [
            errors(scene_images.at_pixels(scene, sampler, of.side, spp, of.x, of.y), exact, of)
            for sampler, of in zip(keys, _divide(pixels, len(keys)), strict=True)
        ]
    )


def over_counts(of_counts: Mapping[int, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the geometric mean of errors over the counts, of each set."""
    return np.exp(np.mean([np.log(values) for values in of_counts.values()], axis=0))

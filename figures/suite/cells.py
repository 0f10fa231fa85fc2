"""Cells of the suite: what one entry is measured to with one number of dimensions and of samples."""

import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import analysis
from figures.suite.entries import Entry
from figures.suite.tasks import images, tasks

MEASURES = ("RMS error", "filtered error", "perceived error", "low-frequency power")
"""Of images; entries without images have the first alone."""

SETS = ("t", "t_pairs", "l2_star", "star_low", "star_high")
"""Measures of the points of a pixel."""

PIXELS = 4
"""Side of the square of pixels whose points are measured."""

MOST = {2: 256, 4: 16, 8: 4}
"""Numbers of points up to which bounds of the star discrepancy are computed, by dimensions."""

REPLICATES = 8
"""Side of the images of sequences: each pixel is one replicate."""

TIMED = (4, 16, 3)
"""Dimensions and samples of the images whose points are timed, and how many of these, after the first."""


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spps: tuple[int, ...]
    keys: int


SIZES = {
    "draft": Size(32, (1, 4, 16, 64), 16),
    "paper": Size(64, (1, 2, 4, 8, 16, 32, 64, 128, 256), 16),
}


def of_images(entry: Entry, dims: int, spp: int, size: Size, seed: int) -> NDArray[np.float64]:
    """Return errors, shape (keys, tasks, measures); NaN where there are none.

    If all keys give the same image, all but the first are NaN.
    """
    count = len(tasks(dims, spp, entry.image))
    found = np.full((size.keys, count, len(MEASURES)), np.nan)
    side = size.side if entry.image else REPLICATES
    first: list[NDArray] = []
    for key in range(size.keys):
        made = images(entry.points(side, side, spp, dims, key), entry.image, seed)
        first = first or [image for image, _ in made]
        for task, (image, reference) in enumerate(made):
            if key and np.array_equal(image, first[task]):
                continue
            if entry.image:
                row = analysis.ComparisonRow.of_images("", "", spp, [image], reference, 0.0)
                found[key, task] = [row.values[measure][0] for measure in MEASURES]
            else:
                found[key, task, 0] = np.sqrt(np.mean((image - reference) ** 2))
    return found


def of_sets(entry: Entry, dims: int, spp: int, size: Size) -> NDArray[np.float64]:
    """Return the measures `SETS` of the points of single pixels; NaN where there are none.

    The largest t, of all coordinates and of a pair; the root mean square of L2 star discrepancies; means of
    bounds of the star discrepancy.
    """
    side = size.side if entry.image else REPLICATES
    pixels = entry.points(side, side, spp, dims, 0)[:PIXELS, :PIXELS].reshape(-1, spp, dims)
    # Samplers may share points among pixels.
    pixels = np.unique(pixels, axis=0)
    found = dict.fromkeys(SETS, np.nan)
    if spp > 1:
        found["t"] = max(analysis.t_value(points) for points in pixels)
        found["t_pairs"] = max(max(analysis.projection_t_values(points).values()) for points in pixels)
    squares = [float(analysis.l2_star_discrepancy(points)) ** 2 for points in pixels]
    found["l2_star"] = float(np.sqrt(np.mean(squares)))
    if spp <= MOST[dims]:
        exact = pixels.astype(np.float64)
        bounds = [analysis.star_discrepancy_bounds(points) for points in exact[:PIXELS]]
        found["star_low"], found["star_high"] = np.mean(bounds, axis=0)
    return np.array([found[name] for name in SETS], np.float64)


def of_time(entry: Entry, size: Size, clock: Callable[[], float] = time.perf_counter) -> NDArray[np.float64]:
    """Return the seconds that a million points take, by the clock; of a program with its start and output."""
    dims, spp, count = TIMED
    side = size.side if entry.image else REPLICATES
    entry.points(side, side, spp, dims, 0)
    taken = []
    for key in range(1, 1 + count):
        start = clock()
        entry.points(side, side, spp, dims, key)
        taken.append(clock() - start)
    return np.array(1e6 * statistics.median(taken) / (side * side * spp))

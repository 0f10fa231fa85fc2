"""Cells of the suite: what one entry is measured to with one number of dimensions and of samples."""

import math
import statistics
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import analysis
from figures.suite.entries import Entry
from figures.suite.tasks import images

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


FRAMES = 32
"""Of an animation with one sample per pixel and frame; it repeats."""

IN_TIME = analysis.moving_average(0.1)
"""The filter in time: an average to which each frame adds a tenth, as of temporal anti-aliasing."""


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spps: tuple[int, ...]
    keys: int


SIZES = {
    "draft": Size(32, (1, 4, 16, 64), 16),
    "paper": Size(64, (1, 4, 16, 64, 256), 16),
}
"""Numbers of samples are powers of 4: several samplers of other projects have no others."""

THREADS = 2
"""That measure images, while others are sampled."""


def of_images(entry: Entry, dims: int, spp: int, size: Size, seed: int) -> NDArray[np.float64]:
    """Return errors, shape (keys, tasks, measures); NaN where there are none.

    If all keys give the same image, all but the first are NaN.
    """
    side = size.side if entry.image else REPLICATES
    first = images(entry.points(side, side, spp, dims, 0), entry.image, seed)
    found = np.full((size.keys, len(first), len(MEASURES)), np.nan)
    found[0] = [_measures(image, reference, entry.image) for image, reference in first]

    def measured(points: NDArray[np.float32]) -> list[list[float]]:
        return [
            [math.nan] * len(MEASURES)
            if np.array_equal(image, before)
            else _measures(image, reference, entry.image)
            for (image, reference), (before, _) in zip(images(points, entry.image, seed), first, strict=True)
        ]

    with ThreadPoolExecutor(THREADS) as pool:
        pending: deque[tuple[int, Future[list[list[float]]]]] = deque()
        for key in range(1, size.keys):
            # Points are made in this thread: not all libraries have several.
            points = entry.points(side, side, spp, dims, key)
            if len(pending) == THREADS:
                done, future = pending.popleft()
                found[done] = future.result()
            pending.append((key, pool.submit(measured, points)))
        for done, future in pending:
            found[done] = future.result()
    return found


def _measures(image: NDArray, reference: NDArray, placed: bool) -> list[float]:
    if not placed:
        return [float(np.sqrt(np.mean((image - reference) ** 2))), *[math.nan] * (len(MEASURES) - 1)]
    row = analysis.ComparisonRow.of_images("", "", 1, [image], reference, 0.0)
    return [row.values[measure][0] for measure in MEASURES]


def of_frames(entry: Entry, dims: int, size: Size, seed: int) -> NDArray[np.float64]:
    """Return errors of animations after a filter in space and time, shape (keys, integrands).

    Pixels must have a place in the image. An entry without frames has a new key in each: OpenQMC's key is its
    own number of the frame.
    """
    side = size.side
    zero = np.zeros((side, side))
    found = []
    for key in range(size.keys):
        if entry.animation is None:
            frames = [entry.points(side, side, 1, dims, FRAMES * key + frame) for frame in range(FRAMES)]
            points = np.stack(frames)[:, :, :, 0]
        else:
            points = entry.animation(side, side, FRAMES, dims, key)
        # Integrands are the same in every pixel: frames below each other are one image.
        made = images(points.reshape(FRAMES * side, side, 1, dims), False, seed)
        errors = [image.reshape(FRAMES, side, side) for image, _ in made]
        found.append([analysis.filtered_error(error, zero, time=IN_TIME) for error in errors])
    return np.array(found)


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

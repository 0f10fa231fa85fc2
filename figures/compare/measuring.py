"""One comparison: what entries are measured to, in cells that are kept once they are finished."""

import hashlib
import itertools
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import analysis
from analysis import ComparisonRow
from figures._errors import rms
from figures.compare.entries import Entry, NotSupportedError, reason
from figures.compare.scores import IN_TIME, MEASURES, Measured
from figures.compare.tasks import CLASSES, Ground, Size
from figures.making import finished_cells
from figures.making.fingerprint import fingerprint
from figures.page import quantity

REPLICATES = 8
"""Side of the images of sequences: each pixel is one replicate."""

TIMED = (4, 16, 3)
"""Dimensions and samples of the images whose points are timed, and how many of these, after the first."""

FRAMES = 32
"""Of an animation with one sample per pixel and frame; it repeats."""

FILTER_IN_TIME = analysis.moving_average(0.1)
"""An average to which each frame adds a tenth, as of temporal anti-aliasing."""

FUNCTIONS: dict[str, Callable[[NDArray, NDArray], float]] = {
    "relative": analysis.relative_error,
    "trimmed": analysis.trimmed_error,
    "median": analysis.quantile_error,
    "flip": analysis.flip,
    "hdr_flip": partial(analysis.flip, hdr=True),
}
"""Further measures; see `scores.FURTHER`."""

OF_SCENES = ("relative", "flip", "hdr_flip")
"""The others also measure integrands, whose images are errors, without light."""


def image_errors(entry: Entry, dims: int, spp: int, size: Size, ground: Ground) -> NDArray[np.float64]:
    """Return the values of `MEASURES` and further measures, shape (tasks, measures, keys).

    They are NaN where there are none: of all keys but the first, if these give the same image.
    """
    side = size.side if entry.image else REPLICATES
    tasks = ground.tasks(dims, spp, entry.image)
    images = [
        ground.images(entry.points(side, side, spp, dims, key), entry.image) for key in range(size.keys)
    ]
    names = [*MEASURES.values(), *size.measures]
    values = np.full((len(tasks), len(names), size.keys), np.nan)
    for task, of_task, of_keys in zip(tasks, values, zip(*images, strict=True), strict=True):
        if not entry.image:
            of_task[0] = [rms(image - reference) for image, reference in of_keys]
            continue
        images_of, references = zip(*of_keys, strict=True)
        further = [name for name in size.measures if name not in OF_SCENES or task.of not in CLASSES]
        measures = {name: FUNCTIONS[name] for name in further}
        found = ComparisonRow.of_images("", "", spp, images_of, references[0], 0.0, measures).values
        for row, measure in zip(of_task, names, strict=True):
            row[: len(found.get(measure, ()))] = found.get(measure, ())
    return values


def frame_errors(entry: Entry, dims: int, size: Size, ground: Ground) -> NDArray[np.float64]:
    """Return errors of animations after a filter in space and time, shape (integrands, keys).

    Pixels must have a place in the image. An entry without frames has a new key in each.
    """
    side = size.side
    zero = np.zeros((side, side))
    keys = []
    for key in range(size.keys):
        if entry.animation is None:
            each = [entry.points(side, side, 1, dims, FRAMES * key + frame) for frame in range(FRAMES)]
            points = np.stack(each)[:, :, :, 0]
        else:
            points = entry.animation(side, side, FRAMES, dims, key)
        # Integrands are the same in every pixel: frames below each other are one image.
        images = ground.images(points.reshape(FRAMES * side, side, 1, dims), False)
        errors = [image.reshape(FRAMES, side, side) for image, _ in images]
        keys.append([analysis.filtered_error(error, zero, time=FILTER_IN_TIME) for error in errors])
    return np.array(keys).T


def seconds(entry: Entry, size: Size) -> NDArray[np.float64]:
    """Return the seconds that a million points take, by the clock; of a program with its start and output."""
    dims, spp, count = TIMED
    side = size.side if entry.image else REPLICATES
    entry.points(side, side, spp, dims, 0)
    times = []
    for key in range(1, 1 + count):
        start = time.perf_counter()
        entry.points(side, side, spp, dims, key)
        times.append(time.perf_counter() - start)
    return np.array(1e6 * statistics.median(times) / (side * side * spp))


@dataclass
class Run:
    """A comparison, and what came out of it."""

    command: str
    size: Size
    ground: Ground
    entries: Mapping[str, Entry]
    focus: Sequence[str]
    """Names of the entries that are compared with the others."""
    promises: Mapping[str, list[str]]
    """Those that entries in focus break, in words."""
    measured: dict[str, Measured] = field(default_factory=dict)
    missing: dict[tuple[str, str], list[str]] = field(default_factory=dict)
    """Cells that were left out, by entry and reason."""
    failed: dict[str, str] = field(default_factory=dict)

    def about(self) -> str:
        """Return what is measured, in words."""
        side, spps, keys, _ = self.size
        kind = f"held-out integrands of seed {self.ground.seed}" if self.ground.seed else "public integrands"
        tasks = [*self.ground.integrands * [kind], *self.ground.scenes]
        counts = ", ".join(map(str, spps))
        return f"{side} x {side} pixels, {counts} samples, {quantity(keys, 'key')}, {', '.join(tasks)}"

    def measure(self, folder: Path, progress: Callable[[], Any]) -> None:
        """Measure all entries; what is finished stays in a folder, for an interrupted run to go on."""
        token = finished_cells.PLACE.set(folder / "cells")
        try:
            for name, entry in self.entries.items():
                self.measured[name] = self._entry(entry, progress)
        finally:
            finished_cells.PLACE.reset(token)

    def steps(self) -> int:
        """Return how often :meth:`measure` calls ``progress``."""
        cells = 1 + len(self.ground.dims()) * (len(self.size.spps) + self.ground.integrands)
        return cells * len(self.entries)

    def _entry(self, entry: Entry, progress: Callable[[], Any]) -> Measured:
        size, ground, measured = self.size, self.ground, Measured()
        of = (_code(), size.side, size.keys, size.measures, ground, entry.name, entry.origin, entry.digest)
        label = hashlib.sha256(repr(of).encode()).hexdigest()

        def cell(name: str, compute: Callable[..., NDArray], *how: Any) -> NDArray | None:
            arrays = None
            if entry.name not in self.failed:
                try:
                    arrays = finished_cells.shared(label, {name: lambda: compute(entry, *how)})[name]
                except NotSupportedError as error:
                    self.missing.setdefault((entry.name, str(error)), []).append(name)
                except Exception as error:  # Functions of users raise what they like.
                    self.failed[entry.name] = f"{name}: {reason(error)}"
            progress()
            return arrays

        for dims, spp in itertools.product(ground.dims(), size.spps):
            arrays = cell(f"{dims}-D, {spp} samples", image_errors, dims, spp, size, ground)
            for task, values in zip(
                ground.tasks(dims, spp, entry.image), () if arrays is None else arrays, strict=False
            ):
                names = (*MEASURES, *size.measures)
                errors = {name: of[~np.isnan(of)] for name, of in zip(names, values, strict=True)}
                measured.errors[task] = {name: of for name, of in errors.items() if len(of)}
        for dims in ground.dims() if ground.integrands and entry.image else ():
            arrays = cell(f"frames in {dims}-D", frame_errors, dims, size, ground)
            for task, errors in zip(
                ground.tasks(dims, 1, False), () if arrays is None else arrays, strict=False
            ):
                measured.errors.setdefault(task, {})[IN_TIME] = errors
        arrays = cell("time", seconds, size)
        measured.seconds = np.nan if arrays is None else float(arrays)
        return measured


@cache
def _code() -> str:
    return fingerprint(__name__, "")

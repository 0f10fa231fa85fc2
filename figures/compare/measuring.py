"""One comparison: what entries are measured to, in cells that are kept once they are finished."""

import hashlib
import itertools
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import analysis
from analysis import ComparisonRow
from figures._errors import rms
from figures.compare.entries import Entry, NotSupportedError, reason
from figures.compare.scores import IN_TIME, MEASURES, Measured
from figures.compare.tasks import Ground, Size
from figures.making import finished_cells
from figures.making.fingerprint import fingerprint
from figures.page import quantity

PIXELS = 4
"""Side of the square of pixels whose own points are measured."""

MOST = {2: 256, 4: 16, 8: 4}
"""Numbers of points up to which bounds of the star discrepancy are computed, by dimensions."""

MOST_ON_SCREEN = 2**14

REPLICATES = 8
"""Side of the images of sequences: each pixel is one replicate."""

TIMED = (4, 16, 3)
"""Dimensions and samples of the images whose points are timed, and how many of these, after the first."""

FRAMES = 32
"""Of an animation with one sample per pixel and frame; it repeats."""

FILTER_IN_TIME = analysis.moving_average(0.1)
"""An average to which each frame adds a tenth, as of temporal anti-aliasing."""


def image_errors(entry: Entry, dims: int, spp: int, size: Size, ground: Ground) -> dict[str, NDArray]:
    """Return the values of `MEASURES`, shape (tasks, measures, keys).

    They are NaN where there are none: of all keys but the first, if these give the same image.
    """
    side = size.side if entry.image else REPLICATES
    tasks = ground.tasks(dims, spp, entry.image)
    images = [
        ground.images(entry.points(side, side, spp, dims, key), entry.image) for key in range(size.keys)
    ]
    arrays = {"values": np.full((len(tasks), len(MEASURES), size.keys), np.nan)}
    for place, of_keys in enumerate(zip(*images, strict=True)):
        if not entry.image:
            arrays["values"][place, 0] = [rms(image - reference) for image, reference in of_keys]
            continue
        images_of, references = zip(*of_keys, strict=True)
        row = ComparisonRow.of_images("", "", spp, images_of, references[0], 0.0)
        for column, measure in enumerate(MEASURES.values()):
            arrays["values"][place, column, : len(row.values[measure])] = row.values[measure]
    return arrays


def frame_errors(entry: Entry, dims: int, size: Size, ground: Ground) -> dict[str, NDArray]:
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
    return {"values": np.array(keys).T}


def point_measures(entry: Entry, dims: int, spp: int, size: Size, on_screen: bool) -> dict[str, NDArray]:
    """Return `SETS` of the points of single pixels, and `ON_SCREEN` of several, by name, where there are any.

    The largest t, of all coordinates and of a pair; the root mean square of L2 star discrepancies; means of
    bounds of the star discrepancy. On the screen: the star discrepancy, and the minimum distance on the torus
    over that of the densest packing.
    """
    side = size.side if entry.image else REPLICATES
    image = entry.points(side, side, spp, dims, 0)
    # Samplers may share points among pixels.
    pixels = np.unique(image[:PIXELS, :PIXELS].reshape(-1, spp, dims), axis=0)
    values: dict[str, float] = {}
    if spp > 1 and spp & (spp - 1) == 0:
        values["t"] = max(analysis.t_value(points) for points in pixels)
        values["t_pairs"] = max(max(analysis.projection_t_values(points).values()) for points in pixels)
    squares = [float(analysis.l2_star_discrepancy(points)) ** 2 for points in pixels]
    values["l2_star"] = float(np.sqrt(np.mean(squares)))
    if spp <= MOST[dims]:
        exact = pixels.astype(np.float64)
        bounds = [analysis.star_discrepancy_bounds(points) for points in exact[:PIXELS]]
        values["star_low"], values["star_high"] = np.mean(bounds, axis=0)
    if on_screen and entry.image and spp <= MOST_ON_SCREEN:
        side = min(side, 16, int((MOST_ON_SCREEN / spp) ** 0.5))
        place = np.stack([*np.indices((side, side))][::-1], axis=-1)[:, :, None]
        own = image[:side, :side, :, :2] + place
        together = np.minimum(own.reshape(-1, 2) / side, np.nextafter(1, 0))
        values["screen_star"] = float(analysis.star_discrepancy(together))
        densest = (2 / (3**0.5 * len(together))) ** 0.5
        values["screen_distance"] = float(analysis.min_distance(together)) / densest
    return {name: np.array(value) for name, value in values.items()}


def seconds(entry: Entry, size: Size) -> dict[str, NDArray]:
    """Return the seconds that a million points take, by the clock; of a program with its start and output."""
    dims, spp, count = TIMED
    side = size.side if entry.image else REPLICATES
    entry.points(side, side, spp, dims, 0)
    times = []
    for key in range(1, 1 + count):
        start = time.perf_counter()
        entry.points(side, side, spp, dims, key)
        times.append(time.perf_counter() - start)
    return {"values": np.array(1e6 * statistics.median(times) / (side * side * spp))}


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
    references: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """By scene."""
    missing: dict[tuple[str, str], list[str]] = field(default_factory=dict)
    """Cells that were left out, by entry and reason."""
    failed: dict[str, str] = field(default_factory=dict)

    def about(self) -> str:
        """Return what is measured, in words."""
        side, spps, keys = self.size
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
        cells = 1 + len(self.ground.dims()) * (2 * len(self.size.spps) + self.ground.integrands)
        return cells * len(self.entries)

    def _entry(self, entry: Entry, progress: Callable[[], Any]) -> Measured:
        size, ground, measured = self.size, self.ground, Measured()
        of = (_code(), size.side, size.keys, ground, entry.name, entry.origin, entry.digest)
        label = hashlib.sha256(repr(of).encode()).hexdigest()

        def cell(name: str, compute: Callable[..., dict[str, NDArray]], *how: Any) -> Any:
            arrays = None
            if entry.name not in self.failed:
                try:
                    arrays = finished_cells.shared(label, {name: lambda: _pack(compute(entry, *how))})[name]
                except NotSupportedError as error:
                    self.missing.setdefault((entry.name, str(error)), []).append(name)
                except Exception as error:  # Functions of users raise what they like.
                    self.failed[entry.name] = f"{name}: {reason(error)}"
            progress()
            return arrays

        for dims, spp in itertools.product(ground.dims(), size.spps):
            arrays = cell(f"{dims}-D, {spp} samples", image_errors, dims, spp, size, ground)
            if arrays is not None:
                self._add(measured, arrays, entry, dims, spp)
            first = dims == ground.dims()[0]
            arrays = cell(f"points in {dims}-D, {spp} samples", point_measures, dims, spp, size, first)
            if arrays is not None:
                measured.sets[dims, spp] = {name: float(arrays[name]) for name in arrays.dtype.names}
        for dims in ground.dims() if ground.integrands and entry.image else ():
            arrays = cell(f"frames in {dims}-D", frame_errors, dims, size, ground)
            if arrays is not None:
                for task, errors in zip(ground.tasks(dims, 1, False), arrays["values"], strict=True):
                    measured.errors.setdefault(task, {})[IN_TIME] = errors
        arrays = cell("time", seconds, size)
        measured.seconds = np.nan if arrays is None else float(arrays["values"])
        return measured

    def _add(self, measured: Measured, arrays: NDArray, entry: Entry, dims: int, spp: int) -> None:
        """Add the errors of an entry; to scenes belong rows."""
        for task, values in zip(self.ground.tasks(dims, spp, entry.image), arrays["values"], strict=True):
            errors = {name: of[~np.isnan(of)] for name, of in zip(MEASURES, values, strict=True)}
            if task.name in self.ground.scenes:
                named = {MEASURES[measure]: tuple(of) for measure, of in errors.items()}
                none = np.zeros(0)
                row = ComparisonRow(
                    task.name, entry.name, spp, named, 0.0, none, none, none.astype(np.float32)
                )
                measured.add(task, row)
            else:
                measured.errors[task] = {name: of for name, of in errors.items() if len(of)}


def _pack(arrays: dict[str, NDArray]) -> NDArray:
    """Return arrays as one, whose fields they are."""
    arrays = {name: np.asarray(array) for name, array in arrays.items()}
    whole = np.zeros((), [(name, array.dtype, array.shape) for name, array in arrays.items()])
    for name, array in arrays.items():
        whole[name] = array
    return whole


@cache
def _code() -> str:
    return fingerprint(__name__, "")

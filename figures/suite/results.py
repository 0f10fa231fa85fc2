"""Rows of the table, and scores: geometric means over the tasks of a class, relative to random samples."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.suite import integrands
from figures.suite.cells import SETS, Size
from figures.suite.tasks import DIMS, EXACT, TRACED, tasks
from qmcjax.core import student

FORMAT = 1
"""Of the table: another one where columns, their units, or the meaning of tasks change."""

COLUMNS = ("rms", "filtered", "perceived", "low_frequency")
"""Of `MEASURES`."""

PREFIX = "rms_prefix"
"""The RMS error of the first samples of a set that is made for more."""

IN_TIME = "in_time"
"""The error of animations with one sample per pixel and frame, filtered in space and time."""

BASE = "random"
"""The entry that scores are relative to."""


class Score(NamedTuple):
    """A ratio of errors to those of random samples, less than 1 if better, and its interval of 95 %."""

    middle: float
    low: float
    high: float


class Measured(NamedTuple):
    """What an entry was measured to; cells that are missing were left out."""

    image: bool
    errors: Mapping[tuple[int, int], NDArray[np.float64]]
    """By dimensions and samples."""
    sets: Mapping[tuple[int, int], NDArray[np.float64]]
    frames: Mapping[int, NDArray[np.float64]]
    """By dimensions."""
    seconds: float


def rows(found: Mapping[str, Measured]) -> list[dict[str, Any]]:
    """Return the rows of the table, all with the same columns; empty text where nothing was measured."""
    made = []
    for entry, of in found.items():
        for (dims, spp), errors in of.errors.items():
            for task, values in zip(tasks(dims, spp, of.image), errors.swapaxes(0, 1), strict=True):
                keys = int(np.isfinite(values[:, 0]).sum())
                head = (entry, dims, task.of, task.name, spp, task.samples, keys)
                made.append(_row(head, errors=values))
        for (dims, spp), sets in of.sets.items():
            made.append(_row((entry, dims, "points", "pixel", spp, spp, ""), sets=sets))
        for dims, errors in of.frames.items():
            for task, values in zip(tasks(dims, 1, False), errors.T, strict=True):
                head = (entry, dims, task.of, task.name, 1, 1, len(values))
                made.append(_row(head, frames=values))
        if math.isfinite(of.seconds):
            made.append(_row((entry, "", "points", "time", "", "", ""), seconds=of.seconds))
    return made


def _row(
    head: tuple[Any, ...], errors: Any = None, sets: Any = None, frames: Any = None, seconds: Any = ""
) -> dict[str, Any]:
    names = ("entry", "dims", "class", "task", "spp", "samples", "keys")
    row: dict[str, Any] = {"format": FORMAT, **dict(zip(names, head, strict=True))}
    values = {name: None if errors is None else errors[:, place] for place, name in enumerate(COLUMNS)}
    for name, of_keys in (values | {IN_TIME: frames}).items():
        score: Any = ("", "", "")
        if of_keys is not None and np.isfinite(of_keys[0]):
            with np.errstate(divide="ignore"):
                score = _geometric(np.log(of_keys))
        row |= dict(zip((name, f"{name}_low", f"{name}_high"), score, strict=True))
    for place, name in enumerate(SETS):
        row[name] = float(sets[place]) if sets is not None and np.isfinite(sets[place]) else ""
    return row | {"seconds_per_million": seconds}


def _geometric(logarithms: NDArray[np.float64]) -> Score:
    """Return the geometric mean over keys, without those that are NaN, and Student's interval.

    With an error of 0, both are as far as they can be: (0, 0, inf).
    """
    known = logarithms[~np.isnan(logarithms)]
    if not np.isfinite(known).all():
        return Score(0.0, 0.0, math.inf)
    low, high = student.interval(known)
    with np.errstate(over="ignore"):
        return Score(*(float(value) for value in np.exp([known.mean(), low, high])))


Ratios = dict[tuple[int, str, str], NDArray[np.float64]]
"""Logarithms of ratios (keys,) by dimensions, class and measure (of `COLUMNS`, `PREFIX`, or `IN_TIME`)."""


def ratios(found: Mapping[str, Measured], size: Size) -> dict[str, Ratios]:
    """Return by entry how errors compare with those of random samples, key by key.

    They are means over the tasks and numbers of samples of a class, all of equal weight. They are there if an
    entry has all numbers of samples.
    """
    made: dict[str, Ratios] = {}
    for entry, of in found.items():
        made[entry] = {}
        counts = {spp: _at(of, found[BASE], spp) for spp in size.spps}
        for dims in DIMS:
            if all((dims, spp) in of.errors for spp in counts):
                keys = dict.fromkeys(key for at in counts.values() for key in at if key[0] == dims)
                for key in keys:
                    parts = [at[key] for at in counts.values() if key in at]
                    made[entry][key] = np.mean(np.concatenate(parts), axis=0)
        for dims, frames in of.frames.items():
            made[entry] |= _in_time(dims, frames, found[BASE].frames[dims])
    return made


def by_samples(found: Mapping[str, Measured], spps: Sequence[int]) -> dict[str, dict[int, Ratios]]:
    """Return ratios by entry and number of samples, each the mean over the tasks of a class."""
    return {
        entry: {
            spp: {key: np.mean(values, axis=0) for key, values in _at(of, found[BASE], spp).items()}
            for spp in spps
        }
        for entry, of in found.items()
    }


def scores(of: Ratios) -> dict[tuple[int, str, str], Score]:
    """Return the scores of an entry by dimensions, class and measure."""
    return {key: _geometric(values) for key, values in of.items()}


def _at(of: Measured, base: Measured, spp: int) -> Ratios:
    """Return the logarithms of ratios of all tasks of a class, shape (tasks, keys), with so many samples."""
    found: dict[tuple[int, str, str], list[NDArray[np.float64]]] = {}
    for dims in DIMS:
        if (dims, spp) not in of.errors or (dims, spp) not in base.errors:
            continue
        known = base.errors[dims, spp][:, : of.errors[dims, spp].shape[1]]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = np.log(of.errors[dims, spp]) - np.log(known)
        for place, task in enumerate(tasks(dims, spp, of.image)):
            for column, name in enumerate(COLUMNS):
                if np.isfinite(ratios[0, place, column]):
                    if task.samples == spp:
                        found.setdefault((dims, task.of, name), []).append(ratios[:, place, column])
                    elif name == "rms":
                        found.setdefault((dims, task.of, PREFIX), []).append(ratios[:, place, column])
    return {key: np.stack(values) for key, values in found.items()}


def _in_time(dims: int, frames: NDArray[np.float64], base: NDArray[np.float64]) -> Ratios:
    """Return the logarithms of ratios (keys,) of animations, each the mean over the tasks of a class."""
    found: dict[tuple[int, str, str], list[NDArray[np.float64]]] = {}
    with np.errstate(divide="ignore"):
        ratios = np.log(frames) - np.log(base)
    for task, values in zip(tasks(dims, 1, False), ratios.T, strict=True):
        found.setdefault((dims, task.of, IN_TIME), []).append(values)
    return {key: np.mean(values, axis=0) for key, values in found.items()}


def families(of: Ratios, measure: str) -> dict[str, Score]:
    """Return the geometric mean over classes, each with the same weight, by family: columns of the summary.

    The families are the integrands of each number of dimensions, exact scenes, and traced scenes.
    """
    kinds: dict[str, list[tuple[int, str]]] = {
        f"{dims}-D": [(dims, kind) for kind in integrands.CLASSES] for dims in DIMS
    }
    for kind in (EXACT, TRACED):
        kinds[kind] = [(dims, kind) for dims in DIMS if any(t.of == kind for t in tasks(dims, 1, True))]
    found = {}
    for family, classes in kinds.items():
        values = [of[dims, kind, measure] for dims, kind in classes if (dims, kind, measure) in of]
        if len(values) == len(classes) > 0:
            found[family] = _geometric(np.mean(values, axis=0))
    return found

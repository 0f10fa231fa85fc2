"""Scores: geometric means over the tasks of a class, relative to random samples; and the table."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.compare import tasks
from figures.compare.tasks import Task
from qmcjax.core import student

MEASURES = {
    "rms": "RMS error",
    "filtered": "filtered error",
    "perceived": "perceived error",
    "low_frequency": "low-frequency power",
}
"""Of images, as `analysis.compare` names them; entries without images have the first alone."""

FURTHER = {
    "relative": "relative error",
    "trimmed": "trimmed error",
    "median": "median error",
    "flip": "FLIP",
    "hdr_flip": "HDR-FLIP",
}
"""On request."""

FORMAT = 1
"""Of table and scores: another one where the meaning of columns, their units, or tasks change."""

PREFIX = "rms_prefix"
"""The RMS error of the first samples of a set that is made for more."""

IN_TIME = "in_time"
"""The error of animations with one sample per pixel and frame, filtered in space and time."""

NAMES = {
    **MEASURES,
    **FURTHER,
    PREFIX: "RMS error of prefixes",
    IN_TIME: "error of frames filtered in space and time",
}
"""All measures in words."""

BASE = "random"
"""The entry that scores are relative to."""


class Score(NamedTuple):
    """A geometric mean, as of ratios of errors to those of random samples, and its interval of 95 %."""

    middle: float
    low: float
    high: float

    @classmethod
    def of(cls, logarithms: NDArray[np.float64]) -> "Score":
        """Return that over keys; with an error of 0, both are as far as they can be: (0, 0, inf)."""
        if not np.isfinite(logarithms).all():
            return cls(0.0, 0.0, math.inf)
        with np.errstate(over="ignore"):
            ends = np.exp([logarithms.mean(), *student.interval(logarithms)])
        return cls(*(float(value) for value in ends))


@dataclass
class Measured:
    """What an entry was measured to; what is missing was left out."""

    errors: dict[Task, dict[str, NDArray[np.float64]]] = field(default_factory=dict)
    """By task and measure, for each key; for one, if the images of all keys are equal."""
    seconds: float = math.nan
    """For a million points."""


Ratios = dict[tuple[Task, str], NDArray[np.float64]]
"""Logarithms of ratios to errors of `BASE`, key by key, by task and measure."""

Classes = dict[tuple[int, str, str], NDArray[np.float64]]
"""Their means by dimensions, class and measure."""


def ratios(of: Measured, base: Measured) -> Ratios:
    """Return how errors compare with those of random samples."""
    logarithms: Ratios = {}
    for task, errors in of.errors.items():
        known = base.errors.get(task, {})
        for measure in [m for m in errors if m in known and (m == "rms" or task.samples == task.spp)]:
            keys = min(len(errors[measure]), len(known[measure]))
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.log(errors[measure][:keys]) - np.log(known[measure][:keys])
            if measure == IN_TIME or np.isfinite(ratio[:1]).all():
                logarithms[task, PREFIX if task.samples < task.spp else measure] = ratio
    return logarithms


def class_means(of: Ratios, spps: Iterable[int]) -> Classes:
    """Return means over the tasks and numbers of samples of a class, of equal weight: if all are there."""
    there = {(task.dims, task.of, task.spp) for task, measure in of if measure != IN_TIME}
    groups: dict[tuple[int, str, str], list[NDArray[np.float64]]] = {}
    for (task, measure), ratio in of.items():
        if measure == IN_TIME or all((task.dims, task.of, spp) in there for spp in spps):
            groups.setdefault((task.dims, task.of, measure), []).append(ratio)
    return {key: _mean(values) for key, values in groups.items()}


def families(of: Classes, base: Classes, measure: str) -> dict[str, Score]:
    """Return the geometric mean over classes, each with the same weight, by family: columns of the summary.

    A family is the integrands of a number of dimensions, or scenes of a kind; an entry has a score if it has
    all classes of ``base``.
    """
    groups: dict[str, list[tuple[int, str, str]]] = {}
    for key in base:
        dims, kind, name = key
        if name == measure:
            groups.setdefault(f"{dims}-D" if kind in tasks.CLASSES else kind, []).append(key)
    return {
        family: Score.of(_mean([of[key] for key in keys]))
        for family, keys in groups.items()
        if all(key in of for key in keys)
    }


def _mean(values: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the mean over arrays, for the keys that all have."""
    keys = min(map(len, values))
    return np.mean([each[:keys] for each in values], axis=0)


def rows(found: Mapping[str, Measured]) -> list[dict[str, Any]]:
    """Return the rows of the table, all with the same columns; empty text where nothing was measured."""
    filled = []
    for entry, of in found.items():
        for task, errors in of.errors.items():
            row = _head(entry, task.dims, task.of, task.name, task.spp, task.samples)
            row["keys"] = max(map(len, errors.values()))
            for measure, values in errors.items():
                with np.errstate(divide="ignore"):
                    score = Score.of(np.log(values))
                row |= dict(zip((measure, f"{measure}_low", f"{measure}_high"), score, strict=True))
            filled.append(row)
        if math.isfinite(of.seconds):
            filled.append(_head(entry, "", "points", "time", "", "") | {"seconds_per_million": of.seconds})
    further = [name for name in FURTHER if any(name in row for row in filled)]
    errors = [f"{name}{end}" for name in (*MEASURES, *further, IN_TIME) for end in ("", "_low", "_high")]
    names = (*_head(*[""] * 6), *errors, "seconds_per_million")
    return [{name: row.get(name, "") for name in names} for row in filled]


def _head(*values: Any) -> dict[str, Any]:
    names = ("entry", "dims", "class", "task", "spp", "samples")
    return {"format": FORMAT, **dict(zip(names, values, strict=True)), "keys": ""}

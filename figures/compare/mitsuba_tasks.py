"""Images of scenes of Mitsuba 3, which a process of its own makes, and errors at equal time."""

import hashlib
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from importlib import metadata
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import ComparisonRow
from figures.compare import mitsuba_process
from figures.compare.entries import MITSUBA, Entry
from figures.compare.measuring import Run
from figures.compare.scores import EQUAL_TIME
from figures.compare.tasks import DIMS, OF_MITSUBA, Size, Task
from figures.making import this_machine
from figures.shared.mitsuba_runs import mitsuba_scenes

PASSES = 16
"""Of a reference, each with four times as many samples as the images of most."""

STEEPEST = -1.5
"""Exponent of time with which errors fall at most: that of scrambled nets and smooth integrands."""

NOTES = (
    f"Names of Mitsuba's samplers begin with {MITSUBA}. Others have {mitsuba_process.DIMS} dimensions; the "
    "plugin adds more. Films have a box filter, and --size is their longer side.",
    "At equal time: errors in the time that the first of Mitsuba's samplers takes for so many samples, "
    "interpolated between the sampler's own numbers of samples by power laws. Times are medians of "
    f"{mitsuba_process.TIMED} images, taken in turns.",
)


def render(run: Run, path: Path, folder: Path) -> None:
    """Add what entries make of a scene in a file; its reference is kept in a folder, or found there."""
    asked = [entry for entry in run.entries.values() if entry.make or entry.name.startswith(MITSUBA)]
    for name in run.entries.keys() - {entry.name for entry in asked}:
        run.missing.setdefault((name, "Mitsuba asks samplers alone"), []).append(path.stem)
    images = _images(asked, path, run.size, folder)
    reference, rows = np.asarray(images["reference"], np.float64), []
    for number, spp in product(range(len(asked)), run.size.spps):
        name = asked[number].name
        if f"why {number} {spp}" in images:
            why = str(images[f"why {number} {spp}"])
            run.missing.setdefault((name, why), []).append(f"{path.stem}, {spp} samples")
        else:
            of, seconds = images[f"images {number} {spp}"], float(images[f"seconds {number} {spp}"])
            rows.append(ComparisonRow.of_images(path.stem, name, spp, of, reference, seconds))
    for row in at_equal_time(rows):
        run.measured[row.sampler].add(Task(OF_MITSUBA, path.stem, DIMS[-1], row.spp, row.spp), row)
    run.references[path.stem] = reference
    least = min((row.mean("RMS error") for row in rows), default=np.nan)
    error = float(np.sqrt(np.mean(images["error"] ** 2)))
    note = (
        f"{path.stem}: by the variant {images['variant']}. The reference is the mean of {PASSES} images of "
        f"{4 * run.size.spps[-1]} samples by {mitsuba_process.REFERENCE}. Its RMS error is {error:.2g}, "
        f"{error / least:.2f} of the least one of a sampler."
    )
    run.notes = [*dict.fromkeys((*NOTES, *run.notes, note))]


def _images(entries: Sequence[Entry], scene: Path, size: Size, folder: Path) -> dict[str, Any]:
    variant = "llvm_ad_rgb" if mitsuba_scenes.has_llvm() else "scalar_rgb"
    of = scene.resolve(), size.side, size.spps[-1], variant, metadata.version("mitsuba")
    digest = hashlib.sha256(repr(of).encode() + scene.read_bytes()).hexdigest()[:12]
    with tempfile.TemporaryDirectory() as temporary:
        task = {
            "scene": str(scene.resolve()),
            **size._asdict(),
            "samplers": [entry.text for entry in entries],
            "passes": PASSES,
            "variant": variant,
            "result": str(Path(temporary, "result.npz")),
            "kept": str((folder / f"reference-{scene.stem}-{digest}.npz").resolve()),
        }
        this_machine.run_apart(mitsuba_process, task=task)
        with np.load(task["result"]) as result:
            return {**result, "variant": variant}


def at_equal_time(rows: Sequence[ComparisonRow]) -> list[ComparisonRow]:
    """Return the rows of one scene with errors in the time of the first of Mitsuba's samplers, if any.

    Errors are power laws of the time between two numbers of samples, and beyond them as between the nearest
    two, with exponents from `STEEPEST` to 0: where images take a fixed time, whatever the number of samples,
    errors do not fall with time. Of a single number the exponent is -1/2.
    """
    spps = {row.spp for row in rows}
    of_sampler: dict[str, list[ComparisonRow]] = {}
    for row in sorted(rows, key=lambda row: row.seconds):
        of_sampler.setdefault(row.sampler, []).append(row)
    whole = [name for name, own in of_sampler.items() if spps == {row.spp for row in own}]
    first = next((row.sampler for row in rows if row.sampler.startswith(MITSUBA)), None)
    if first not in whole:
        return list(rows)
    clock = {row.spp: row.seconds for row in of_sampler[first]}
    completed = []
    for row in rows:
        own, values = of_sampler[row.sampler], dict(row.values)
        for name in EQUAL_TIME.values():
            measure = name.removesuffix(" at equal time")
            errors = np.array([np.resize(each.values[measure], len(row.values[measure])) for each in own])
            values[name] = tuple(_at(clock[row.spp], [each.seconds for each in own], errors).tolist())
        completed.append(replace(row, values=values))
    return completed


def _at(seconds: float, times: Sequence[float], errors: NDArray) -> NDArray:
    """Return errors (keys) in some time, from those (times, keys) in ascending times."""
    if len(times) == 1:
        return errors[0] * (times[0] / seconds) ** 0.5
    place = int(np.clip(np.searchsorted(times, seconds), 1, len(times) - 1))
    before, after = times[place - 1], times[place]
    # Equal times have no exponent, and an error of 0 stays 0.
    grown = max(np.log(after / before), np.finfo(float).tiny)
    fallen = np.log(np.maximum(errors[place - 1 : place + 1], np.finfo(float).tiny))
    exponent = np.clip((fallen[1] - fallen[0]) / grown, STEEPEST, 0.0)
    return errors[place - 1] * (seconds / before) ** exponent

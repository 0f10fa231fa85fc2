"""Comparisons on scenes of Mitsuba 3, whose images are made by a process of their own."""

import hashlib
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis import Comparison, ComparisonRow
from figures.arena import _mitsuba_process
from figures.making import own_process
from figures.shared.mitsuba_runs import mitsuba_scenes

SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
"""Mitsuba's, for the command line."""

OF_MITSUBA = "Mitsuba, "
"""Their names in plots begin so."""

AGAINST = ("independent", "multijitter", "owen", "z", "hilbert")

PASSES = 16
"""Of a reference, each with four times as many samples as the images of most."""

TIMED = ("RMS error", "filtered error")
STEEPEST = -1.5
"""Exponent of time with which errors fall at most: that of scrambled nets and smooth integrands."""

EQUAL_TIME = tuple(f"{measure} at equal time" for measure in TIMED)


class Entry(NamedTuple):
    """A sampler: its name in plots, and the kind and text by which the process makes it."""

    name: str
    kind: str
    text: str


class Wanted(NamedTuple):
    """Numbers of samples, the longer side of images, and the number of keys."""

    spps: Sequence[int]
    side: int
    keys: int


def compare(
    entries: Sequence[Entry],
    scenes: Sequence[Path],
    wanted: Wanted,
    folder: Path,
    progress: Callable[[float], None],
) -> tuple[Comparison, list[str]]:
    """Return what samplers make of scenes in files, and what is to be said about it.

    References are kept in ``folder``: another comparison takes what it finds there.
    """
    variant, most = "llvm_ad_rgb" if mitsuba_scenes.has_llvm() else "scalar_rgb", wanted.spps[-1]
    rows, left_out, references, notes, promises = [], {}, {}, [], {}
    for done, path in enumerate(scenes, start=1):
        images = _rendered(entries, path, wanted, folder, variant)
        reference = np.asarray(images["reference"], np.float64)
        references[path.stem] = reference
        own = []
        for number, entry in enumerate(entries):
            if f"promises {number}" in images:
                promises[entry.name] = images[f"promises {number}"].tolist()
            for spp in wanted.spps:
                if f"why {number} {spp}" in images:
                    left_out[path.stem, entry.name, spp] = str(images[f"why {number} {spp}"])
                    continue
                of, seconds = images[f"images {number} {spp}"], float(images[f"seconds {number} {spp}"])
                own.append(ComparisonRow.of_images(path.stem, entry.name, spp, of, reference, seconds))
        rows += at_equal_time(own)
        least = min((row.mean("RMS error") for row in own), default=np.nan)
        error = float(np.sqrt(np.mean(images["error"] ** 2)))
        notes.append(
            f"{path.stem}: the reference is the mean of {int(images['passes'])} images of {4 * most} "
            f"samples by {_mitsuba_process.REFERENCE}. Its RMS error is {error:.2g}, {error / least:.2f} of "
            "the least one of a sampler."
        )
        progress(done / len(scenes))
    notes += [
        f"Mitsuba's variant is {variant}; its samplers are those named so. Ours have {_mitsuba_process.DIMS} "
        "dimensions, the plugin adds others. Films have a box filter, and --size is their longer side.",
        "At equal time: errors in the time that the first of Mitsuba's samplers takes for so many samples, "
        "interpolated between the sampler's own numbers of samples by power laws. Times are medians of "
        f"{_mitsuba_process.TIMED} images, taken in turns.",
    ]
    points: dict[str, Any] = {entry.name: {} for entry in entries}
    return Comparison(tuple(rows), points, promises, left_out, references), notes


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
    first = next((row.sampler for row in rows if row.sampler.startswith(OF_MITSUBA)), None)
    if first not in whole:
        return list(rows)
    clock = {row.spp: row.seconds for row in of_sampler[first]}
    made = []
    for row in rows:
        own, values = of_sampler[row.sampler], dict(row.values)
        for measure, named in zip(TIMED, EQUAL_TIME, strict=True):
            errors = np.array([np.resize(each.values[measure], len(row.values[measure])) for each in own])
            values[named] = tuple(_at(clock[row.spp], [each.seconds for each in own], errors).tolist())
        made.append(replace(row, values=values))
    return made


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


def _rendered(
    entries: Sequence[Entry], scene: Path, wanted: Wanted, folder: Path, variant: str
) -> dict[str, Any]:
    """Return the images of a scene, by a process of their own."""
    of = scene.resolve(), wanted.side, wanted.spps[-1], variant, metadata.version("mitsuba")
    digest = hashlib.sha256(repr(of).encode() + scene.read_bytes()).hexdigest()[:12]
    with tempfile.TemporaryDirectory() as temporary:
        task = {
            "scene": str(scene.resolve()),
            **wanted._asdict(),
            "samplers": [[entry.kind, entry.text] for entry in entries],
            "passes": PASSES,
            "variant": variant,
            "result": str(Path(temporary, "result.npz")),
            "kept": str((folder / f"reference-{scene.stem}-{digest}.npz").resolve()),
        }
        own_process.run(_mitsuba_process, task=task)
        with np.load(task["result"]) as result:
            return dict(result)

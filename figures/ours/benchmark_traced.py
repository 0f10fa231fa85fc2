"""Run time against error of ray-traced scenes: samplers, and Mitsuba 3 with its own."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from figures.plot import Style, style
from figures.shared import mitsuba_scenes, traced_sweep
from figures.shared.error_over_time import best, counted, legend, lines, time_for
from figures.shared.traced_sweep import OURS


class Size(NamedTuple):
    """How much is measured."""

    side: int
    counts: tuple[int, ...]
    turns: int
    bounces: int
    scenes: int
    reference: int


SIZES = {
    "draft": Size(64, (4, 16), 2, 2, 1, 512),
    "paper": Size(128, (1, 4, 16, 64), 3, 4, 5, 1024),
}

STYLES = {name: style(name) for name in OURS} | {
    "Mitsuba, independent": Style(*style("random")[:2], "--"),
    "Mitsuba, stratified": Style(*style("jittered grid")[:2], "--"),
    "Mitsuba, multijitter": Style("C2", "v", "--"),
    "Mitsuba, orthogonal": Style("C2", "^", "--"),
    "Mitsuba, ldsampler": Style("C4", "D", "--"),
}
"""Mitsuba's are dashed."""

NOTE = (
    "{side} x {side} pixels, box filter, errors over linear RGB; all programs in one run, taking turns. "
    "Seconds are medians of {turns} images after the first, each with a new key, until the image is in "
    "memory: without compiling or loading. Mitsuba (scalar_rgb, all threads) is in a process of its own and "
    "takes its times there, after an image that is not counted, so that neither its start nor what passes "
    "between processes is in them. Ours are by one program for points and one for a scene's values, since "
    "each pair of both in one would compile for minutes. Orthogonal arrays have squares of primes "
    "as numbers of samples, 'ldsampler' powers of 4: times and errors are of the samples taken. "
    "References: {origins}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all samplers on all scenes, and draw error over time."""
    size = SIZES[quality]
    compared = dict(list(traced_sweep.cases(size.bounces).items())[: size.scenes])
    columns = min(3, size.scenes)
    rows_of_panels = -(-size.scenes // columns)
    figure = Figure(figsize=(3.5 * columns + 2, max(3.6, 3.3 * rows_of_panels)), layout="constrained")
    figure.suptitle("Error over run time of ray-traced scenes (lower left is better)")
    panels = np.ravel(figure.subplots(rows_of_panels, columns, squeeze=False))
    for axes in panels[size.scenes :]:
        axes.set_axis_off()
    measured: dict[str, dict] = {}
    table, origins = [], ""
    for done, (axes, (name, (scene, shared))) in enumerate(zip(panels, compared.items(), strict=False), 1):
        exact = traced_sweep.reference(scene, size.side, size.reference)
        rows = traced_sweep.rows(scene, shared, size.side, size.counts, size.turns, exact)
        lines(axes, rows, "sampler", STYLES)
        axes.axhline(exact.error, color="0.6", lw=0.8, zorder=0, label="error of the reference")
        axes.set_title(f"{name}, {size.side} x {size.side}, {counted(rows)}")
        measured[name] = _compared(rows) | {"error of the reference": exact.error}
        table += [{"scene": name, **row} for row in rows]
        origins += f"{name}, {exact.origin}, RMS error {exact.error:.1e}. "
        progress(done / len(compared))
    legend(figure, panels[: len(compared)], "center", "samplers")
    missing = "" if mitsuba_scenes.installed() else " Mitsuba is not installed: pip install mitsuba."
    return figure, {
        "table": table,
        "measured": {name: found | {"in words": _sentence(found)} for name, found in measured.items()},
        "claims": {
            "all samplers of low discrepancy have less error than random samples at the largest count": {
                name: _below_random(table, name) for name in measured
            },
        },
        "note": NOTE.format(side=size.side, turns=size.turns, origins=origins.strip()) + missing,
    }


def _compared(rows: list[dict]) -> dict:
    """Return what is best, and the times to the error of the most random samples of ours."""
    random = [row for row in rows if row["sampler"] == "random"]
    most = max(random, key=lambda row: row["spp"])
    error = most["rms error"]
    names = dict.fromkeys(row["sampler"] for row in rows)
    times = {name: time_for([row for row in rows if row["sampler"] == name], error) for name in names}
    theirs = [name for name in times if name not in OURS]
    ours = min(OURS, key=lambda name: times[name])
    ratios = {name: times[name] / times[ours] for name in names}
    found: dict = {
        "best": best(rows, "sampler"),
        "samples": most["spp"],
        "error asked for": error,
        "seconds to it": times,
        "fastest of ours": ours,
        "times as long as the fastest of ours": ratios,
    }
    if theirs:
        means = [
            row["mean over the reference's"]
            for row in rows
            if row["sampler"] in theirs and row["spp"] >= most["spp"]
        ]
        found |= {
            "fastest of Mitsuba's": min(theirs, key=lambda name: times[name]),
            "mean of Mitsuba's images of most samples over the reference's": float(np.mean(means)),
        }
    return found


def _sentence(found: dict) -> str:
    """Return in words how long samplers take to the error of random samples."""
    ratios, ours = found["times as long as the fastest of ours"], found["fastest of ours"]
    text = f"To the error of {found['samples']} random samples, these take {ratios['random']:.2g} times"
    if "fastest of Mitsuba's" in found:
        theirs = found["fastest of Mitsuba's"]
        text += f", and the fastest sampler of Mitsuba's, {theirs}, {ratios[theirs]:.2g} times"
    return f"{text} as long as {ours}."


def _below_random(table: list[dict], name: str) -> bool:
    errors = {(row["sampler"], row["spp"]): row["rms error"] for row in table if row["scene"] == name}
    last = max(spp for sampler, spp in errors if sampler == "random")
    return all(errors[sampler, last] < errors["random", last] for sampler in OURS if sampler != "random")

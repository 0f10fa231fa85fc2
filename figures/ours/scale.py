"""What grows with the size: time and memory of images over samples, and of measures over points."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from figures.making import this_machine
from figures.shared.sheets.panels import legend_below, name_axes, new_figure
from figures.shared.timing import image_scaling, measure_scaling

DOUBLED, WITHIN = 2.0, 0.1
"""The factor of the time of twice the samples, and how far off it may be."""
LABELS = {"pixels": "more pixels", "spp": "more samples per pixel"}
LARGE = 2**20
"""Samples of the whole image from which on the time to start does not count any more."""
IMAGES = {
    "pixels": f"more pixels, {image_scaling.AT} samples per pixel",
    "spp": f"more samples per pixel, {image_scaling.SIDE} x {image_scaling.SIDE} pixels",
}

MEMORY = "times the points' memory"
LEAST = 2**23
"""Bytes of points below which tables and batches, which do not grow, are most of the memory."""
ALLOWED = 3
"""Times the points' memory that a measure may take."""
COLORS = (*(f"C{k}" for k in range(8)), "tab:brown")

NOTE = (
    "On {cores} cores, compiled before. Images: checkerboard, sampler z, float32; the fastest of "
    "several calls, or one. Processor time counts all threads, and is less disturbed by other programs "
    "than wall-clock time. The factor per doubling is the square root of the factor between sizes, each "
    "four times the last. Memory: peak above that before, less the image itself; large images take "
    "several calls. Measures: of the first n Sobol' points, float64, one call after a first one. "
    "Dashed: expected growth, through the time at the largest n. Memory: peak above that before the "
    "call, relative to the points, if these take 8 MiB or more. In 3-D the star discrepancy is bounded "
    "by counts in 251^3 cells, in 2-D it is exact. Exponents are least squares over the larger half of "
    "the n, ignoring logarithmic factors."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in separate processes, and draw time and memory over sizes."""
    images = this_machine.measure_apart(image_scaling, quality)
    progress(0.4)
    measures = this_machine.measure_apart(measure_scaling, quality)
    progress(0.9)
    figure = new_figure(
        "Time is proportional to the samples of an image, memory is not",
        7.6,
    )
    (of_images, image_memory), (of_measures, measure_memory) = figure.subplots(2, 2)
    doublings = _images(of_images, image_memory, images)
    table = _measures(of_measures, measure_memory, measures)
    legend = "Measures: expected growth (dashed), and measured exponent; triangles: 3-D"
    legend_below(figure, of_measures, 2, title=legend)
    for axes in figure.axes:
        axes.xaxis.set_minor_formatter(NullFormatter())
    return figure, {
        "measured": {
            "images": images,
            "measures": measures,
            "images, in short": _of_images(images, doublings),
            f"more than {ALLOWED} times the points' memory at the largest n": {
                row["measure"]: row[MEMORY] for row in table if (row[MEMORY] or 0) > ALLOWED
            },
        },
        "table": table,
        "note": NOTE.format(cores=this_machine.machine()["cores"]),
    }


def _images(times: Axes, memory: Axes, measured: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Draw time per sample and memory, and return the factors of doublings of large images."""
    doublings = {}
    for number, (kind, name) in enumerate(IMAGES.items()):
        rows = measured[kind]
        sizes = np.array([row["side"] ** 2 * row["spp"] for row in rows], float)
        busy = [row["processor seconds"] for row in rows]
        seconds = [row["seconds"] for row in rows]
        for of, line, clock in ((busy, "o-", "processor time"), (seconds, "x--", "wall clock")):
            label = f"{LABELS[kind]}: {clock}"
            times.plot(sizes, np.array(of) / sizes * 1e9, line, ms=4, lw=1, color=f"C{number}", label=label)
        beyond = [row["beyond"] for row in rows]
        if None not in beyond:
            memory.plot(sizes, np.array(beyond) / 2**20, "o-", ms=4, lw=1, color=f"C{number}")
        doublings[name] = {
            f"{size:.0f} samples": float(np.sqrt(after / before))
            for size, (before, after) in zip(sizes[1:], pairwise(busy), strict=True)
            if size > LARGE
        }
    x = "samples of the whole image"
    name_axes(times, x, "nanoseconds per sample", "Images: time", log="xy", legend="best")
    name_axes(memory, x, "MiB", "Images: memory besides the image", log="x")
    memory.set_ylim(bottom=0)
    return doublings


def _of_images(measured: Mapping[str, Any], doublings: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Return what images cost, from the smallest to the largest."""
    factors = [factor for of in doublings.values() for factor in of.values()]
    beyond = {kind: [(row["beyond"] or 0) / 2**20 for row in measured[kind]] for kind in IMAGES}
    inside = sum(abs(factor - DOUBLED) <= WITHIN for factor in factors)
    return {
        f"a doubling takes, from {LARGE} samples on": doublings,
        f"of {len(factors)} doublings, within {DOUBLED} +- {WITHIN}": inside,
        "milliseconds of a call, however small": 1e3
        * min(row["seconds"] for kind in IMAGES for row in measured[kind]),
        "MiB beyond the image, at most": {IMAGES[kind]: max(of) for kind, of in beyond.items()},
        "bytes per pixel beyond the largest image": beyond["pixels"][-1]
        * 2**20
        / measured["pixels"][-1]["side"] ** 2,
        "processor time of a mesh of one device / of none": 1 + measured["overhead"]["processor seconds"],
    }


def _measures(times: Axes, memory: Axes, measured: Mapping[str, Any]) -> list[dict[str, Any]]:
    table = []
    for color, (name, rows) in zip(COLORS, measured.items(), strict=False):
        n, seconds = np.array(rows["n"], float), np.array(rows["seconds"])
        slope, (power, logs) = _slope(n, seconds), rows["theory"]
        exponent = "" if slope is None else f", measured {slope:.2f}"
        label = f"{name}: {_grows(power, logs)}{exponent}"
        style = "o-" if rows["dims"] == 2 else "^-"
        times.plot(n, seconds, style, ms=4, color=color, label=label)
        expected = n**power * np.log(n) ** logs
        times.plot(n, expected * (seconds[-1] / expected[-1]), "--", lw=0.8, color=color)
        row: dict[str, Any] = {
            "measure": name,
            "n": rows["n"][-1],
            "seconds": seconds[-1],
            "processors busy": rows["processor seconds"][-1] / seconds[-1],
            "exponent": slope,
            "expected": _grows(power, logs).replace("$", ""),
            MEMORY: None,
        }
        own = n * rows["dims"] * 8
        shown = own >= LEAST
        if shown.any() and None not in rows["bytes"]:
            ratio = (np.array(rows["bytes"]) / own)[shown]
            memory.plot(n[shown], ratio, style, ms=4, color=color)
            row[MEMORY] = float(ratio[-1])
        table.append(row)
    memory.axhline(ALLOWED, color="black", lw=0.8, label=f"{ALLOWED} times")
    name_axes(times, "points", "seconds", "Measures: time of a call", log="xy")
    name_axes(memory, "points", MEMORY, "Measures: peak memory of a call", log="x", legend="best")
    memory.set_ylim(bottom=0)
    return table


def _grows(power: float, logs: int) -> str:
    n = "n" if power == 1 else f"n^{{{power:g}}}"
    return "$" + n + ("", r" \log n", r" \log^2 n")[logs] + "$"


def _slope(n: np.ndarray, seconds: np.ndarray) -> float | None:
    """Return the exponent of the larger half, if there are two n."""
    half = len(n) // 2
    return float(np.polyfit(np.log(n[half:]), np.log(seconds[half:]), 1)[0]) if len(n) - half > 1 else None

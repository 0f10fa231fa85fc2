"""Images of more pixels and more samples: time that grows in proportion, memory that does not."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure

from figures.making import own_process
from figures.shared import image_scaling

DOUBLED, WITHIN = 2.0, 0.1
"""The factor of the time of twice the samples, and how far off it may be."""
LARGE = 2**20
"""Samples of the whole image from which on the time to start does not count any more."""
NAMES = {
    "pixels": f"over pixels, {image_scaling.AT} samples a pixel",
    "spp": f"over samples a pixel, {image_scaling.SIDE} x {image_scaling.SIDE}",
}

NOTE = (
    "Checkerboard, sampler z, float32, on {cores} cores, compiled before. Each point is the least of several "
    "calls, or one. Processor time is that of all threads, and other programs disturb it less than "
    "they do the clock. The factor of a doubling is the square root of that from one size to the next, four "
    "times as large. {factors}A call takes {start:.1f} ms however small the image. Memory is the peak over "
    "that before, less the image's own: at most {of_spp:.1f} MiB over samples and {of_pixels:.0f} MiB over "
    "pixels, where large images are made in several calls, {largest:.0f} MiB, or {each:.2f} bytes a pixel, "
    "for the largest. A mesh of one device takes "
    "{overhead:+.1%} of the processor time of none at {side} x {side}. Drafts are small and say little."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in a process of its own, and draw time a sample and memory over the number of samples."""
    from figures.making.this_machine import machine

    measured = own_process.measured(image_scaling, quality)
    progress(0.9)
    figure = Figure(figsize=(9, 4.4), layout="constrained")
    times, memory = figure.subplots(1, 2)
    table = []
    for number, (kind, name) in enumerate(NAMES.items()):
        rows = measured[kind]
        sizes = np.array([row["side"] ** 2 * row["spp"] for row in rows], float)
        color = f"C{number}"
        for key, line in (("processor seconds", "o-"), ("seconds", "x--")):
            each = np.array([row[key] for row in rows]) / sizes * 1e9
            label = f"{name}, {'processors' if line == 'o-' else 'clock'}"
            times.loglog(sizes, each, line, ms=4, lw=1, color=color, label=label)
        more = [None if row["beyond"] is None else row["beyond"] / 2**20 for row in rows]
        if None not in more:
            memory.semilogx(sizes, more, "o-", ms=4, lw=1, color=color)
        factors = [None, *_doublings([row["processor seconds"] for row in rows])]
        for row, size, factor, extra in zip(rows, sizes, factors, more, strict=True):
            table.append(
                {
                    "pixels": f"{row['side']} x {row['side']}",
                    "spp": row["spp"],
                    "samples": size,
                    "seconds": row["seconds"],
                    "ns a sample": row["seconds"] / size * 1e9,
                    "processor ns a sample": row["processor seconds"] / size * 1e9,
                    "a doubling takes": factor,
                    "MiB beyond the image": extra,
                }
            )
    times.set(title="time a sample", xlabel="samples of the whole image", ylabel="nanoseconds")
    memory.set(title="memory beyond the image", xlabel="samples of the whole image", ylabel="MiB")
    memory.set_ylim(bottom=0)
    for axes in (times, memory):
        axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    shared = measured["overhead"]
    every = [row for kind in NAMES for row in measured[kind]]
    beyond = {kind: [(row["beyond"] or 0) / 2**20 for row in measured[kind]] for kind in NAMES}
    note = NOTE.format(
        cores=machine()["cores"],
        factors=_told(table),
        start=1e3 * min(row["seconds"] for row in every),
        of_spp=max(beyond["spp"]),
        of_pixels=max(beyond["pixels"]),
        largest=beyond["pixels"][-1],
        each=beyond["pixels"][-1] * 2**20 / measured["pixels"][-1]["side"] ** 2,
        overhead=shared["processor seconds"],
        side=shared["side"],
    )
    return figure, {"measured": measured, "table": table, "note": note}


def _doublings(seconds: list[float]) -> list[float]:
    """Return by which factor the time grows for twice the samples, of times of four times as many each."""
    return [float(np.sqrt(after / before)) for before, after in pairwise(seconds)]


def _told(table: list[dict]) -> str:
    """Say how many doublings of large images are as they should be."""
    large = [row for row in table if row["samples"] > LARGE and row["a doubling takes"] is not None]
    if not large:
        return ""
    factors = [row["a doubling takes"] for row in large]
    inside = sum(abs(factor - DOUBLED) <= WITHIN for factor in factors)
    return (
        f"From 2^{int(np.log2(LARGE))} samples on it is {min(factors):.2f} to {max(factors):.2f}, in "
        f"{inside} of {len(factors)} cases within {DOUBLED} +- {WITHIN}. "
    )

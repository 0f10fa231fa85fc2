"""What measures of up to 2^24 points cost: time beside theory and peers, memory, and gradients."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from figures.making import own_process
from figures.shared import measure_cost

MEMORY = "times the points' memory"
LEAST = 2**23
"""Bytes of points below which tables and batches, which do not grow, are most of the memory."""

COLORS = (*(f"C{k}" for k in range(8)), "tab:brown")
OF_FAMILIES = dict(zip(measure_cost.FAMILIES, ("C0", "0.6", "C4", "C2"), strict=True))

ALLOWED = 3
"""Times the points' memory that a measure may take."""

NOTE = (
    "The first n Sobol' points, float64; one call after another one, on {cores} cores. Dashed: the growth "
    "that is expected, through the time at the largest n. Memory is the peak over that before the call, by "
    "the points' own, where those take 8 MiB or more: below, tables and batches of tens of MiB are most of "
    "it. In 3-D the star discrepancy is bounded by counts in 251^3 cells, in 2-D it is exact. Exponents are "
    "least squares over the larger half of the n, without logarithms. {held} of {all} measures take at most "
    "{allowed} times the points' memory at their largest n{others}. Beside peers and with gradients: "
    "medians of calls after the first, black is what was asked for. cKDTree is built with boxsize=1 and "
    "asked with two workers; scipy's L2-star discrepancy is the value alone, ours includes the gradient. "
    "Titles name the sizes of the paper quality. Drafts are small and say little."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in a process of its own, and draw time and memory over n, and bars of ratios."""
    measured = own_process.measured(measure_cost, quality)
    progress(0.9)
    figure = Figure(figsize=(12, 10), layout="constrained")
    (times, memory), (peers, gradients) = figure.subplots(2, 2)
    table = []
    for color, (name, rows) in zip(COLORS, measured["scaling"].items(), strict=False):
        n, seconds = np.array(rows["n"], float), np.array(rows["seconds"])
        slope, (power, logs) = _slope(n, seconds), rows["theory"]
        label = f"{name}: {_grows(power, logs)}" + (
            "" if slope is None else f", measured $n^{{{slope:.2f}}}$"
        )
        style = "o-" if rows["dims"] == 2 else "^-"
        times.loglog(n, seconds, style, ms=4, color=color, label=label)
        expected = n**power * np.log(n) ** logs
        times.loglog(n, expected * (seconds[-1] / expected[-1]), "--", lw=0.8, color=color)
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
            memory.semilogx(n[shown], ratio, style, ms=4, color=color)
            row[MEMORY] = float(ratio[-1])
        table.append(row)
    memory.axhline(ALLOWED, color="black", lw=0.8)
    times.set(title="time of a call", xlabel="points", ylabel="seconds")
    memory.set(title="peak memory of a call (line: 3 times)", xlabel="points", ylabel=MEMORY)
    memory.set_ylim(bottom=0)
    for axes in (times, memory):
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
    _peers(peers, measured["against peers"])
    for k, entry in enumerate(measured["gradients"].values()):
        gradients.barh(k, entry["ratio"], color="C0")
    gradients.axvline(measure_cost.ASKED_RATIO, color="black")
    gradients.set_yticks(range(len(measured["gradients"])), list(measured["gradients"]))
    gradients.set(title="with gradient / value (lower is better)", xlabel="ratio")
    for axes in (peers, gradients):
        axes.invert_yaxis()
        axes.grid(axis="x", alpha=0.3)
    figure.legend(
        *times.get_legend_handles_labels(),
        loc="outside lower center",
        ncols=2,
        frameon=False,
        title="expected growth, and measured exponent; triangles: 3-D",
    )
    return figure, {"measured": measured, "table": table, "note": _note(table)}


def _peers(axes: Axes, cases: dict[str, dict]) -> None:
    """Draw the ratios for all families of points, and a line at what was asked for."""
    height = 0.8 / len(OF_FAMILIES)
    for row, entry in enumerate(cases.values()):
        for k, (family, color) in enumerate(OF_FAMILIES.items()):
            label = None if row else family
            axes.barh(row + (k - 1.5) * height, entry["ratio"][family], height, color=color, label=label)
        axes.plot([entry["asked"]] * 2, [row - 0.4, row + 0.4], color="black")
    titles = [f"{name.replace(' / ', chr(10) + '/ ')}\n(n = {entry['n']})" for name, entry in cases.items()]
    axes.set_yticks(range(len(cases)), titles, fontsize=8)
    axes.set(title="times as fast as the peer (higher is better)", xlabel="ratio")
    axes.legend(frameon=False)


def _note(table: list[dict[str, Any]]) -> str:
    from figures.making.this_machine import machine

    told = [row for row in table if row[MEMORY] is not None]
    more = [row for row in told if row[MEMORY] > ALLOWED]
    others = "; more take " + ", ".join(
        f"{row['measure']} ({row[MEMORY]:.1f} at n = {row['n']})" for row in more
    )
    return NOTE.format(
        cores=machine()["cores"],
        held=len(told) - len(more),
        all=len(told),
        allowed=ALLOWED,
        others=others if more else "",
    )


def _grows(power: float, logs: int) -> str:
    """Return a growth as a formula."""
    n = "n" if power == 1 else f"n^{{{power:g}}}"
    return "$" + n + ("", r" \log n", r" \log^2 n")[logs] + "$"


def _slope(n: np.ndarray, seconds: np.ndarray) -> float | None:
    """Return the exponent of the larger half, if there are two n."""
    half = len(n) // 2
    return float(np.polyfit(np.log(n[half:]), np.log(seconds[half:]), 1)[0]) if len(n) - half > 1 else None

"""Run time against error: samplers in exact and traced scenes."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from figures.making import this_machine
from figures.plot import style
from figures.shared.sheets.panels import name_axes, new_figure
from figures.shared.timing import speed_sweep

ADAPTIVE = ", adaptive"
"""What the names of samplers end with that skip constant pixels."""

Rows = list[dict]
"""Each has ``spp``, ``seconds``, ``rms error`` and the name of what was measured."""

SHOWN = ("checkerboard", "soft shadow", "Cornell box, area light", "interior, 4 bounces", "helicopter")
"""Scenes that have a panel, and a row of the table as all others."""

COLUMNS = 3
"""Of panels."""
TABLE = ("scene", "sampler", "spp", "seconds", "rms error")

NOTE = (
    "Box filter, medians of calls after the first, each with a new key; samplers alternate. Scenes with "
    "exact pixel means: {side} x {side} pixels; 'best' is, at each time, the sampler of least error among "
    "those that took no longer. Traced scenes: {traced} x {traced} pixels, errors over linear RGB. "
    "References: {origins}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in a separate process, and draw error over time."""
    sweep = this_machine.measure_apart(speed_sweep, quality)
    rows, floors = [*sweep["exact"], *sweep["traced"]], sweep["floors"]
    traced = _by_scene(sweep["traced"])
    found = {name: _compare(of) for name, of in traced.items()}
    side, of_traced = speed_sweep.SIZES[quality][0], speed_sweep.TRACED[quality][0]
    return _draw(rows, floors, found), {
        "table": [{key: row[key] for key in TABLE} for row in rows],
        "measured": {
            "best": {name: best(of) for name, of in _by_scene(sweep["exact"]).items()},
            "traced": {name: of | {"error of the reference": floors[name]} for name, of in found.items()},
        },
        "claims": {
            "all samplers of low discrepancy have less error than random samples at the largest count": {
                name: _below_random(of) for name, of in traced.items()
            },
        },
        "note": NOTE.format(side=side, traced=of_traced, origins=sweep["origins"]),
    }


def _by_scene(rows: Rows) -> dict[str, Rows]:
    return {
        name: [row for row in rows if row["scene"] == name]
        for name in dict.fromkeys(r["scene"] for r in rows)
    }


def best(rows: Rows) -> Rows:
    """Return the Pareto front: rows of less error than all that took no longer."""
    front: Rows = []
    for row in sorted(rows, key=lambda row: row["seconds"]):
        if not front or row["rms error"] < front[-1]["rms error"]:
            front.append({key: row[key] for key in ("sampler", "spp", "seconds", "rms error")})
    return front


def time_for(rows: Rows, error: float) -> float:
    """Return the time that an error takes on one line, interpolated in logarithms, or prolonged."""
    errors = np.log([row["rms error"] for row in rows])
    seconds = np.log([row["seconds"] for row in rows])
    k = int(np.clip(np.searchsorted(-errors, -np.log(error)), 1, len(rows) - 1))
    part = (np.log(error) - errors[k - 1]) / (errors[k] - errors[k - 1])
    return float(np.exp(seconds[k - 1] + part * (seconds[k] - seconds[k - 1])))


def _compare(rows: Rows) -> dict[str, Any]:
    """Return what is best, and the times to the error of the most random samples."""
    most = max((row for row in rows if row["sampler"] == "random"), key=lambda row: row["spp"])
    error, names = most["rms error"], dict.fromkeys(row["sampler"] for row in rows)
    times = {name: time_for([row for row in rows if row["sampler"] == name], error) for name in names}
    least = min(times, key=lambda name: times[name])
    return {
        "best": best(rows),
        "samples": most["spp"],
        "error asked for": error,
        "seconds to it": times,
        "fastest of ours": least,
        "times as long as the fastest of ours": {name: times[name] / times[least] for name in names},
    }


def _below_random(rows: Rows) -> bool:
    """Return whether all have less error than random samples at the largest count of these."""
    last = max(row["spp"] for row in rows)
    errors = {row["sampler"]: row["rms error"] for row in rows if row["spp"] == last}
    return all(error < errors["random"] for name, error in errors.items() if name != "random")


def _draw(rows: Rows, floors: Mapping[str, float], found: Mapping[str, dict]) -> Figure:
    shown = {name: of for name, of in _by_scene(rows).items() if name in SHOWN}
    columns = min(COLUMNS, len(shown))
    down = -(-len(shown) // columns)
    longer = [of["times as long as the fastest of ours"]["random"] for of in found.values()]
    factor = f"{min(longer):.1f}" + f" to {max(longer):.1f}" * (len(longer) > 1)
    figure = new_figure(
        f"Random samples take {factor} times as long as the fastest sampler for an equal error\n"
        "traced scenes; a mark for each number of samples, lower left is better; grey: the reference's error",
        2.0 * down + 1.8,
    )
    panels = figure.subplots(down, columns, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    for axes, (name, of) in zip(panels, shown.items(), strict=False):
        _lines(axes, of)
        if name in floors:
            axes.axhline(floors[name], color="0.6", lw=0.8, zorder=0)
        axes.set_title(name)
    pairs = (zip(*axes.get_legend_handles_labels(), strict=True) for axes in panels)
    named = {name: line for of in pairs for line, name in of}
    loc: Any = "outside lower left"  # matplotlib's types know the sides inside only
    figure.legend(named.values(), named.keys(), loc=loc, ncols=3, frameon=False)
    return figure


def _lines(axes: Axes, rows: Rows) -> None:
    """Draw a line for each sampler, with quartiles of times, dashed and with empty marks if adaptive."""
    names = dict.fromkeys(row["sampler"] for row in rows)
    for name in names:
        chosen = [row for row in rows if row["sampler"] == name]
        seconds = np.array([row["seconds"] for row in chosen])
        edges = np.array([[row[f"seconds, {q} quartile"] for row in chosen] for q in ("lower", "upper")])
        plain = name.removesuffix(ADAPTIVE)
        drawn = style(plain, names)
        look: dict[str, Any] = {"ls": drawn.line} if plain == name else {"ls": "--", "mfc": "white"}
        look |= {"color": drawn.color, "marker": drawn.marker, "label": name}
        errors = [row["rms error"] for row in chosen]
        axes.errorbar(seconds, errors, xerr=np.abs(edges - seconds), ms=4, lw=1, **look)
    name_axes(axes, "seconds per image", "RMS error", log="xy")
    # Those of a decade would overlap.
    axes.xaxis.set_minor_formatter(NullFormatter())
    low, high = axes.get_xlim()
    if high < 10 * low:  # Powers of ten alone may leave the axis without any number.
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter("{x:g}")

"""How often confidence intervals hold the truth, and how often identical samplers are distinguished."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import bdtr, bdtrc, ndtr

from figures.plot import Style
from figures.shared.integrands import coverage, hundred_integrands, rare_events
from figures.shared.sheets.panels import curve, legend_below, name_axes, new_figure

TRIALS = {"draft": 200, "paper": 2000}
"""Of distinctions."""

SIZES = {
    "draft": {"few": (16, 256), "many": (32, 256)},
    "paper": {"few": (16, 1024), "many": (128, 128)},
}
"""Replicates, and points of each."""

TRIED = {"draft": 1, "paper": 30}
"""Keys of the hundred integrands."""

STOPPED = {"draft": (("student",), 1, 256, 12), "paper": (("student", "median"), 10, 2**14, 1)}
"""With a tolerance: kinds of intervals, keys, the most points, and every which integrand."""

SIGMAS = 5.0
COLORS = {"float32": "C0", "float64": "C1"}
KINDS = {
    "student": "C0",
    "median": "C1",
    "quantile": "C2",
    "betting": "C3",
    hundred_integrands.BERNSTEIN: "0.5",
}
MARKS = {"few": "o", "many": "s"}

RARE = {
    "draft": ((2**4, 2**10), (4, 8), 2**15, 30, ((0, 4), 2**13, 1)),
    "paper": ((2**4, 2**8, 2**12, 2**16, 2**20), (4, 8, 32), 2**26, 200, ((0, 2, 4, 6), 2**18, 10)),
}
"""Rare events: points, replicates, points of all trials of a cell, and trials at most; with a tolerance:
numbers of probabilities, the most points, and keys."""

FEWEST_TRIALS = 10
TITLE = "Intervals hold what they promise, or say that they are not sure"

NOTE = (
    "(a) Indicators of sets in 1 to 4 dimensions and of their complements, probabilities of 1e-6 to .5, "
    "Sobol' points, 95 % intervals. Lines are means over sets with about the same expected number of "
    "hits, shades reach down to the worst. Tolerances are a fifth of the probability, at least 1e-5. "
    f"(b) Integrands in 1 to 8 dimensions; bars of {SIGMAS:g} standard deviations of a binomial, for all "
    "cells of an integrand, the tolerance of the tests. Where rounding or resolution widens an "
    f'interval, it may cover more often than stated, and is tested on one side; "{coverage.SKEWED}" is '
    "not tested: its errors are skewed, and the docstring of integrate says so. (d, e) "
    f"{hundred_integrands.COUNT} integrands with values in [0, 1] and exact integrals, in 1 to 8 "
    f"dimensions, Sobol' points: 'few' means {{few[0]}} replicates of {{few[1]}} points, 'many' "
    f"{{many[0]}} of {{many[1]}}. Width: geometric means relative to Student's interval with few "
    f"replicates, over integrands and {{tried}} keys. The median narrows the interval with linear "
    "scrambling (kind median), and less with Owen's (kind quantile); medians of many replicates miss "
    "the integral if their distribution is skewed. Betting intervals hold for every distribution; "
    "empirical Bernstein intervals use the same replicates. (c) Share of distinguished pairs of 6 samplers, "
    "each with that many times the error of the one before; normal errors of 5 %. Not drawn: coverage of "
    "the last intervals to a tolerance, up to {points} points in each of 8 replicates, and the largest "
    "share of trials that call any two of 2 to 12 identical samplers different, which should be at most 5 %."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure coverage and distinctions, and draw both."""
    cells = coverage.measure_coverage(quality == "paper")
    progress(0.3)
    rows = coverage.measure_distinctions(TRIALS[quality])
    sizes, tried = SIZES[quality], TRIED[quality]
    kinds = hundred_integrands.measure(sizes, range(tried), lambda part: progress(0.3 + 0.2 * part))
    asked, keys, points, every = STOPPED[quality]
    width = kinds["student", "few"].width.mean(axis=0)
    # With other keys than those of the tolerances.
    keys = range(tried, tried + keys)
    stops = {kind: hundred_integrands.stop_at_tolerance(kind, width, keys, points, every) for kind in asked}
    progress(0.7)
    rare, rare_stops = _rare(quality)
    held, widths = _of_kinds(kinds)
    last = {(kind, "few"): hundred_integrands.by_class(of.held, of.of_class) for kind, of in stops.items()}

    figure = new_figure(TITLE, 8.0)
    grid = figure.add_gridspec(3, 2, height_ratios=(1, 1.5, 1.3))
    first, *axes = (figure.add_subplot(grid[at]) for at in ((0, slice(None)), *list(np.ndindex(3, 2))[2:]))
    wrong = _rare_events(first, rare)
    _coverages(axes[0], cells)
    _power(axes[1], [row for row in rows if row["ratio"] != 1])
    level = hundred_integrands.LEVEL
    x = "share of intervals that hold the integral"
    _kinds(axes[2], held, level, "(d) 100 integrands: 95 % intervals", x)
    _kinds(axes[3], widths, 1, "(e) their width", "width / Student's width, few replicates")
    axes[3].set_xscale("log")
    legend_below(figure, axes[2])

    ratio = kinds[hundred_integrands.BERNSTEIN, "many"].width / kinds["betting", "many"].width
    return figure, {
        "measured": {
            "rare events": _worst(rare)
            | {"cases": sum(of.held.size for of in rare), "too low": wrong}
            | {f"to a tolerance, {_bounded(of.limits)}": _reached(of) for of in rare_stops},
            "coverage": {"cells": len(cells), **_tested(cells)}
            | {f"{level:.0%}": _share(cells, k) for k, level in enumerate(coverage.LEVELS)},
            "hundred integrands: held": {", ".join(case): of for case, of in held.items()},
            "hundred integrands: width / Student's": {", ".join(case): of for case, of in widths.items()},
            "empirical Bernstein / betting, width": {
                "mean": float(np.exp(np.log(ratio).mean())),
                "least": float(ratio.min()),
                "most": float(ratio.max()),
            },
            "to a tolerance": {
                kind: _reached(of)
                | {
                    "held": float(of.held.mean()),
                    "points of a replicate": float(of.n.mean()),
                    "by class": last[kind, "few"],
                }
                for kind, of in stops.items()
            },
            "most false distinctions": max(row["rate"] for row in rows if row["ratio"] == 1),
        },
        "table": rows,
        "note": NOTE.format(**sizes, tried=tried, points=points),
    }


def _reached(of: rare_events.Stopped | hundred_integrands.Stopped) -> dict[str, float]:
    missed = of.reached & ~of.within
    return {
        "results": of.reached.size,
        "reached": float(of.reached.mean()),
        "reached, and not within the tolerance": float(missed.mean()),
    }


def _rare(quality: str) -> tuple[list[rare_events.Held], list[rare_events.Stopped]]:
    """Return the cells of rare events, and results to a tolerance, with and without limits."""
    sizes, replicates, points, trials, (which, most, keys) = RARE[quality]
    cells = [
        rare_events.cell(n, count, limits, max(FEWEST_TRIALS, min(trials, points // (n * count))))
        for n in sizes
        for count in replicates
        for limits in (False, True)
    ]
    return cells, [
        rare_events.stop_at_tolerance(range(keys), most, limits, which) for limits in (False, True)
    ]


def _bounded(limits: bool) -> str:
    return "with limits" if limits else "without limits"


def _worst(rare: list[rare_events.Held]) -> dict[str, dict[str, float]]:
    """Return the least coverage by limits, replicates and points, and that of Student's intervals alone."""
    return {
        f"{_bounded(of.limits)}, {of.replicates} x {of.n}": {
            "trials": of.trials,
            "least held or not sure": float((of.held + of.unsure).min()),
            "least held by Student's alone": float(of.alone.min()),
            "most not sure": float(of.unsure.max()),
        }
        for of in rare
    }


def _rare_events(axes: Axes, rare: list[rare_events.Held]) -> int:
    """Draw parts over the expected number of hits; return in how many cases they are too low."""
    wrong = 0
    for of in rare:
        right = np.rint((of.held + of.unsure) * of.trials)
        wrong += int((bdtr(right, of.trials, rare_events.LEVEL) < ndtr(-SIGMAS)).sum())
    lines: dict[str, tuple[bool, Callable[[rare_events.Held], Any], str]] = {
        "with limits: hold": (True, lambda of: of.held, "C2-"),
        "without: hold, or say they are not sure": (False, lambda of: of.held + of.unsure, "C0-"),
        "without: hold": (False, lambda of: of.held, "C0--"),
        "Student's of the means alone: hold": (False, lambda of: of.alone, "C1:"),
    }
    for name, (limits, part, style) in lines.items():
        of = [each for each in rare if each.limits == limits]
        hits = np.concatenate([rare_events.expected(each).ravel() for each in of])
        parts = np.concatenate([part(each).ravel() for each in of])
        bins = np.round(2 * np.log10(hits)) / 2
        at = np.unique(bins)
        means = [parts[bins == each].mean() for each in at]
        axes.plot(10**at, means, style, lw=1.5, label=name)
        if style.endswith("-") and not style.endswith("--"):
            worst = [parts[bins == each].min() for each in at]
            axes.fill_between(10**at, worst, means, color=style[:2], alpha=0.15, lw=0)
    axes.axhline(rare_events.LEVEL, color="0.6", lw=0.8, zorder=0)
    x = "expected number of hits (or of misses, if these are fewer) in all replicates"
    title = "(a) rare events: 95 % intervals of indicators"
    name_axes(axes, x, "share of intervals", title, log="x", legend="lower right", frameon=True)
    axes.set_ylim(-0.02, 1.04)
    return wrong


def _share(cells: list[coverage.Cell], level: int) -> float:
    return sum(cell.held[level] for cell in cells) / sum(cell.trials for cell in cells)


def _tested(cells: list[coverage.Cell]) -> dict[str, int]:
    """Return how many cells and levels differ from their level by more than chance."""
    found = dict.fromkeys(("tests", "one_sided", "below", "above"), 0)
    chance = ndtr(-SIGMAS)
    for cell in cells:
        if cell.integrand == coverage.SKEWED:
            continue
        wide = cell.wider > 0
        found["one_sided"] += wide
        for level, held in zip(coverage.LEVELS, cell.held, strict=True):
            found["tests"] += 1
            found["below"] += bdtr(held, cell.trials, level) < chance
            found["above"] += not wide and held > 0 and bdtrc(held - 1, cell.trials, level) < chance
    return {name: int(count) for name, count in found.items()}


def _coverages(axes: Axes, cells: list[coverage.Cell]) -> None:
    """Draw the coverage of each level, a row for each integrand."""
    names = list(coverage.INTEGRANDS)
    for k, level in enumerate(coverage.LEVELS):
        axes.axvline(level, color="0.6", lw=0.8, zorder=0)
        for dtype, color in COLORS.items():
            for row, name in enumerate(names):
                of = [cell for cell in cells if (cell.integrand, cell.dtype) == (name, dtype)]
                if of:
                    count = sum(cell.trials for cell in of)
                    bar = SIGMAS * np.sqrt(level * (1 - level) / count)
                    y = row + (0.15 if dtype == "float64" else -0.15)
                    label = dtype if not k and not row else None
                    axes.errorbar(_share(of, k), y, xerr=bar, fmt="o", ms=3, lw=1, color=color, label=label)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set(title="(b) 90, 95 and 99 % intervals", xlabel="share of intervals that hold the integral")
    axes.set(xlim=(0.8, 1.02), ylabel="integrand")
    if any(cell.dtype == "float64" for cell in cells):
        axes.legend(loc="lower left")


Means = dict[hundred_integrands.Case, dict[str, float]]
"""By kind and number of replicates, for each class of integrands and all of them."""


def _of_kinds(found: dict[hundred_integrands.Case, hundred_integrands.Intervals]) -> tuple[Means, Means]:
    """Return the part of intervals that hold the integral, and their width relative to Student's."""
    classes = np.array([each.of_class for each in hundred_integrands.integrands()])
    usual = found["student", "few"].width
    held = {case: hundred_integrands.by_class(of.held, classes) for case, of in found.items()}
    logs = {
        case: hundred_integrands.by_class(np.log(of.width / usual), classes) for case, of in found.items()
    }
    return held, {case: {k: float(np.exp(v)) for k, v in of.items()} for case, of in logs.items()}


def _kinds(axes: Axes, means: Means, wanted: float, title: str, x: str) -> None:
    """Draw a row for each class, with marks for kinds of intervals, and a line at what is wanted."""
    axes.axvline(wanted, color="0.6", lw=0.8, zorder=0)
    names = list(next(iter(means.values())))
    for k, ((kind, size), of) in enumerate(means.items()):
        y = np.arange(len(names)) + 0.7 * ((k + 0.5) / len(means) - 0.5)
        fill = KINDS[kind] if size == "few" else "none"
        look = {"ms": 5, "color": KINDS[kind], "mfc": fill, "label": f"{kind}, {size}"}
        axes.plot(list(of.values()), y, MARKS[size], **look)
    axes.set(title=title, xlabel=x, ylabel="class of integrands")
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()


def _power(axes: Axes, rows: list[dict[str, Any]]) -> None:
    """Draw the share of distinguished pairs over the ratio of errors."""
    for color, keys in enumerate(coverage.KEYS):
        rates = {row["ratio"]: row["rate"] for row in rows if row["keys"] == keys}
        curve(axes, rates, Style(f"C{color}", "o"), lw=1.5, label=f"{keys} keys")
    x, y = "ratio of the errors of neighbours", "part of pairs distinguished"
    name_axes(axes, x, y, "(c) 6 different samplers", legend="best")
    axes.set_ylim(-0.02, 1.02)

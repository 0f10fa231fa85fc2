"""How often confidence intervals hold the truth, and how often identical samplers are told apart."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import bdtr, bdtrc, ndtr

from figures.shared import coverage, distinctions

TRIALS = {"draft": 200, "paper": 2000}
"""Of distinctions."""

SIGMAS = 5.0
COLORS = {"float32": "C0", "float64": "C1"}
STYLES = {"Holm": "-", "bootstrap": ":"}

NOTE = (
    "Left: intervals of qmcjax.integrate with replicates, in {cells} cells: {integrands} integrands "
    "and a skewed one, in 1 to 8 dimensions, {sequences}, {sizes} points, {replicates} replicates, up "
    "to {trials} trials a cell; bars of {sigmas:g} standard deviations of a binomial, for all cells "
    "of an integrand. Where rounding or resolution widens an interval, it may hold the integral more "
    "often than it says: {one_sided} cells are tested on one side. {below} of {tests} tests (cells "
    "and levels) lie below their level by more than {sigmas:g} sigma, by the binomial itself, {above} "
    'above; "{skewed}" is not tested: its errors are skewed, and the docstring of integrate says so. '
    "Middle: part of the trials in which any two of identical samplers are told apart, which should "
    "be 5 % at most; dotted, ranks by the bootstrap of earlier versions of analysis.compare. Right: "
    "part of all pairs of 6 samplers told apart, each with that many times the error of the one "
    "before; normal errors of 5 %."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure coverage and distinctions, and draw both."""
    cells = coverage.measured(quality == "paper")
    progress(0.9)
    rows = distinctions.measure(TRIALS[quality])
    figure = Figure(figsize=(13, 5.2), layout="constrained")
    figure.suptitle("How often intervals hold the integral, and how often samplers are told apart")
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.3, 1, 1))
    _coverages(left, cells)
    _distinguished(middle, [row for row in rows if row["ratio"] == 1])
    _power(right, [row for row in rows if row["ratio"] != 1])
    tested = _tested(cells)
    note = NOTE.format(
        **tested,
        cells=len(cells),
        integrands=len(coverage.INTEGRANDS) - 1,
        skewed=coverage.SKEWED,
        sequences=_listed({cell.sequence for cell in cells}),
        sizes=_listed({cell.n for cell in cells}),
        replicates=_listed({cell.replicates for cell in cells}),
        trials=max(cell.trials for cell in cells),
        sigmas=SIGMAS,
    )
    return figure, {
        "measured": {
            "coverage": tested
            | {f"{level:.0%}": _share(cells, k) for k, level in enumerate(coverage.LEVELS)},
            "most false distinctions": {
                rule: max(row[rule] for row in rows if row["ratio"] == 1) for rule in STYLES
            },
        },
        "table": rows,
        "note": note,
    }


def _listed(values: set[Any]) -> str:
    return ", ".join(str(value) for value in sorted(values))


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
    axes.set(title="intervals of 90, 95 and 99 %", xlabel="part that holds the integral")
    axes.set_xlim(0.8, 1.02)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def _distinguished(axes: Axes, rows: list[dict[str, Any]]) -> None:
    """Draw how often any two of identical samplers are told apart, the most over numbers of samplers."""
    for color, errors in enumerate(distinctions.ERRORS):
        for rule, style in STYLES.items():
            most = [
                max(row[rule] for row in rows if row["errors"] == errors and row["keys"] == keys)
                for keys in distinctions.KEYS
            ]
            label = errors if rule == "Holm" else None
            axes.plot(distinctions.KEYS, most, f"o{style}", ms=4, color=f"C{color}", label=label)
    axes.axhline(0.05, color="black", lw=0.8)
    axes.set(title="2 to 12 identical samplers", xlabel="keys", ylabel="told apart in (most)")
    axes.set_xscale("log", base=2)
    axes.set_xticks(distinctions.KEYS, [str(keys) for keys in distinctions.KEYS])
    axes.set_ylim(bottom=0)
    axes.legend(title="errors; dotted: bootstrap")


def _power(axes: Axes, rows: list[dict[str, Any]]) -> None:
    """Draw the part of all pairs that is told apart over the ratio of errors."""
    for color, keys in enumerate(distinctions.KEYS):
        of = [row for row in rows if row["keys"] == keys]
        for rule, style in STYLES.items():
            label = f"{keys} keys" if rule == "Holm" else None
            axes.plot(
                [row["ratio"] for row in of],
                [row[rule] for row in of],
                f"o{style}",
                ms=4,
                color=f"C{color}",
                label=label,
            )
    axes.set(title="6 different samplers", xlabel="ratio of errors, next to next", ylabel="pairs told apart")
    axes.set_ylim(-0.02, 1.02)
    axes.legend(title="dotted: bootstrap")

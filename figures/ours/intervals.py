"""How often confidence intervals hold the truth, and how often identical samplers are told apart."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import bdtr, bdtrc, ndtr

from figures.shared.integrands import coverage, distinctions, hundred_integrands, interval_kinds

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
STYLES = {"Holm": "-", "bootstrap": ":"}
KINDS = {"student": "C0", "median": "C1", "quantile": "C2", "betting": "C3", interval_kinds.BERNSTEIN: "0.5"}
MARKS = {"few": "o", "many": "s"}

NOTE = (
    "Top left: intervals of qmcjax.integrate with replicates, in {cells} cells: {integrands} integrands "
    "and a skewed one, in 1 to 8 dimensions, {sequences}, {sizes} points, {replicates} replicates, up "
    f"to {{trials}} trials a cell; bars of {SIGMAS:g} standard deviations of a binomial, for all cells "
    "of an integrand. Where rounding or resolution widens an interval, it may hold the integral more "
    "often than it says: {one_sided} cells are tested on one side. {below} of {tests} tests (cells "
    f"and levels) lie below their level by more than {SIGMAS:g} sigma, by the binomial itself, {{above}} "
    f'above; "{coverage.SKEWED}" is not tested: its errors are skewed, and the docstring of integrate says '
    "so. Top middle: share of trials that call any two of several identical samplers different, which "
    "should be 5 % at most; dotted, ranks by the bootstrap of earlier versions of analysis.compare. "
    "Top right: share of the pairs of 6 samplers that are distinguished, each with that many times "
    "the error of the one before; normal errors of 5 %. "
    f"Below: {hundred_integrands.COUNT} integrands with values in [0, 1] and exact integrals, in "
    "1 to 8 dimensions, Sobol', {tried} keys; few are {few[0]} replicates of {few[1]} points, many "
    "{many[0]} of {many[1]}. Width: geometric means relative to Student's interval with few replicates, over "
    "integrands and keys. The median narrows the interval with linear scrambling, which is the kind median; "
    "with Owen's nested scrambling, the kind quantile, its interval is {nested:.2f} times as wide as "
    "Student's, for smooth integrands. Medians of many replicates miss the integral if their "
    "distribution is skewed. Intervals by betting hold it whatever the distribution, and are that wide: "
    "empirical Bernstein intervals of the same replicates are {bernstein:.2f} times as wide, {least:.2f} to "
    "{most:.2f}. With a tolerance: part of the last intervals that hold the integral, of {stops} results "
    "with up to {points} points in each of 8 replicates; {reached:.0%} reached the tolerance."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure coverage and distinctions, and draw both."""
    cells = coverage.measured(quality == "paper")
    progress(0.4)
    rows = distinctions.measure(TRIALS[quality])
    sizes, tried = SIZES[quality], TRIED[quality]
    kinds = interval_kinds.measured(sizes, range(tried), lambda part: progress(0.4 + 0.3 * part))
    asked, keys, points, every = STOPPED[quality]
    width = kinds["student", "few"].width.mean(axis=0)
    # With other keys than those of the tolerances.
    keys = range(tried, tried + keys)
    stops = {kind: interval_kinds.stopped(kind, width, keys, points, every) for kind in asked}
    figure = Figure(figsize=(13, 10), layout="constrained")
    figure.suptitle("How often intervals contain the integral, and how often samplers are distinguished")
    (left, middle, right), lower = figure.subplots(2, 3, width_ratios=(1.3, 1, 1))
    _coverages(left, cells)
    _distinguished(middle, [row for row in rows if row["ratio"] == 1])
    _power(right, [row for row in rows if row["ratio"] != 1])
    held, widths = _of_kinds(kinds)
    _kinds(lower[0], held, interval_kinds.LEVEL)
    lower[0].set_title("100 integrands: intervals of 95 %")
    lower[0].set_xlabel("part of the intervals that contain the integral")
    _kinds(lower[1], widths, 1)
    lower[1].set(title="their width", xlabel="width / Student's width, few replicates", xscale="log")
    marked = dict(zip(*lower[0].get_legend_handles_labels()[::-1], strict=True))
    lower[0].legend(marked.values(), marked.keys(), loc="upper center", bbox_to_anchor=(0.6, -0.12), ncols=3)
    last = {(kind, "few"): interval_kinds.by_class(stop.held, stop.of_class) for kind, stop in stops.items()}
    _kinds(lower[2], last, interval_kinds.LEVEL)
    lower[2].set(title="to a tolerance", xlabel="part that contain the integral")
    ratio = kinds[interval_kinds.BERNSTEIN, "many"].width / kinds["betting", "many"].width
    bernstein = float(np.exp(np.log(ratio).mean()))
    results = sum(stop.held.size for stop in stops.values())
    tested = _tested(cells)
    note = NOTE.format(
        **tested,
        cells=len(cells),
        integrands=len(coverage.INTEGRANDS) - 1,
        sequences=_listed({cell.sequence for cell in cells}),
        sizes=_listed({cell.n for cell in cells}),
        replicates=_listed({cell.replicates for cell in cells}),
        trials=max(cell.trials for cell in cells),
        tried=tried,
        **sizes,
        nested=widths["quantile", "few"]["smooth"],
        bernstein=bernstein,
        least=float(ratio.min()),
        most=float(ratio.max()),
        stops=results,
        points=points,
        reached=sum(stop.reached.sum() for stop in stops.values()) / results,
    )
    return figure, {
        "measured": {
            "coverage": tested
            | {f"{level:.0%}": _share(cells, k) for k, level in enumerate(coverage.LEVELS)},
            "hundred integrands: held": {", ".join(case): of for case, of in held.items()},
            "hundred integrands: width / Student's": {", ".join(case): of for case, of in widths.items()},
            "empirical Bernstein / betting, width": [bernstein, float(ratio.min()), float(ratio.max())],
            "to a tolerance": {
                kind: {
                    "held": float(stop.held.mean()),
                    "reached, and not within the tolerance": float((stop.reached & ~stop.within).mean()),
                    "reached": float(stop.reached.mean()),
                    "points of a replicate": float(stop.n.mean()),
                    "by class": last[kind, "few"],
                }
                for kind, stop in stops.items()
            },
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
    axes.set(title="intervals of 90, 95 and 99 %", xlabel="part of the intervals that contain the integral")
    axes.set_xlim(0.8, 1.02)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


Means = dict[interval_kinds.Case, dict[str, float]]
"""By kind and number of replicates, for each class of integrands and all of them."""


def _of_kinds(found: dict[interval_kinds.Case, interval_kinds.Intervals]) -> tuple[Means, Means]:
    """Return the part of intervals that hold the integral, and their width relative to Student's."""
    classes = np.array([each.of_class for each in hundred_integrands.integrands()])
    usual = found["student", "few"].width
    held = {case: interval_kinds.by_class(of.held, classes) for case, of in found.items()}
    logs = {case: interval_kinds.by_class(np.log(of.width / usual), classes) for case, of in found.items()}
    return held, {case: {k: float(np.exp(v)) for k, v in of.items()} for case, of in logs.items()}


def _kinds(axes: Axes, means: Means, wanted: float) -> None:
    """Draw a row for each class, with marks for kinds of intervals, and a line at what is wanted."""
    axes.axvline(wanted, color="0.6", lw=0.8, zorder=0)
    names = list(next(iter(means.values())))
    for k, ((kind, size), of) in enumerate(means.items()):
        y = np.arange(len(names)) + 0.7 * ((k + 0.5) / len(means) - 0.5)
        color, mark = KINDS[kind], MARKS[size]
        fill = color if size == "few" else "none"
        axes.plot(list(of.values()), y, mark, ms=5, color=color, mfc=fill, label=f"{kind}, {size}")
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()


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
    axes.set(
        title="2 to 12 identical samplers",
        xlabel="keys",
        ylabel="largest part of trials with a false distinction",
    )
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
            ratios, parts = zip(*((row["ratio"], row[rule]) for row in of), strict=True)
            axes.plot(ratios, parts, f"o{style}", ms=4, color=f"C{color}", label=label)
    axes.set(xlabel="ratio of the errors of neighbours", ylabel="part of the pairs distinguished")
    axes.set_title("6 different samplers")
    axes.set_ylim(-0.02, 1.02)
    axes.legend(title="dotted: bootstrap")

"""Kinds of confidence intervals over a hundred integrands: how often they hold the integral, and how wide."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures.shared.integrands import hundred_integrands
from figures.shared.sheets.panels import legend_below, new_figure

SIZES = {
    "draft": {"few": (16, 256), "many": (32, 256)},
    "paper": {"few": (16, 1024), "many": (128, 128)},
}
"""Replicates, and points of each."""

TRIED = {"draft": 1, "paper": 30}
"""Keys of the hundred integrands."""

STOPPED = {"draft": (("student",), 1, 256, 12), "paper": (("student", "median"), 10, 2**14, 1)}
"""With a tolerance: kinds of intervals, keys, the most points, and every which integrand."""

KINDS = {
    "student": "C0",
    "median": "C1",
    "quantile": "C2",
    "betting": "C3",
    hundred_integrands.BERNSTEIN: "0.5",
}
MARKS = {"few": "o", "many": "s"}

NOTE = (
    f"{hundred_integrands.COUNT} integrands with values in [0, 1] and exact integrals, in 1 to 8 "
    "dimensions, Sobol' points: 'few' means {few[0]} replicates of {few[1]} points, 'many' "
    "{many[0]} of {many[1]}. Width: geometric means relative to Student's interval with few "
    "replicates, over integrands and {tried} keys. The median narrows the interval with linear "
    "scrambling (kind median), and less with Owen's (kind quantile); medians of many replicates miss "
    "the integral if their distribution is skewed. Betting intervals hold for every distribution; "
    "empirical Bernstein intervals use the same replicates. Not drawn: coverage of "
    "the last intervals to a tolerance, up to {points} points in each of 8 replicates. Tests judge "
    "coverage for fourteen integrands, rare events, and how often samplers are distinguished."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure coverage and widths, and draw both."""
    sizes, tried = SIZES[quality], TRIED[quality]
    kinds = hundred_integrands.measure(sizes, range(tried), lambda part: progress(0.6 * part))
    asked, count, points, every = STOPPED[quality]
    width = kinds["student", "few"].width.mean(axis=0)
    # With other keys than those of the tolerances.
    keys = range(tried, tried + count)
    stops = {kind: hundred_integrands.stop_at_tolerance(kind, width, keys, points, every) for kind in asked}
    held, widths = _of_kinds(kinds)
    figure = new_figure("Betting intervals held every integral; others are narrower, and miss some", 4.2)
    left, right = figure.subplots(1, 2)
    x = "share of intervals that hold the integral"
    _kinds(left, held, hundred_integrands.LEVEL, "100 integrands: 95 % intervals", x)
    _kinds(right, widths, 1, "their width", "width / Student's width, few replicates")
    right.set_xscale("log")
    legend_below(figure, left)
    ratio = kinds[hundred_integrands.BERNSTEIN, "many"].width / kinds["betting", "many"].width
    return figure, {
        "measured": {
            "hundred integrands: held": {", ".join(case): of for case, of in held.items()},
            "hundred integrands: width / Student's": {", ".join(case): of for case, of in widths.items()},
            "empirical Bernstein / betting, width": {
                "mean": float(np.exp(np.log(ratio).mean())),
                "least": float(ratio.min()),
                "most": float(ratio.max()),
            },
            "to a tolerance": {
                kind: {
                    "results": of.reached.size,
                    "reached": float(of.reached.mean()),
                    "reached, and not within the tolerance": float((of.reached & ~of.within).mean()),
                    "held": float(of.held.mean()),
                    "points of a replicate": float(of.n.mean()),
                    "by class": hundred_integrands.by_class(of.held, of.of_class),
                }
                for kind, of in stops.items()
            },
        },
        "note": NOTE.format(**sizes, tried=tried, points=points),
    }


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

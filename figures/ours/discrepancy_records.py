"""Discrepancies of searched point sets over n, beside digital nets, lattices and published sets."""

import itertools
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.shared.sheets import point_plots
from figures.shared.sheets.panels import curve, name_axes, new_figure
from qmcjax import sequences

MEASURES: dict[str, Callable[[NDArray[np.float64]], float]] = {
    "star": analysis.star_discrepancy,
    "periodic": lambda points: float(analysis.periodic_discrepancy(points)),
    "average": lambda points: float(analysis.symmetric_discrepancy(points)) / 2 ** points.shape[1],
}
"""The average squared discrepancy, here its root, is the symmetric discrepancy but for a factor."""

OPTIMAL = {16: 0.0739, 20: 0.0604}
"""Proven optima in the plane, to four decimals: F. Clement et al., arXiv 2311.17463."""

PUBLISHED = {
    "MPMC": {20: 0.0640, 60: 0.02729, 100: 0.01879, 140: 0.01373, 220: 0.00975, 500: 0.00518, 1020: 0.00303},
    "program search": {60: 0.02336, 100: 0.01504, 140: 0.01151, 220: 0.00891, 500: 0.00509, 1020: 0.00245},
    "permutations": {100: 0.01492, 220: 0.00737},
}
"""In the plane, as printed; the last are as others cite them."""

SOURCES = {
    "proven optimum": "F. Clement et al., arXiv 2311.17463",
    "MPMC": "T. K. Rusch et al., arXiv 2405.15059, as listed with the next",
    "program search": "A. Sadikov, arXiv 2510.03650, README of hockeyguy123/openevolve-star-discrepancy",
    "permutations": "F. Clement et al., PNAS 2025, as others cite them",
}

SUBSETS = 0.65
"""Of Sobol's star discrepancy: the least in six dimensions, for 30 to 240 points, by subset selection, as the
abstract of F. Clement, C. Doerr, L. Paquete, arXiv 2306.15276, says ("up to 35% better")."""

MARKS = {
    "proven optimum": plot.Style("black", "o"),
    "MPMC": plot.Style("#CC79A7", "D"),
    "program search": plot.Style("#E69F00", "s"),
    "permutations": plot.Style("#D55E00", "^"),
}

SOBOL = "Sobol'"

FIRST = plot.Style("#0072B2", "o", ":")
"""The first n points of a sequence: their discrepancy jumps from one n to the next."""

RECORDS = plot.Style("#009E73", "*")

Constructions = dict[str, tuple[plot.Style, Callable[[int], NDArray[np.float64] | None]]]

CONSTRUCTED: dict[int, Constructions] = {
    2: {
        SOBOL: (FIRST, lambda n: _sobol(2)[:n]),
        "Hammersley": (plot.style("Hammersley"), lambda n: _net(sequences.hammersley_net, n)),
        "optimised net": (plot.style("optimised matrices"), lambda n: _net(sequences.optimized_net, n)),
        "golden ratio": (plot.Style("#999999", "x"), lambda n: _golden(n)),
    },
    3: {
        SOBOL: (FIRST, lambda n: _sobol(3)[:n]),
        "Sobol' net": (plot.style("Sobol' net"), lambda n: _net(sequences.sobol_net_3d, n)),
        "optimised net": (plot.style("optimised matrices"), lambda n: _net(sequences.optimized_net_3d, n)),
    },
    **{dims: {SOBOL: (FIRST, lambda n, dims=dims: _sobol(dims)[:n])} for dims in (4, 5, 6)},
}

L2_STYLES = {"periodic": "-", "average": "--"}

NOTE = (
    "All discrepancies of ours are of the points as they are shipped, in 32-bit fractions, and agree "
    "with those of analysis.tables.discrepancy_records, which computes them in rational arithmetic; the "
    "published ones are as printed. Search times, on a shared core, are upper bounds; longer searches "
    "find better sets. Nets have sizes that are powers of 2; the points ((i + 1/2)/n, multiples of the "
    "golden ratio) have any. From 60 to 220 points in the plane the gain over published sets, also "
    "found by direct search, is only 2 to 8 %; the proven optima for 16 and 20 points leave less than "
    "10 %. The sets of small L2 discrepancies come from searches of a few seconds. From three "
    "dimensions on there are published values, too: arXiv 2407.11533 (3-D, up to 50 points), 2510.03650 "
    "(3-D), 2604.00786 (3-D Kronecker sets, from 500 points on) and 2306.15276 (subset selection, up to "
    "6-D). We had their abstracts only, so none is shown, except the largest gain over Sobol' stated in "
    "the last one, 35 % in 6-D for 30 to 240 points. The average squared discrepancy is the mean of "
    "squared L2 star discrepancies from all corners (arXiv 2508.04926, values not available to us); its "
    "root is shown. Sources: " + "; ".join(f"{name}: {by}" for name, by in SOURCES.items()) + "."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all sets, and draw n times their star discrepancy, and parts of Sobol's L2 discrepancies."""
    seconds = _seconds()
    chosen = [row for row in seconds if quality == "paper" or row[1] * row[2] <= 280]
    rows, parts = [], []
    curves: dict[int, dict[str, dict[int, float]]] = {dims: {} for dims in CONSTRUCTED}
    for done, (kind, dims, n) in enumerate(chosen):
        record = np.asarray(sequences.record_net(n, dims, kind).table) * 2.0**-32
        sets = {SOBOL: _sobol(dims)[:n]}
        if kind == "star":
            sets = {name: make_set(n) for name, (_, make_set) in CONSTRUCTED[dims].items()}
        sets["record"] = record
        found = {name: MEASURES[kind](p) for name, p in sets.items() if p is not None}
        row = {"kind": kind, "dims": dims, "n": n, **found, "seconds": seconds[kind, dims, n]}
        if kind == "star":
            rows.append({**row, **_published(dims, n, found["record"])})
            for name, value in found.items():
                curves[dims].setdefault(name, {})[n] = n * value
        else:
            parts.append(row)
        progress((done + 1) / len(chosen))
    columns = ("kind", "dims", "n", "record", "published", "source", "of published", SOBOL, "seconds")
    return _draw(curves, parts), {
        "measured": {f"{row['kind']}, {row['dims']}-D, {row['n']} points": row for row in rows + parts},
        "note": NOTE,
        "table": [{name: row.get(name) for name in columns} for row in rows + parts],
    }


def _published(dims: int, n: int, found: float) -> dict:
    """Return the least published value, whose it is, and what part of it was found."""
    known = {name: values[n] for name, values in PUBLISHED.items() if n in values} if dims == 2 else {}
    if dims == 2 and n in OPTIMAL:
        known = {"proven optimum": OPTIMAL[n]}
    if not known:
        return dict.fromkeys(("published", "source", "of published"))
    least = min(known, key=lambda name: known[name])
    return {"published": known[least], "source": least, "of published": found / known[least]}


@cache
def _sobol(dims: int) -> NDArray[np.float64]:
    return point_plots.block(sequences.sobol(dims), 2048)


def _net(make_net: Callable[[int], sequences.Sequence], n: int) -> NDArray[np.float64] | None:
    return None if n & (n - 1) else point_plots.block(make_net(n.bit_length() - 1), n)


def _golden(n: int) -> NDArray[np.float64]:
    i = np.arange(n)
    return np.stack([(i + 0.5) / n, (i + 0.5) * (np.sqrt(5) - 1) / 2 % 1], axis=1)


def _draw(curves: dict[int, dict[str, dict[int, float]]], parts: list[dict]) -> Figure:
    """Draw star discrepancies in the plane, and parts of Sobol's that are left in more dimensions."""
    figure = new_figure(
        "Searched points have about half of Sobol's star discrepancy, and smaller L2 discrepancies", 6.2
    )
    layout = figure.subplot_mosaic("aa;bc")
    _plane(layout["a"], curves[2])
    left = {
        f"{dims}-D": {n: value / of[SOBOL][n] for n, value in of["record"].items()}
        for dims, of in curves.items()
    }
    looks = {
        name: plot.Style(f"C{k}", mark) for k, (name, mark) in enumerate(zip(left, "osD^v", strict=True))
    }
    for name, of in left.items():
        curve(layout["b"], of, looks[name], label=name)
    layout["b"].plot([30, 240], [SUBSETS, SUBSETS], "k--", lw=1.2, label="6-D, published")
    for (kind, line), dims in itertools.product(L2_STYLES.items(), CONSTRUCTED):
        of_kind = [row for row in parts if (row["kind"], row["dims"]) == (kind, dims)]
        shown = {row["n"]: row["record"] / row[SOBOL] for row in of_kind}
        curve(layout["c"], shown, looks[f"{dims}-D"]._replace(line=line))
    layout["c"].plot([], [], "k-", label="periodic L2 discrepancy")
    layout["c"].plot([], [], "k--", label="root of the average squared")
    titles = {"b": "star discrepancy in 2 to 6 dimensions", "c": "L2 discrepancies in 2 to 6 dimensions"}
    for panel, title in titles.items():
        legend: dict[str, Any] = (
            {"legend": "lower left", "ncols": 2} if panel == "b" else {"legend": "lower left"}
        )
        name_axes(layout[panel], "number of points n", "part of Sobol's", title, **legend)
        layout[panel].set_xscale("log", base=2)
        layout[panel].set_ylim(0, None)
    return figure


def _plane(axes: Axes, found: dict[str, dict[int, float]]) -> None:
    """Draw discrepancies in the plane, of published sets as well, times the number of points."""
    for name, values in found.items():
        drawn = RECORDS if name == "record" else CONSTRUCTED[2][name][0]
        curve(axes, values, drawn, lw=1.2, ms=5, label="found" if name == "record" else name)
    for name, values in (("proven optimum", OPTIMAL), *PUBLISHED.items()):
        shown = {n: n * value for n, value in values.items() if n in found["record"]}
        curve(axes, shown, MARKS[name], ls="", ms=6, label=name)
    beside = {"legend": "upper left", "bbox_to_anchor": (1, 1)}
    ticks = [n for n in found["record"] if not n & (n - 1)]
    y, title = "star discrepancy times n", "star discrepancy in the plane"
    name_axes(axes, "number of points n", y, title, log="x", ticks=ticks, **beside)
    axes.set_ylim(0, None)


def _seconds() -> dict[tuple[str, int, int], float]:
    """Return the time of the search of each set, by discrepancy, dimensions and size."""
    found = {}
    for file in ("discrepancy_records.npz", "l2_discrepancy_records.npz"):
        with np.load(Path(sequences.__file__).parent / "_data" / file) as stored:
            for name in stored:
                kind, dims, n, *seconds = name.split("_")
                if seconds:
                    found[kind, int(dims[:-1]), int(n)] = float(stored[name])
    return dict(sorted(found.items(), key=lambda item: ([*MEASURES].index(item[0][0]), *item[0][1:])))

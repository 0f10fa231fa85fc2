"""Star discrepancy of searched point sets over n, beside digital nets, lattices and published sets."""

from collections.abc import Callable
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

import analysis
from analysis.tables import SEQUENCES
from analysis.tables.make_discrepancy_records import FILE, SIZES
from figures import plot
from figures.shared import point_plots, text_tables
from qmcjax import sequences

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
    "MPMC": "T. K. Rusch et al., arXiv 2405.15059",
    "program search": "A. Sadikov, arXiv 2510.03650",
    "permutations": "F. Clement et al., PNAS 2025",
}

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

CONSTRUCTED: dict[int, dict[str, tuple[plot.Style, Callable[[int], NDArray[np.float64] | None]]]] = {
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
}

NOTE = (
    "All discrepancies of ours are exact (analysis.star_discrepancy), of the points as they are shipped, in "
    "32-bit fractions; the published ones are as printed, those of 'permutations' as others cite them. "
    "Seconds are wall time of "
    "analysis.search_discrepancy with Numba on a core that it had to share with other work, so they are an "
    "upper bound; longer searches find better sets. Nets have sizes that are powers of 2; the points "
    "((i + 1/2)/n, multiples of the golden ratio) have any. For three dimensions we have no published values "
    "for these sizes to compare with. Sources: "
    + "; ".join(f"{name}: {by}" for name, by in SOURCES.items())
    + "."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all sets, and draw n times their discrepancy."""
    sizes = {dims: [n for n in of if quality == "paper" or n <= 128] for dims, of in SIZES.items()}
    total = sum(n for of in sizes.values() for n in of)
    kept, done = np.load(SEQUENCES / FILE), 0
    rows, curves = [], {dims: {} for dims in sizes}
    for dims, of in sizes.items():
        for n in of:
            sets = {name: make_set(n) for name, (_, make_set) in CONSTRUCTED[dims].items()}
            sets["record"] = np.asarray(sequences.record_net(n, dims).table) * 2.0**-32
            found = {name: analysis.star_discrepancy(p) for name, p in sets.items() if p is not None}
            for name, value in found.items():
                curves[dims].setdefault(name, {})[n] = n * value
            seconds = float(kept[f"{dims}d_{n}_seconds"])
            rows.append({"dims": dims, "n": n, **_published(dims, n), **found, "seconds": seconds})
            progress((done := done + n) / total)
    return _draw(curves, rows), {
        "measured": {f"{row['dims']}-D, {row['n']} points": row for row in rows},
        "note": NOTE,
        "table": [
            {name: row.get(name) for name in ("dims", "n", "record", "published", "source", SOBOL, "seconds")}
            for row in rows
        ],
    }


def _published(dims: int, n: int) -> dict:
    """Return the least published value, and whose it is."""
    known = {name: values[n] for name, values in PUBLISHED.items() if n in values} if dims == 2 else {}
    if dims == 2 and n in OPTIMAL:
        known = {"proven optimum": OPTIMAL[n]}
    if not known:
        return {"published": None, "source": None}
    least = min(known, key=lambda name: known[name])
    return {"published": known[least], "source": least}


@cache
def _sobol(dims: int) -> NDArray[np.float64]:
    return point_plots.block(sequences.sobol(dims), max(SIZES[dims]))


def _net(make_net: Callable[[int], sequences.Sequence], n: int) -> NDArray[np.float64] | None:
    """Return a net, if there is one of this size."""
    return None if n & (n - 1) else point_plots.block(make_net(n.bit_length() - 1), n)


def _golden(n: int) -> NDArray[np.float64]:
    i = np.arange(n)
    return np.stack([(i + 0.5) / n, (i + 0.5) * (np.sqrt(5) - 1) / 2 % 1], axis=1)


def _draw(curves: dict[int, dict[str, dict[int, float]]], rows: list[dict]) -> Figure:
    """Draw curves in the plane and in space above the table."""
    figure = Figure(figsize=(12, 5.2 + 0.19 * len(rows)), layout="constrained")
    figure.suptitle("Star discrepancy D* of searched point sets")
    layout = figure.subplot_mosaic("ab;cc", height_ratios=[4.6, 0.4 + 0.19 * len(rows)])
    for dims, panel in ((2, "a"), (3, "b")):
        _panel(layout[panel], dims, curves[dims])
    for name, values in (("proven optimum", OPTIMAL), *PUBLISHED.items()):
        shown = {n: n * value for n, value in values.items() if n in curves[2]["record"]}
        mark = MARKS[name]
        layout["a"].plot(
            list(shown),
            list(shown.values()),
            ls="",
            marker=mark.marker,
            color=mark.color,
            ms=7,
            label=f"{name} ({SOURCES[name].rpartition(', ')[2]})",
        )
    for panel in "ab":
        layout[panel].legend(frameon=False, loc="upper left", ncols=2)
    text_tables.draw(
        layout["c"],
        ["dimensions", "n", "D* found", "published", "by", SOBOL, "seconds of search"],
        [
            [
                str(row["dims"]),
                str(row["n"]),
                f"{row['record']:.7f}",
                "-" if row["published"] is None else f"{row['published']:g}",
                row["source"] or "-",
                f"{row[SOBOL]:.5f}",
                f"{row['seconds']:.0f}",
            ]
            for row in rows
        ],
        widths=[1, 0.8, 1.2, 1.1, 1.8, 1.1, 1.4],
    )
    return figure


def _panel(axes: Axes, dims: int, curves: dict[str, dict[int, float]]) -> None:
    for name, values in curves.items():
        drawn = RECORDS if name == "record" else CONSTRUCTED[dims][name][0]
        label = "search_discrepancy" if name == "record" else name
        axes.plot(
            list(values),
            list(values.values()),
            color=drawn.color,
            marker=drawn.marker,
            ls=drawn.line,
            lw=1.2,
            ms=5,
            label=label,
        )
    sizes = [n for n in curves["record"] if not n & (n - 1)]
    axes.set_xscale("log", base=2)
    axes.xaxis.set_major_locator(FixedLocator(sizes))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels(map(str, sizes))
    highest = max(max(values.values()) for values in curves.values())
    axes.set(xlabel="number of points n", ylabel="n D*", ylim=(0, 1.35 * highest))
    axes.set_title(f"{dims} dimensions", fontsize=9)
    axes.grid(alpha=0.3)

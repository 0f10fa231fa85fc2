"""Hilbert paper Fig. 1: four space-filling curves, and their segments in 3x3 neighbourhoods."""

import math
from collections.abc import Callable, Iterator
from itertools import pairwise, product
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

import analysis
from figures._rc import BLUE, ORANGE, PURPLE, SKY, VERMILLION
from figures.making.schema import Claims
from figures.shared.sheets.curve_tables import CURVES, Curve, square
from figures.shared.sheets.panels import new_figure
from qmcjax import sequences

SHOWN = (8, 9)
"""Sides of the pixel grids that are drawn, in base 2 and 3."""

COUNTED = {"draft": (128, 243), "paper": (512, 729)}
"""Sides of the pixel grids that are measured."""

LABELLED = 6
"""Per cent: smaller parts of a bar have no room for their number."""

VARIANT_DIGITS = 3

UNIFORM = (128, 81)
SEQUENCES = {
    "Halton 2, 3": sequences.halton(2),
    "Halton 5, 7": sequences.components(sequences.halton(4), (2, 3)),
    "Sobol'": sequences.owen(sequences.sobol(2), 1),
}

SEGMENTS = (BLUE, VERMILLION, PURPLE, ORANGE, SKY)
"""Colours in the marked neighbourhood."""

MEAN = "mean L2 star discrepancy of the 9 points of a neighbourhood"
UNIFORMITY = "the same by the number of segments"
RARE = 0.01
"""Numbers of segments of fewer neighbourhoods are left out."""

NOTE = (
    "A segment is a maximal run of consecutive positions among a neighbourhood's 9 pixels. The "
    "bars count interior pixels; the pictures also show the clipped counts at the border. The "
    "caption says that the maximum 'is smallest for the Hilbert and Moore curves': true, with a tie, as "
    "Peano's own curve also has 4, in half of its neighbourhoods (Hilbert and Moore: a fifth). Sect. 3 "
    "says that it is smaller than for Morton and Peano: true for Morton, and for most curves named "
    "after Peano. Of the 512 that transpose a fixed choice of his nine parts at every level, 508 have "
    "the maximum 5, as does Wunderlich's meander; the other four are Peano's own, its transpose, and "
    "the two that transpose every other part. Other definitions give the same maxima: with the border; "
    "without the segment that starts the curve; with the ends of closed curves joined. The means of "
    "Hilbert, Moore and Peano all approach 3. The control are rows: all their interior neighbourhoods have "
    "3 segments, and are more uniform than along the Hilbert curve for Halton in bases 5 and 7, not for 2 "
    "and 3. Discrepancies are for one point per pixel of Halton sequences in bases 2 and 3, and 5 and 7, "
    "and of an Owen-scrambled Sobol' sequence, on 128 x 128 and 81 x 81 pixels."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the curves with the number of segments in every pixel, and the histograms of larger grids."""
    sides = COUNTED[quality]
    figure = new_figure(
        "Of the four curves, none has fewer segments in its worst 3x3 neighbourhood than Hilbert's\n"
        "Hilbert paper, Fig. 1; each number says in how many segments the curve visits the 3x3 pixels around",
        5.0,
    )
    panels = figure.subplot_mosaic("abe;cde", width_ratios=(1, 1, 1.2))
    bars = panels["e"]
    measured = {}
    for k, (name, axes) in enumerate(zip(CURVES, [panels[place] for place in "abcd"], strict=True)):
        _draw_curve(axes, square(name, *SHOWN), name)
        measured[name] = _measure(square(name, *sides))
        found = {title: _uniformity(square(name, *UNIFORM), points) for title, points in SEQUENCES.items()}
        measured[name][MEAN] = {title: mean for title, (mean, _) in found.items()}
        measured[name][UNIFORMITY] = {title: by_count for title, (_, by_count) in found.items()}
        _draw_shares(bars, k, measured[name])
        progress((k + 1) / (len(CURVES) + 1))
    bars.set(
        ylabel="part of the interior pixels (%)",
        title=f"segments around pixels,\n{sides[0]} x {sides[0]}, Peano {sides[1]} x {sides[1]}",
        ylim=(0, 100),
    )
    bars.set_xticks(range(len(CURVES)), list(CURVES))
    bars.tick_params(bottom=False)
    rows = [Curve(np.arange(side**2).reshape(side, side)) for side in (sides[0], UNIFORM[0])]
    measured["rows"] = _measure(rows[0]) | {
        MEAN: {title: _uniformity(rows[1], points)[0] for title, points in SEQUENCES.items()}
    }
    measured["Wunderlich's meander"] = _measure(meander(round(math.log(sides[1], 3))))
    maxima = [analysis.segment_counts(of)[1:-1, 1:-1].max() for of in peano_variants(VARIANT_DIGITS)]
    measured["maxima of the 512 variants of the Peano curve"] = _histogram(list(map(int, maxima)))
    return figure, {"measured": measured, "claims": _claims(measured), "note": NOTE}


def _measure(curve: Curve) -> dict:
    counts = analysis.segment_counts(curve)
    interior = counts[1:-1, 1:-1]
    return {
        "maximum": int(interior.max()),
        "maximum with the border": int(counts.max()),
        # Without the segment that starts the curve: it enters no neighbourhood.
        "maximum of the steps that enter": int((counts - _around(curve, 0)).max()),
        "maximum if the ends of a closed curve are joined": int(_join(curve, counts).max()),
        "share at the maximum": float(np.mean(interior == interior.max())),
        "mean": float(interior.mean()),
        "histogram": _histogram(interior),
    }


def _histogram(values: ArrayLike) -> dict[str, int]:
    return {str(v): int(n) for v, n in zip(*np.unique(values, return_counts=True), strict=True)}


def _around(curve: Curve, position: int) -> NDArray[np.bool_]:
    """Tell which neighbourhoods hold the pixel at a position."""
    x, y = (int(c[position]) for c in curve.path())
    rows, columns = np.indices(curve.positions.shape)
    return np.maximum(np.abs(columns - x), np.abs(rows - y)) <= 1


def _join(curve: Curve, counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count the first and the last segment as one where they meet."""
    x, y = curve.path()
    is_closed = abs(x[0] - x[-1]) + abs(y[0] - y[-1]) == 1
    return counts - (_around(curve, 0) & _around(curve, -1)) if is_closed else counts


def _uniformity(curve: Curve, sequence: sequences.Sequence) -> tuple[float, dict[str, float]]:
    """Return the mean discrepancy of interior neighbourhoods, of all and by their number of segments."""
    points = np.asarray(sequence.points(curve.positions.size, dtype=jnp.float64))[curve.positions]
    around = sliding_window_view(points, (3, 3), axis=(0, 1))  # [row, column, coordinate, 3, 3]
    around = np.moveaxis(around.reshape(*around.shape[:2], 2, 9), 2, 3)
    # Warnock's formula for the L2 star discrepancy.
    one = np.prod((1 - around**2) / 2, axis=-1).sum(axis=-1)
    two = np.prod(1 - np.maximum(around[..., :, None, :], around[..., None, :, :]), axis=-1).sum(
        axis=(-1, -2)
    )
    discrepancy = np.sqrt(1 / 9 - 2 / 9 * one + two / 81)
    counts = analysis.segment_counts(curve)[1:-1, 1:-1]
    frequent = [count for count in np.unique(counts) if np.mean(counts == count) > RARE]
    return float(discrepancy.mean()), {str(c): float(discrepancy[counts == c].mean()) for c in frequent}


def _claims(measured: dict) -> Claims:
    maximum = {name: measured[name]["maximum"] for name in CURVES}
    largest = max(maximum["Hilbert"], maximum["Moore"])
    return {
        "no maximum is smaller than that of Hilbert and Moore": largest == min(maximum.values()),
        "the maximum is smaller for Hilbert and Moore than for Morton": largest < maximum["Morton"],
        "the maximum is smaller for Hilbert and Moore than for Peano": {
            "Peano's own curve": largest < maximum["Peano"],
            "Wunderlich's meander": largest < measured["Wunderlich's meander"]["maximum"],
        },
        "fewer segments in a neighbourhood improve its uniformity: less mean discrepancy": {
            f"{name}, {title}": all(a < b for a, b in pairwise(by_count.values()))
            for name in CURVES
            for title, by_count in measured[name][UNIFORMITY].items()
        },
        "neighbourhoods of the Hilbert curve are more uniform than those of other curves": {
            f"{name}, {title}": measured["Hilbert"][MEAN][title] < mean
            for name in CURVES
            if name != "Hilbert"
            for title, mean in measured[name][MEAN].items()
        },
    }


class Part(NamedTuple):
    """Where one of nine smaller curves lies in the larger one, and how."""

    row: int
    column: int
    transposed: bool
    upward: bool
    leftward: bool


MEANDER = (
    Part(0, 0, False, False, False),
    Part(0, 1, True, False, False),
    Part(1, 1, True, False, False),
    Part(1, 0, False, True, True),
    Part(2, 0, False, False, False),
    Part(2, 1, False, False, False),
    Part(2, 2, False, False, False),
    Part(1, 2, True, True, True),
    Part(0, 2, True, True, True),
)
"""From one corner to the next one, as Hilbert's curve."""


def peano_variants(digits: int) -> Iterator[Curve]:
    """Make every curve of side ``3**digits`` whose nine parts lie as Peano's: his own is the first.

    Each part is a smaller curve between the same corners, or that curve transposed: the same parts are
    transposed in every curve at every level.
    """
    for transposed in product((False, True), repeat=9):
        parts = []
        for k, is_transposed in enumerate(transposed):
            column, row = divmod(k, 3)
            upward, leftward = column % 2 == 1, row % 2 == 1
            parts.append(Part(2 - row if upward else row, column, is_transposed, upward, leftward))
        yield _curve(tuple(parts), digits)


def meander(digits: int) -> Curve:
    """Make Wunderlich's meander of side ``3**digits``."""
    return _curve(MEANDER, digits)


def _curve(parts: tuple[Part, ...], digits: int) -> Curve:
    positions = np.zeros((1, 1), np.int64)
    for _ in range(digits):
        positions = _larger(positions, parts)
    return Curve(positions)


def _larger(curve: NDArray[np.int64], parts: tuple[Part, ...]) -> NDArray[np.int64]:
    """Return the positions of the curve made of nine copies of a smaller one."""
    side = len(curve)
    whole = np.empty((3 * side, 3 * side), np.int64)
    for k, part in enumerate(parts):
        copy = curve.T if part.transposed else curve
        copy = copy[:: -1 if part.upward else 1, :: -1 if part.leftward else 1]
        rows = slice(part.row * side, (part.row + 1) * side)
        columns = slice(part.column * side, (part.column + 1) * side)
        whole[rows, columns] = copy + k * side**2
    return whole


def _draw_curve(axes: Axes, curve: Curve, name: str) -> None:
    """Write the number of segments around each pixel, and colour those of the worst one near the middle."""
    counts = analysis.segment_counts(curve)
    x, y = curve.path()
    axes.plot(x, y, color="0.4", lw=1)
    largest = np.argwhere(counts == counts[1:-1, 1:-1].max())
    row, column = min(largest.tolist(), key=lambda pixel: math.dist(pixel, (len(counts) / 2,) * 2))
    axes.add_patch(Rectangle((column - 1.5, row - 1.5), 3, 3, fill=False, color="black", lw=1.5))
    inside = np.flatnonzero((abs(x - column) <= 1) & (abs(y - row) <= 1))
    for k, run in enumerate(np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)):
        axes.plot(x[run], y[run], "o-", color=SEGMENTS[k], lw=3, ms=11)
    for (v, u), count in np.ndenumerate(counts):
        look: dict[str, Any] = {"color": "white", "weight": "bold"}
        if max(abs(u - column), abs(v - row)) > 1:
            look = {"bbox": {"facecolor": _shade(int(count)), "edgecolor": "none", "pad": 0.5}}
        axes.text(u, v, str(count), ha="center", va="center_baseline", **look)
        axes.add_patch(Rectangle((u - 0.5, v - 0.5), 1, 1, color=_shade(int(count)), lw=0, zorder=0))
    axes.set(xlim=(-0.6, len(counts) - 0.4), ylim=(len(counts) - 0.4, -0.6), aspect="equal")
    axes.set(title=f"{name}: at most {counts[row, column]}", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _draw_shares(axes: Axes, place: int, of_curve: dict) -> None:
    """Draw what part of the neighbourhoods has each number of segments, as a bar in parts."""
    counts = {int(count): number for count, number in of_curve["histogram"].items()}
    bottom = 0.0
    for count, number in counts.items():
        share = 100 * number / sum(counts.values())
        axes.bar(place, share, 0.9, bottom, color=_shade(count))
        if share > LABELLED:
            axes.text(place, bottom + share / 2, f"{count}: {share:.0f} %", ha="center", va="center")
        bottom += share


def _shade(count: int) -> tuple[float, ...]:
    """Return the green of a number of segments."""
    return colormaps["Greens"](0.1 + 0.13 * (count - 1))

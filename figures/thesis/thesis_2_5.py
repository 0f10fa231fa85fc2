"""Thesis Fig. 2.5: a curve made of linear segments of the same length, to be looked up by arc length."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from figures.shared.sheets.curves import legend_below, name_axes
from figures.shared.sheets.trajectories import CURVE, FINE, at, draw, pair, table

SHOWN = 16
COUNTS = tuple(2**k for k in range(3, 11))
INSIDE = 32
"""Places of each segment where its distance from the curve is measured."""

NOTE = (
    "The curve of Fig. 2.2. Segments are equal in arc length, their chords only almost. 'error' is between "
    "the points of segments and curve at the same arc length, at 32 places of each segment, in parts of the "
    "curve's length; the bound comes with the segments. 'table' divides the curve by Eq. 2.5 and 2.6 with a "
    "table of so many times as many pieces as segments: how much longer the longest segment's arc is than "
    "the mean."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the segments, and their largest error over their number beside the bound."""
    u, lengths = table(CURVE, FINE)
    errors, bounds, spread, at_ends = [], [], [], []
    divided = {count: CURVE.by_arc_length(count) for count in COUNTS}
    for count, segments in divided.items():
        part = np.linspace(0, 1, count * INSIDE + 1)
        # Points of the curve at parts of its length, by Eq. 2.6 with the fine table.
        exact = at(CURVE, np.interp(part * lengths[-1], lengths, u))
        distance = np.linalg.norm(at(segments, part) - exact, axis=1)
        errors.append(float(distance.max() / segments.length))
        bounds.append(segments.bound / segments.length)
        chords = np.linalg.norm(np.diff(segments.points, axis=0), axis=1)
        spread.append(float(chords.max() / chords.min()))
        at_ends.append(float(distance[::INSIDE].max() / segments.length))
    hulls = {f"ends of {n} segments": ConvexHull(divided[n].points) for n in (SHOWN, COUNTS[-1])}
    inside = {name: float(hull.volume) for name, hull in hulls.items()}
    outer = float(ConvexHull(CURVE.control).volume)
    unequal = {str(times): _table_error(times, u, lengths) for times in (1, 4, 16)}
    few, _, many = unequal.values()

    figure, (left, right) = pair("Linear segments of the same length (thesis Fig. 2.5)", 10)
    draw(left, CURVE)
    label = f"{SHOWN} segments of equal length"
    left.plot(*divided[SHOWN].points.T, "o-", color="C1", ms=4, lw=0.8, label=label)
    legend_below(figure, figure.axes[0])
    right.plot(COUNTS, bounds, "k:", label="bound that comes with the segments")
    right.plot(COUNTS, errors, "o-", color="C1", ms=4, label="largest error")
    name_axes(right, "linear segments", "error / length of the curve", log="xy", legend="best")
    of_count = {
        str(count): {"error": error, "bound": bound, "longest chord / shortest": ratio}
        for count, error, bound, ratio in zip(COUNTS, errors, bounds, spread, strict=True)
    }
    measured = {
        "segments": of_count,
        "error at the ends of segments, at most": max(at_ends),
        "slope of the error": float(np.polyfit(np.log(COUNTS[2:]), np.log(errors[2:]), 1)[0]),
        "area of the convex hull": {"control points": outer, **inside},
        "table": unequal,
    }
    claims = {
        "ends of segments lie exactly on the curve": max(at_ends) < 1e-7,
        "points in between may not": errors[0] > 1e-3,
        "no error is above its bound": all(e <= b for e, b in zip(errors, bounds, strict=True)),
        "segments are of the same length, too: within 1 % from 256 of them on": all(
            ratio < 1.01 for count, ratio in zip(COUNTS, spread, strict=True) if count >= 256
        ),
        "the segments' bounds are tighter than the control points'": max(inside.values()) < outer,
        "for accuracy the table should have more pieces than there are segments": few > 4 * many,
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def _table_error(times: int, u: NDArray, lengths: NDArray) -> float:
    """Return the longest arc over the mean, minus 1, of segments by a table of ``times`` as many pieces."""
    coarse, approximate = table(CURVE, times * SHOWN)
    wanted = np.linspace(0, approximate[-1], SHOWN + 1)
    arcs = np.diff(np.interp(np.interp(wanted, approximate, coarse), u, lengths))
    return float(arcs.max() / arcs.mean() - 1)

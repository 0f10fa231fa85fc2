"""Motion by linear segments: lengths, equal steps, a fast rotation, a ball that jumps (Fig. 2.4 to 2.8)."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from figures._errors import slope
from figures.plot import Style
from figures.shared.sheets.panels import curve, legend_below, name_axes, new_figure
from figures.thesis.chapter_2.spline_curves import CORNER, CURVE, FINE, at, draw_curve, pair, table
from qmcjax.tracing import motion

SHOWN_2_4 = 16
PIECES = tuple(2**k for k in range(3, 13))
CURVES = {"smooth": CURVE, "with a corner": CORNER}

NOTE_2_4 = (
    "Segments between equidistant parameters. The curves are those of Fig. 2.2 and 2.3; their exact "
    "lengths are the library's, by quadrature between knots. The corner of the second is at a third of "
    "its parameter range, never at an end of 2^k equal segments: the segment across it misses a part "
    "proportional to its length. Slopes are fitted to the last eight counts."
)


def thesis_2_4(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a few segments, and the error of the length over their number."""
    exact = {name: path.by_arc_length(1).length for name, path in CURVES.items()}
    sums = {name: [float(table(path, n)[1][-1]) for n in PIECES] for name, path in CURVES.items()}
    errors = {name: [1 - found / exact[name] for found in of] for name, of in sums.items()}
    slopes = {name: slope(dict(zip(PIECES[2:], of[2:], strict=True))) for name, of in errors.items()}

    figure = new_figure(
        "Linear segments approximate the arc length, even of a curve with a corner\nthesis, Fig. 2.4", 3.8
    )
    panels = figure.subplot_mosaic([["smooth", "errors"], ["with a corner", "errors"]])
    for name, path in CURVES.items():
        draw_curve(panels[name], path)
        ends = at(path, np.linspace(path.knots[0], path.knots[-1], SHOWN_2_4 + 1))
        panels[name].plot(*ends.T, "o-", color="C1", ms=4, lw=0.8, label=f"{SHOWN_2_4} linear segments")
    legend_below(figure, panels["smooth"])
    for (name, of), look in zip(errors.items(), (Style("C0", "o"), Style("C4", "v")), strict=True):
        label = f"curve {name}, slope {slopes[name]:.2f}"
        curve(panels["errors"], dict(zip(PIECES, of, strict=True)), look, label=label)
    name_axes(panels["errors"], "linear segments", "missing part / length", log="xy", legend="best")
    measured = {
        name: {
            "length": exact[name],
            "missing part": dict(zip(map(str, PIECES), errors[name], strict=True)),
            "slope": slopes[name],
            f"length by {FINE} segments": float(table(path, FINE)[1][-1]),
        }
        for name, path in CURVES.items()
    }
    claims = {
        "sums of lengths of linear segments approximate the length: 4096 miss less than 1/1000": all(
            of[-1] < 1e-3 for of in errors.values()
        ),
        "they are never longer than the curve": all(error >= 0 for of in errors.values() for error in of),
        "it works for all continuous curves: errors fall with a corner, too": slopes["with a corner"] < -0.8,
        "as fast as without": slopes["with a corner"] < 0.9 * slopes["smooth"],
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_2_4}


SHOWN_2_5 = 16
COUNTS_2_5 = tuple(2**k for k in range(3, 11))
INSIDE = 32
"""Places of each segment where its distance from the curve is measured."""

NOTE_2_5 = (
    "The curve of Fig. 2.2. Segments have equal arc lengths, and almost equal chords. 'error': largest "
    "distance of segment and curve at the same arc length, at 32 points of each segment, relative to "
    "the curve's length; the bound comes with the segments. 'table': the curve is divided by Eq. 2.5 "
    "and 2.6 with a table of that many pieces per segment; shown is how much longer the longest arc is "
    "than the mean."
)


def thesis_2_5(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the segments, and their largest error over their number beside the bound."""
    u, lengths = table(CURVE, FINE)
    errors, bounds, spread, at_ends = [], [], [], []
    divided = {count: CURVE.by_arc_length(count) for count in COUNTS_2_5}
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
    hulls = {f"ends of {n} segments": ConvexHull(divided[n].points) for n in (SHOWN_2_5, COUNTS_2_5[-1])}
    inside = {name: float(hull.volume) for name, hull in hulls.items()}
    outer = float(ConvexHull(CURVE.control).volume)
    unequal = {str(times): _table_error(times, u, lengths) for times in (1, 4, 16)}
    few, _, many = unequal.values()

    figure, (left, right) = pair(
        "Ends of segments lie on the curve, and errors in between stay below their bound\n"
        "thesis, Fig. 2.5; linear segments of equal length"
    )
    draw_curve(left, CURVE)
    label = f"{SHOWN_2_5} segments of equal length"
    left.plot(*divided[SHOWN_2_5].points.T, "o-", color="C1", ms=4, lw=0.8, label=label)
    legend_below(figure, figure.axes[0])
    right.plot(COUNTS_2_5, bounds, "k:", label="bound of the segments")
    right.plot(COUNTS_2_5, errors, "o-", color="C1", ms=4, label="largest error")
    name_axes(right, "linear segments", "error / length of the curve", log="xy", legend="best")
    of_count = {
        str(count): {"error": error, "bound": bound, "longest chord / shortest": ratio}
        for count, error, bound, ratio in zip(COUNTS_2_5, errors, bounds, spread, strict=True)
    }
    measured = {
        "segments": of_count,
        "error at the ends of segments, at most": max(at_ends),
        "slope of the error": float(np.polyfit(np.log(COUNTS_2_5[2:]), np.log(errors[2:]), 1)[0]),
        "area of the convex hull": {"control points": outer, **inside},
        "table": unequal,
    }
    claims = {
        "ends of segments lie exactly on the curve": max(at_ends) < 1e-7,
        "points in between may not": errors[0] > 1e-3,
        "no error is above its bound": all(e <= b for e, b in zip(errors, bounds, strict=True)),
        "segments are of the same length, too: within 1 % from 256 of them on": all(
            ratio < 1.01 for count, ratio in zip(COUNTS_2_5, spread, strict=True) if count >= 256
        ),
        "the segments' bounds are tighter than the control points'": max(inside.values()) < outer,
        "for accuracy the table should have more pieces than there are segments": few > 4 * many,
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_2_5}


def _table_error(times: int, u: NDArray, lengths: NDArray) -> float:
    """Return the longest arc over the mean, minus 1, of segments by a table of ``times`` as many pieces."""
    coarse, approximate = table(CURVE, times * SHOWN_2_5)
    wanted = np.linspace(0, approximate[-1], SHOWN_2_5 + 1)
    arcs = np.diff(np.interp(np.interp(wanted, approximate, coarse), u, lengths))
    return float(arcs.max() / arcs.mean() - 1)


SHOWN_2_7 = (3, 6, 12, 24)
TURNS = (0.25, 1, 4)
ALLOWED = 0.01
"""Of the radius, how far the segments may be from the circle."""

NOTE_2_7 = (
    "A point turns about the middle while the shutter is open; linear segments, equal in time, end on "
    "its path. 'error': largest distance from the point at the same time, relative to the radius; in "
    "the middle of a segment it is 1 - cos(half its angle)."
)


def thesis_2_7(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a full turn by few and by many segments, and count how many are enough."""
    figure = new_figure(
        "A fast rotation needs more than 20 linear segments per turn for an error of 1 %\nthesis, Fig. 2.7",
        3.4,
    )
    grid = figure.add_gridspec(2, 3, width_ratios=(1, 1, 2))
    axes = [figure.add_subplot(grid[place]) for place in ((0, 0), (0, 1), (1, 0), (1, 1), (slice(None), 2))]
    angles = np.linspace(0, 2 * np.pi, 361)
    for panel, segments in zip(axes, SHOWN_2_7, strict=False):
        path = motion.approximated(_rotation(1.0), 0.0, 1.0, segments)
        panel.plot(np.cos(angles), np.sin(angles), color="0.7", lw=3, label="path")
        panel.plot(*np.asarray(path.points).T, "o-", color="C1", ms=4, lw=1, label="linear segments")
        panel.set(aspect="equal", xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))
        panel.set_axis_off()
        panel.set_title(f"{segments} segments:\nerror {100 * _error(1.0, segments):.1f} %")
    legend_below(figure, figure.axes[0])
    counts = [4 * 2**k for k in range(7)]
    errors = {turns: [_error(turns, n) for n in counts] for turns in TURNS}
    for (turns, of), marker in zip(errors.items(), "ov^", strict=True):
        axes[-1].plot(counts, of, marker=marker, ms=4, label=_turns(turns))
    axes[-1].axhline(
        ALLOWED, color="k", lw=0.8, ls=":", label=f"allowed: {100 * ALLOWED:.0f} % of the radius"
    )
    name_axes(axes[-1], "linear segments", "error / radius", log="xy", legend="lower left")

    enough = {turns: int(np.ceil(np.pi * turns / np.arccos(1 - ALLOWED))) for turns in TURNS}
    around = {turns: [_error(turns, n - 1), _error(turns, n)] for turns, n in enough.items()}
    measured = {
        "segments for 1 % of the radius": {_turns(turns): n for turns, n in enough.items()},
        "error with one less, and with these": {_turns(turns): of for turns, of in around.items()},
        "error / radius, one turn": {str(n): _error(1.0, n) for n in SHOWN_2_7},
    }
    claims = {
        "fast rotation needs a large number of segments: more than 20 a turn for 1 %": enough[1] > 20,
        "the number is in proportion to the angle: 1 - cos(half of a segment's) is the error": all(
            with_one_less > ALLOWED >= with_these for with_one_less, with_these in around.values()
        ),
        "any curve can be approximated as accurately as desired with enough segments (Sect. 2.4)": all(
            of[-1] < 0.3 * of[-2] for of in errors.values()
        ),
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_2_7}


def _turns(turns: float) -> str:
    return f"{turns:g} turn" + "s" * (turns > 1)


def _rotation(turns: float) -> Callable[[Any], Any]:
    return lambda time: np.stack(
        [np.cos(2 * np.pi * turns * time), np.sin(2 * np.pi * turns * time)], axis=-1
    )


def _error(turns: float, segments: int) -> float:
    """Return the largest distance from the path, over the radius, at 64 places of each segment."""
    path = motion.approximated(_rotation(turns), 0.0, 1.0, segments)
    times = np.linspace(0, 1, 64 * segments + 1)
    return float(np.linalg.norm(at(path, times) - _rotation(turns)(times), axis=1).max())


SEGMENTS = 8
COUNTS_2_8 = (*range(4, 13), 16, 20, 25, 32, 40)
TIMES = np.linspace(0, 1, 20001)
JUMPS = 3
COLORS = ("C1", "C0")
HEIGHT = 0.5

# Each jump is a parabola: a Bezier curve of degree 2, joined to the next by a knot as multiple as that.
_LANDINGS = np.arange(JUMPS + 1) / JUMPS
_MIDDLES = (_LANDINGS[1:] + _LANDINGS[:-1]) / 2
_CONTROL = np.zeros((2 * JUMPS + 1, 2))
_CONTROL[0::2, 0], _CONTROL[1::2, 0], _CONTROL[1::2, 1] = _LANDINGS, _MIDDLES, 2 * HEIGHT
BALL = motion.nurbs(_CONTROL, None, np.repeat(_LANDINGS, [3, *[2] * (JUMPS - 1), 3]), degree=2)

NOTE_2_8 = (
    "The lowest point of a ball that jumps three times, a NURBS curve of degree 2 whose inner knots are "
    "double: there its direction jumps. Heights at the landings are relative to the height of a jump. "
    "Without corners the segments are equal in time; multiples of three happen to end at the landings."
)


def thesis_2_8(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both approximations, and measure how high above the floor the ball turns."""
    ways = {"ends at equal times": (), "ends at the corners, too": BALL.corners}
    floating = {
        name: {n: _floats(_approximated(n, known)) for n in COUNTS_2_8} for name, known in ways.items()
    }
    figure = new_figure(
        "The ball touches the floor only if segments end where it lands\nthesis, Fig. 2.8; a jumping ball",
        3.2,
    )
    grid = figure.add_gridspec(2, 2)
    axes = [figure.add_subplot(grid[place]) for place in ((0, 0), (1, 0), (slice(None), 1))]
    for panel, color, (name, known) in zip(axes, COLORS, ways.items(), strict=False):
        path = _approximated(SEGMENTS, known)
        panel.axhline(0, color="0.5", lw=2)
        panel.plot(*at(BALL, TIMES).T, color="0.7", lw=3, label="path")
        panel.plot(*np.asarray(path.points).T, "o-", color=color, ms=4, lw=1, label="linear segments")
        panel.set(xlim=(-0.05, 1.05), ylim=(-0.1, 0.75))
        panel.set_axis_off()
        above = floating[name][SEGMENTS]
        panel.set_title(f"{SEGMENTS} segments, {name}:\nlowest point: {100 * above:.0f} % of a jump's height")
    for (name, of), color, size in zip(floating.items(), COLORS, (6, 3), strict=True):
        axes[2].plot(COUNTS_2_8, list(of.values()), "o", color=color, ms=size, label=name)
    axes[2].annotate("multiples of 3", (12, 0.015), (15, 0.06), arrowprops={"arrowstyle": "->", "lw": 0.6})
    legend_below(figure, axes[0])
    name_axes(axes[2], "linear segments", "lowest point / height of a jump", legend="best")
    without, knowing = floating.values()
    measured = {
        "corners that knots tell": BALL.corners.tolist(),
        "height of the turn / height of a jump": {
            name: {str(n): of[n] for n in COUNTS_2_8} for name, of in floating.items()
        },
    }
    claims = {
        "if ends do not coincide with the corners, the ball turns above the floor": all(
            height > 1e-3 for n, height in without.items() if n % JUMPS
        ),
        "with ends at the corners it touches the floor": max(knowing.values()) < 1e-12,
        "multiplicities of the knot vector tell the corners": np.allclose(BALL.corners, _LANDINGS[1:-1]),
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_2_8}


def _approximated(segments: int, corners: Sequence[float]) -> motion.LinearSegments:
    path: Any = partial(at, BALL)
    return motion.approximated(path, 0.0, 1.0, segments, corners)


def _floats(path: motion.LinearSegments) -> float:
    """Return how high above the floor the ball is at its lowest around the landing where that is most."""
    heights = at(path, TIMES)[:, 1]
    lowest = [heights[abs(TIMES - landing) < 0.5 / JUMPS].min() for landing in _LANDINGS[1:-1]]
    # Landings need not be among the times of the list.
    exact = at(path, _LANDINGS[1:-1])[:, 1]
    return float(np.minimum(lowest, exact).max() / HEIGHT)

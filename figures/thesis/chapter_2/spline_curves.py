"""Curves that objects move along: basis, equal steps, knots of full multiplicity (Fig. 2.1 to 2.3)."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from figures.shared.sheets.panels import legend_below, name_axes, new_figure
from qmcjax.core.pytrees import jit
from qmcjax.tracing import motion

FINE = 2**15
"""Chords of the table that stands for the exact arc length: its relative error is below 1e-8."""

CURVE = motion.nurbs(
    [[0, 0], [0.1, 2.6], [1.0, 3.0], [1.5, 0.3], [1.9, 0.0], [3.9, -0.2], [4.4, 2.8], [2.9, 2.2]],
    [1, 1, 2, 1, 1, 1, 2, 1],
    [0, 0, 0, 0, 1, 2, 3, 4, 5, 5, 5, 5],
    degree=3,
)
"""A curve that is slow in some parts and fast in others."""

CORNER = motion.nurbs(
    [[0, 2.2], [0.5, 2.9], [1.3, 2.7], [1.9, 1.5], [2.1, 0.0], [2.5, 1.6], [3.2, 2.8], [4.2, 2.4]],
    None,
    [0, 0, 0, 0, 1, 2, 2, 2, 6, 6, 6, 6],
    degree=3,
)
"""The knots of Fig. 2.3: one is as multiple as the degree."""


BLOCK = 2**12
"""Times that are evaluated together: of one shape, so that a path is compiled once."""


def at(path: Any, times: ArrayLike) -> NDArray[np.float64]:
    """Evaluate a path, shape (n,) to (n, d), in float64."""
    known = np.asarray(times, np.float64)
    blocks = np.pad(known, (0, -len(known) % BLOCK), mode="edge").reshape(-1, BLOCK)
    with jax.enable_x64(True):
        return np.concatenate([np.asarray(_evaluate(path, block)) for block in blocks])[: len(known)]


@jit()
def _evaluate(path: Any, times: jax.Array) -> jax.Array:
    return path(times)


def table(curve: motion.Nurbs, pieces: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return equidistant parameters and their approximate arc lengths, Eq. 2.5."""
    u = np.linspace(curve.knots[0], curve.knots[-1], pieces + 1)
    chords = np.linalg.norm(np.diff(at(curve, u), axis=0), axis=1)
    return u, np.append(0.0, np.cumsum(chords))


def pair(title: str) -> tuple[Figure, list[Axes]]:
    """Return a figure of two panels for curves that are wider than high."""
    figure = new_figure(title, 3.4)
    return figure, list(figure.subplots(1, 2))


def draw_curve(axes: Axes, curve: motion.Nurbs) -> None:
    """Draw a planar curve and its control polygon."""
    fine = at(curve, np.linspace(curve.knots[0], curve.knots[-1], 1001))
    axes.plot(*np.transpose(curve.control), "s--", color="0.6", ms=4, lw=0.8, label="control points")
    axes.plot(*fine.T, color="C0", lw=1.5, label="curve")
    axes.set_aspect("equal")
    axes.set_axis_off()


KNOTS = (0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 8, 8, 8)
DEGREE = 3
COUNT = len(KNOTS) - DEGREE - 1
SWITCHED_OFF = 4

NOTE_2_1 = (
    "The functions are a NURBS curve in {count} dimensions whose control points are the unit vectors. "
    "'difference' is between the iterative algorithm and Eq. 2.2 with 0/0 = 0. Inside a knot span p + 1 "
    "= 4 functions do not vanish, all of which the loop computes; the text says p. Nonnegativity, "
    "partition of unity and local support give the convex hull property."
)


def thesis_2_1(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the functions, and test the properties that the thesis lists."""
    functions = motion.nurbs(np.eye(COUNT), None, KNOTS, DEGREE)
    u = np.linspace(KNOTS[0], KNOTS[-1], 1601)
    values = at(functions, u)
    recursive = np.stack([_recursive(i, DEGREE, u[:-1]) for i in range(COUNT)], axis=-1)
    difference = float(abs(values[:-1] - recursive).max())
    support = [(KNOTS[i], KNOTS[i + DEGREE + 1]) for i in range(COUNT)]
    outside = np.stack([(u < low) | (u > high) for low, high in support], axis=-1)
    inner = ~np.isin(u, KNOTS)
    nonzero = (values[inner] > 0).sum(axis=1)
    without = np.ones(COUNT)
    without[SWITCHED_OFF] = 0
    weighted = at(motion.nurbs(np.eye(COUNT), without, KNOTS, DEGREE), u)

    title = (
        "At most four cubic B-spline basis functions differ from zero at once\n"
        "thesis, Fig. 2.1; end knots four times each"
    )
    figure = new_figure(title, 2.8)
    axes = figure.subplots()
    axes.axvspan(3, 4, color="0.92", lw=0)
    axes.text(3.5, 0.97, "four functions\nbetween two knots", ha="center", va="center")
    for i, column in enumerate(values.T):
        axes.plot(u, column, lw=1.2, color=f"C{i % 10}")
        look: dict[str, Any] = {"ha": "center", "color": f"C{i % 10}"}
        top = u[column.argmax()], column.max()
        axes.annotate(f"$N_{{{i},3}}$", top, xytext=(0, 3), textcoords="offset points", **look)
    name_axes(axes, "parameter u", "value of the basis function", ticks=sorted(set(KNOTS)))
    axes.set(xlim=(-0.15, 8.15), ylim=(0, 1.1))
    off = float(abs(values.sum(axis=1) - 1).max())
    counts = sorted({int(n) for n in nonzero})
    measured = {
        "functions": COUNT,
        "difference": difference,
        "sum minus 1, at most": off,
        "functions that do not vanish inside a span": counts,
    }
    claims = {
        "the inverted triangular scheme avoids dividing by zero": bool(np.isfinite(values).all()),
        "it computes the functions of Eq. 2.2": difference < 1e-12,
        "p functions do not vanish": counts == [DEGREE],
        "nonnegativity": bool((values >= 0).all()),
        "partition of unity": off < 1e-12,
        "local support: zero outside [u_i, u_(i+p+1)]": bool((values[outside] == 0).all()),
        "the curve begins at the first and ends at the last control point": bool(
            (values[0] == np.eye(COUNT)[0]).all() and (values[-1] == np.eye(COUNT)[-1]).all()
        ),
        "a weight of zero disables the control point": bool(
            (weighted[:, SWITCHED_OFF] == 0).all() and abs(weighted.sum(axis=1) - 1).max() < 1e-12
        ),
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_2_1.format(count=COUNT)}


def _recursive(i: int, p: int, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return N_{i,p} by Eq. 2.1 and 2.2."""
    if p == 0:
        return ((KNOTS[i] <= u) & (u < KNOTS[i + 1])).astype(float)
    total = np.zeros_like(u)
    if KNOTS[i + p] > KNOTS[i]:
        total += (u - KNOTS[i]) / (KNOTS[i + p] - KNOTS[i]) * _recursive(i, p - 1, u)
    if KNOTS[i + p + 1] > KNOTS[i + 1]:
        total += (KNOTS[i + p + 1] - u) / (KNOTS[i + p + 1] - KNOTS[i + 1]) * _recursive(i + 1, p - 1, u)
    return total


STEPS = 24
SEGMENTS = 16 * STEPS

NOTE_2_2 = (
    "The curve is ours: the thesis prints none. Steps are arc lengths between consecutive circles, from "
    f"a table of {FINE} chords. Right: the curve in {SEGMENTS} segments of equal arc length "
    "(by_arc_length)."
)


def thesis_2_2(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both, and measure how far it is from circle to circle."""
    u, lengths = table(CURVE, FINE)
    equidistant = np.linspace(u[0], u[-1], STEPS + 1)
    constant_speed = CURVE.by_arc_length(SEGMENTS)
    points = {
        "parameter linear in time": at(CURVE, equidistant),
        "arc length linear in time": at(constant_speed, np.linspace(0, 1, STEPS + 1)),
    }
    fine = at(CURVE, u)
    steps = {
        name: np.diff([_arc_length(point, fine, lengths) for point in of]) for name, of in points.items()
    }
    ratios = {name: float(of.max() / of.min()) for name, of in steps.items()}

    figure, axes = pair(
        "Equal steps of the parameter are unequal steps along the curve\n"
        "thesis, Fig. 2.2; two parametrisations of a NURBS curve"
    )
    for panel, (name, of) in zip(axes, points.items(), strict=True):
        draw_curve(panel, CURVE)
        panel.plot(*of.T, "o", mfc="white", color="C1", ms=5, label="at equal time steps")
        panel.set_title(f"{name}\nlongest step / shortest = {ratios[name]:.4g}")
    legend_below(figure, figure.axes[0])
    by_parameter, by_length = ratios.values()
    measured = {name: {"longest step / shortest": ratio} for name, ratio in ratios.items()}
    measured["length of the curve"] = {"table": float(lengths[-1]), "library": constant_speed.length}
    claims = {
        "speed is not constant where u is linear in time": by_parameter > 2,
        "it is where the arc length is": by_length < 1 + 1e-3,
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_2_2}


def _arc_length(point: NDArray, fine: NDArray, lengths: NDArray) -> float:
    """Return the arc length at the nearest point of the table's chords."""
    k = int(np.clip(np.argmin(np.linalg.norm(fine - point, axis=1)), 1, len(fine) - 2))
    along = fine[k + 1] - fine[k - 1]
    part = np.clip((point - fine[k - 1]) @ along / (along @ along), 0, 1)
    return float(lengths[k - 1] + part * (lengths[k + 1] - lengths[k - 1]))


SIMPLE = (0, 0, 0, 0, 1, 2, 3, 4, 6, 6, 6, 6)
BOTTOM = 4
STEP = 1e-7

NOTE_2_3 = (
    "Knots as printed; the control points are ours. Right: the same control points with simple knots. "
    "'turn' is the angle between the directions 1e-7 before and after the nearest point, 'gap' the "
    "distance between these two points."
)


def thesis_2_3(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the curve beside that of simple knots, and measure distance and turn at the lowest point."""
    curves = {
        "the knot 2 three times": CORNER,
        "simple knots": motion.nurbs(CORNER.control, CORNER.weights, SIMPLE, 3),
    }
    figure, axes = pair(
        "A knot of full multiplicity pulls the curve through a control point, with a corner\nthesis, Fig. 2.3"
    )
    measured = {}
    for panel, (name, curve) in zip(axes, curves.items(), strict=True):
        measured[name] = found = _at_bottom(curve)
        draw_curve(panel, curve)
        panel.plot(*CORNER.control[BOTTOM], "s", color="C1", ms=5)
        panel.set_title(f"{name}\nturn at the bottom {found['turn, degrees']:.1f}°")
    legend_below(figure, figure.axes[0])
    corner, smooth = measured.values()
    claims = {
        "it causes the curve to interpolate the control point at the bottom": corner["distance"] < 1e-12,
        "there it is continuous": corner["gap"] < 1e-5,
        "but only that: its direction jumps": corner["turn, degrees"] > 1,
        "with simple knots it is smooth and misses the point": smooth["turn, degrees"] < 1e-3
        and smooth["distance"] > 0.1,
        "knots and control points tell where (Sect. 2.4)": corner["corners"] == [2.0]
        and smooth["corners"] == [],
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_2_3}


def _at_bottom(curve: motion.Nurbs) -> dict:
    """Measure a curve where it is nearest to the control point at the bottom."""
    u = np.union1d(np.linspace(curve.knots[0], curve.knots[-1], 6001), curve.knots)
    distances = np.linalg.norm(at(curve, u) - CORNER.control[BOTTOM], axis=1)
    nearest = u[distances.argmin()]
    a, b, c, d = at(curve, nearest + STEP * np.array([-2, -1, 1, 2]))
    before, behind = (b - a) / np.linalg.norm(b - a), (d - c) / np.linalg.norm(d - c)
    return {
        "distance": float(distances.min()),
        "turn, degrees": float(np.degrees(np.arccos(np.clip(before @ behind, -1, 1)))),
        "gap": float(np.linalg.norm(c - b)),
        "corners": curve.corners.tolist(),
    }

"""Thesis Fig. 2.3: a knot as multiple as the degree makes a curve pass through a control point."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.shared.sheets.curves import legend_below
from figures.shared.sheets.trajectories import CORNER, at, draw, pair
from qmcjax.tracing import motion

SIMPLE = (0, 0, 0, 0, 1, 2, 3, 4, 6, 6, 6, 6)
BOTTOM = 4
STEP = 1e-7

NOTE = (
    "Knots as printed; the control points are ours. Right, the same control points with simple knots. "
    "'turn' is the angle between the directions a step of 1e-7 before and behind the nearest point, "
    "'gap' the distance between these two points."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the curve beside that of simple knots, and measure distance and turn at the lowest point."""
    curves = {
        "the knot 2 three times": CORNER,
        "simple knots": motion.nurbs(CORNER.control, CORNER.weights, SIMPLE, 3),
    }
    figure, axes = pair("A knot as multiple as the degree of the curve (thesis Fig. 2.3)")
    measured = {}
    for panel, (name, curve) in zip(axes, curves.items(), strict=True):
        measured[name] = found = _at_bottom(curve)
        draw(panel, curve)
        panel.plot(*CORNER.control[BOTTOM], "s", color="C1", ms=5)
        panel.set_title(f"{name}\nturn at the bottom {found['turn, degrees']:.1f}°", fontsize=9)
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
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


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

"""Thesis Fig. 2.2: a curve at equidistant parameters, and at equidistant arc lengths."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures.shared.sheets.curves import legend_below
from figures.shared.sheets.trajectories import CURVE, FINE, at, draw, pair, table

STEPS = 24
SEGMENTS = 16 * STEPS

NOTE = (
    "The curve is ours: the thesis prints none. Steps are arc lengths between circles that follow each "
    f"other, by a table of {FINE} chords. Right, the curve is made of {SEGMENTS} segments of equal arc "
    "length, by_arc_length."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
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

    figure, axes = pair("Two parametrisations of a NURBS curve (thesis Fig. 2.2)")
    for panel, (name, of) in zip(axes, points.items(), strict=True):
        draw(panel, CURVE)
        panel.plot(*of.T, "o", mfc="white", color="C1", ms=5, label="equal times apart")
        panel.set_title(f"{name}\nlongest step / shortest = {ratios[name]:.4g}", fontsize=9)
    legend_below(figure, figure.axes[0])
    by_parameter, by_length = ratios.values()
    measured = {name: {"longest step / shortest": ratio} for name, ratio in ratios.items()}
    measured["length of the curve"] = {"table": float(lengths[-1]), "library": constant_speed.length}
    claims = {
        "speed is not constant where u is linear in time": by_parameter > 2,
        "it is where the arc length is": by_length < 1 + 1e-3,
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def _arc_length(point: NDArray, fine: NDArray, lengths: NDArray) -> float:
    """Return the arc length at the nearest point of the table's chords."""
    k = int(np.clip(np.argmin(np.linalg.norm(fine - point, axis=1)), 1, len(fine) - 2))
    along = fine[k + 1] - fine[k - 1]
    part = np.clip((point - fine[k - 1]) @ along / (along @ along), 0, 1)
    return float(lengths[k - 1] + part * (lengths[k + 1] - lengths[k - 1]))

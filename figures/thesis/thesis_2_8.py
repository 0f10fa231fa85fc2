"""Thesis Fig. 2.8: a ball that jumps touches the floor only if segments end where its direction jumps."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from figures.shared.sheets import point_plots
from figures.shared.sheets.curves import name_axes
from figures.shared.sheets.trajectories import at
from qmcjax.tracing import motion

SEGMENTS = 8
COUNTS = (*range(4, 13), 16, 20, 25, 32, 40)
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

NOTE = (
    "The lowest point of a ball that jumps three times, a NURBS curve of degree 2 whose inner knots are "
    "double: there its direction jumps. Heights in parts of a jump's height, at the landings between jumps. "
    "Without corners the segments are equal in time; multiples of three happen to end at the landings."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both approximations, and measure how high above the floor the ball turns."""
    ways = {"ends at equal times": (), "ends at the corners, too": BALL.corners}
    floating = {name: {n: _floats(_approximated(n, known)) for n in COUNTS} for name, known in ways.items()}
    figure, axes = point_plots.panels(3, "A ball that jumps, by linear segments (thesis Fig. 2.8)")
    for panel, color, (name, known) in zip(axes, COLORS, ways.items(), strict=False):
        path = _approximated(SEGMENTS, known)
        panel.axhline(0, color="0.5", lw=2)
        panel.plot(*at(BALL, TIMES).T, color="0.7", lw=3, label="path")
        panel.plot(*np.asarray(path.points).T, "o-", color=color, ms=4, lw=1, label="linear segments")
        panel.set(xlim=(-0.05, 1.05), ylim=(-0.1, 0.75))
        panel.set_axis_off()
        title = f"{SEGMENTS} segments, {name}\nturns at {floating[name][SEGMENTS]:.1%} of its height"
        panel.set_title(title, fontsize=8)
        panel.legend(fontsize=8, loc="upper left")
    for (name, of), color in zip(floating.items(), COLORS, strict=True):
        axes[2].plot(COUNTS, list(of.values()), ".-", color=color, lw=0.8, label=name)
    name_axes(axes[2], "linear segments", "height of the turn / height of a jump", legend="best")
    without, knowing = floating.values()
    measured = {
        "corners that knots tell": BALL.corners.tolist(),
        "height of the turn / height of a jump": {
            name: {str(n): of[n] for n in COUNTS} for name, of in floating.items()
        },
    }
    claims = {
        "if ends do not coincide with the corners, the ball turns above the floor": all(
            height > 1e-3 for n, height in without.items() if n % JUMPS
        ),
        "with ends at the corners it touches the floor": max(knowing.values()) < 1e-12,
        "multiplicities of the knot vector tell the corners": np.allclose(BALL.corners, _LANDINGS[1:-1]),
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


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

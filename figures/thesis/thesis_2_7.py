"""Thesis Fig. 2.7: a fast rotation needs many linear segments."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from figures.shared.sheets import point_plots
from figures.shared.sheets.curves import legend_below, name_axes
from figures.shared.sheets.trajectories import at
from qmcjax.tracing import motion

SHOWN = (3, 6, 12, 24)
TURNS = (0.25, 1, 4)
ALLOWED = 0.01
"""Of the radius, how far the segments may be from the circle."""

NOTE = (
    "A point turns about the middle while the shutter is open; linear segments, equal in time, end on its "
    "path. 'error' is the largest distance from the point at the same time, in parts of the radius: in the "
    "middle of a segment it is 1 - cos(half of its angle)."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a full turn by few and by many segments, and count how many are enough."""
    figure, axes = point_plots.panels(len(SHOWN) + 1, "Linear segments of a fast rotation (thesis Fig. 2.7)")
    angles = np.linspace(0, 2 * np.pi, 361)
    for panel, segments in zip(axes, SHOWN, strict=False):
        path = motion.approximated(_rotation(1.0), 0.0, 1.0, segments)
        panel.plot(np.cos(angles), np.sin(angles), color="0.7", lw=3, label="path")
        panel.plot(*np.asarray(path.points).T, "o-", color="C1", ms=4, lw=1, label="linear segments")
        panel.set(aspect="equal", xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))
        panel.set_axis_off()
        panel.set_title(f"{segments} segments,\nerror {_error(1.0, segments):.1%} of the radius", fontsize=8)
    legend_below(figure, figure.axes[0])
    counts = [4 * 2**k for k in range(7)]
    errors = {turns: [_error(turns, n) for n in counts] for turns in TURNS}
    for (turns, of), marker in zip(errors.items(), "ov^", strict=True):
        axes[-1].plot(counts, of, marker=marker, ms=4, label=f"{turns:g} turns")
    axes[-1].axhline(ALLOWED, color="k", lw=0.6, ls=":")
    name_axes(axes[-1], "linear segments", "error / radius", log="xy", legend="best")

    enough = {turns: int(np.ceil(np.pi * turns / np.arccos(1 - ALLOWED))) for turns in TURNS}
    around = {turns: [_error(turns, n - 1), _error(turns, n)] for turns, n in enough.items()}
    measured = {
        "segments for 1 % of the radius": {f"{turns:g} turns": n for turns, n in enough.items()},
        "error with one less, and with these": {f"{turns:g} turns": of for turns, of in around.items()},
        "error / radius, one turn": {str(n): _error(1.0, n) for n in SHOWN},
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
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def _rotation(turns: float) -> Callable[[Any], Any]:
    return lambda time: np.stack(
        [np.cos(2 * np.pi * turns * time), np.sin(2 * np.pi * turns * time)], axis=-1
    )


def _error(turns: float, segments: int) -> float:
    """Return the largest distance from the path, over the radius, at 64 places of each segment."""
    path = motion.approximated(_rotation(turns), 0.0, 1.0, segments)
    times = np.linspace(0, 1, 64 * segments + 1)
    return float(np.linalg.norm(at(path, times) - _rotation(turns)(times), axis=1).max())

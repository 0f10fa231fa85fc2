"""Thesis Fig. 5.15: the cases in the proof of Theorem 3, the elementary intervals of a permutation net."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

M = 5
CASES = {5: "a", 4: "b", 3: "b", 2: "d", 1: "d", 0: "c"}
NOTE = (
    "Each panel shades a strip of intervals that the proof compares in one step, its points in orange. In "
    "print, two formulas of the proof have the floor of m/2 for the ceiling: the range of r in case (c), "
    "which numbers 2**ceil(m/2) points on a diagonal, and Eq. 5.42, whose right side is that of "
    "2 (2**ceil(m/2) / 2)**2."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the six shapes of elementary intervals for m = 5, by case of the proof."""
    n, half = 2**M, M // 2
    points = point_plots.words(sequences.permutation_net(M), M)
    figure, axes = point_plots.panels(6, "Cases in the proof for m = 5 (thesis Fig. 5.15)", columns=3)
    counts = {}
    for (log_width, case), panel in zip(CASES.items(), axes, strict=True):
        log_height = M - log_width
        interval = (points[:, 0] >> log_width) << log_width | points[:, 1] >> log_height
        held = np.bincount(interval, minlength=n)
        counts[f"l = {log_width}"] = [int(held.min()), int(held.max())]
        # The strip runs along the axis that the proof looks at: x for wide intervals, y for high ones.
        axis = 0 if log_width > half else 1
        logs = (log_width, log_height)
        strip = 2 ** (M - logs[1 - axis]) // 2
        width, height = 2**log_width / n, 2**log_height / n
        for k in range(2 ** (M - logs[axis])):
            column, row = (k, strip) if axis == 0 else (strip, k)
            look: dict[str, Any] = {"color": ("C4", "gold")[k % 2], "alpha": 0.5, "lw": 0}
            panel.add_patch(Rectangle((column * width, row * height), width, height, **look))
        chosen = points[:, 1 - axis] >> logs[1 - axis] == strip
        point_plots.grid(panel, 2 ** (M - log_width), 2 ** (M - log_height))
        title = f"({case}) l = {log_width}: {2**log_width} x {2**log_height}"
        point_plots.scatter(panel, (points[~chosen] + 0.5) / n, title)
        point_plots.scatter(panel, (points[chosen] + 0.5) / n, title, color="C1")
    diagonal = (points[:, 0] - points[:, 1]) % n
    along = _smallest_gap(points[diagonal == 0, 1], n)
    across = _smallest_gap(np.unique(diagonal), n)
    squared = analysis.squared_min_distance(points, side=n)
    return figure, {
        "measured": {
            "fewest and most points in an elementary interval": counts,
            "squared distance along a diagonal, Eq. 5.41": 2 * along**2,
            "squared distance between diagonals, Eq. 5.42": across**2 // 2,
            "squared distance": squared,
        },
        "printed": {
            "points in an elementary interval": 1,
            "squared distance along a diagonal, Eq. 5.41": 32,
            "squared distance between diagonals, Eq. 5.42": 32,
            "squared distance": 32,
        },
        "claims": {
            "exactly one point in each elementary interval (Theorem 3)": {
                shape: found == [1, 1] for shape, found in counts.items()
            },
            "the squared distance is 2^m": {
                "along a diagonal, Eq. 5.41": 2 * along**2 == n,
                "between diagonals, Eq. 5.42": across**2 // 2 == n,
                "of all points": squared == n,
            },
            "formulas of the proof are right as printed": {
                "range of r in case (c)": 2**half == int(np.count_nonzero(diagonal == 0)),
                "value of Eq. 5.42": 2 * (2**half / 2) ** 2 == n,
            },
        },
        "note": NOTE,
    }


def _smallest_gap(numbers: NDArray[np.int64], n: int) -> int:
    """Return the smallest distance of two numbers modulo n."""
    ordered = np.sort(numbers)
    return int(np.min(np.diff(ordered, append=ordered[0] + n)))

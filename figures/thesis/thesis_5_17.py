"""Thesis Fig. 5.17: the iterative construction of the permutation nets of even m."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures.shared.sheets import point_plots
from figures.thesis.thesis_5_14 import SQUARED, constructed, is_direct, moved

M = 8
START = tuple(np.array([[i + 4 * d + 1, 4 * i + y] for i in range(4)]) for d, y in enumerate((0, 2, 1, 3)))
"""P_0, ..., P_3 of 16 points, four diagonals."""


def quadrupled(parts: tuple[NDArray[np.int64], ...]) -> tuple[NDArray[np.int64], ...]:
    """Return the next P_0, ..., P_3, before wrapping: rule 1 to 5 for 2**k points."""
    n = sum(map(len, parts))
    # Eq. 5.45 moves P_1 and P_3. The sentence above it, P_0 and P_2: nets, too, but not as good.
    twice = [moved(2 * part, i % 2, 0) for i, part in enumerate(parts)]
    extended = [np.concatenate([part, moved(part, n // 2, 2 * n)]) for part in twice]
    lower, upper = np.concatenate(extended[:2]), np.concatenate(extended[2:])
    return lower, upper, moved(lower, 2 * n, 1), moved(upper, 2 * n, 1)


def unwrapped(m: int) -> NDArray[np.int64]:
    """Return 2**m points on diagonals that leave the square to the right, for even m >= 4."""
    parts = START
    while sum(map(len, parts)) < 2**m:
        parts = quadrupled(parts)
    return np.concatenate(parts)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the point sets for m = 4, 6, 8, and the last one wrapped."""
    figure, axes = point_plots.panels(
        4, f"Iterative construction of the (0,{M},2)-permutation net (thesis Fig. 5.17)"
    )
    figure.set_size_inches(13, 3.4)
    net = constructed(axes, range(4, M + 1, 2), unwrapped, 1.25)
    squared = analysis.squared_min_distance(net, side=2**M, shear=2 ** (M - 2))
    return figure, {
        "measured": {SQUARED: squared},
        "printed": {SQUARED: 241},
        "claims": {
            f"it is a (0,{M},2)-net": point_plots.holds_one_each(net / 2**M, M),
            "its squared distance is 241": squared == 241,
            "it equals the direct construction": is_direct(net, M),
        },
        "note": "Grey: the square with the net. Orange: points beyond it, and where they are wrapped to. "
        "Distance with the sheared tiling. Step 1 moves P_1 and P_3, Eq. 5.45. The sentence above it moves "
        "P_0 and P_2: nets, too, but of squared distance 41, 164, 656 for m = 6, 8, 10.",
    }

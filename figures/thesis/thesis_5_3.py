"""Thesis Fig. 5.3: blocks of the Sobol' (0,2)-sequence are nets, and so is their union."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

M, BLOCKS = 6, 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw four blocks of 64 points, and all of them together."""
    seq = sequences.sobol(2)
    blocks = [point_plots.block(seq, 2**M, k * 2**M) for k in range(BLOCKS)]
    # In the middle of the cells of all points.
    drawn = [points + 0.5 / (BLOCKS * 2**M) for points in blocks]
    figure, axes = point_plots.panels(BLOCKS + 1, "Blocks of the Sobol' (0,2)-sequence (thesis Fig. 5.3)")
    for k, panel in enumerate(axes[:-1]):
        point_plots.grid(panel, 2 ** (M // 2), 2 ** (M // 2))
        point_plots.scatter(panel, drawn[k], f"points {k * 2**M} to {(k + 1) * 2**M - 1}", color=f"C{k}")
    point_plots.grid(axes[-1], 2 ** (M // 2 + 1), 2 ** (M // 2 + 1))
    for k in range(BLOCKS):
        point_plots.scatter(axes[-1], drawn[k], "superimposed", color=f"C{k}")
    together = np.concatenate(blocks)
    return figure, {
        "measured": {
            "t of the blocks": [analysis.t_value(points) for points in blocks],
            "t of their union": analysis.t_value(together),
        },
        "claims": {
            "each block is a (0,6,2)-net": {
                f"block {k}": point_plots.holds_one_each(points, M) for k, points in enumerate(blocks)
            },
            "their union is a (0,8,2)-net": point_plots.holds_one_each(together, M + 2),
        },
    }

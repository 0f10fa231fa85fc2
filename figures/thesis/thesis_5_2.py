"""Thesis Fig. 5.1 and 5.2: the elementary intervals of area 1/16, and a net with one point in each."""

from collections.abc import Callable

from matplotlib.figure import Figure

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

M = 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a (0,4,2)-net over every kind of elementary interval."""
    points = point_plots.block(sequences.larcher_pillichshammer_net(M), 2**M)
    figure, axes = point_plots.panels(
        M + 1, "All kinds of elementary intervals of area 1/16, and a (0,4,2)-net"
    )
    for i, panel in enumerate(axes):
        point_plots.grid(panel, 2 ** (M - i), 2**i)
        point_plots.scatter(panel, points, f"1/{2 ** (M - i)} wide, 1/{2**i} high")
    return figure, {
        "measured": {"t": analysis.t_value(points)},
        "claims": {"exactly one point in each elementary interval": point_plots.holds_one_each(points, M)},
        "note": "The net of the thesis's figure is not named; this is the Larcher-Pillichshammer net.",
    }

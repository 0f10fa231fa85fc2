"""Thesis Fig. 5.18 to 5.20: the sheared tiling of a permutation net of even m, and its pixels."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

M, TILES = 6, 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the sheared tiling, and the same points as pixels with wrapped copies of one pattern."""
    side = 2**M
    net = point_plots.words(sequences.permutation_net(M), M)
    index = jnp.arange(side, dtype=jnp.uint32)
    in_row = [
        np.asarray(sequences.permutation_net_in_row(M, row, index) >> np.uint32(32 - M)).astype(np.int64)
        for row in range(TILES)
    ]
    pattern = [
        points + np.array([column, row]) * side
        for row, points in enumerate(in_row)
        for column in range(TILES)
    ]
    whole = np.concatenate(pattern)
    figure, axes = point_plots.panels(
        2, "The sheared tiling for m = 6, cut into pixels (thesis Fig. 5.18 to 5.20)"
    )
    figure.set_size_inches(10, 5.6)
    for k, part in enumerate(pattern):
        point_plots.scatter(axes[0], part / (side * TILES), "4 x 4 pixels", ms=2.5, color=f"C{k // TILES}")
    point_plots.grid(axes[0], TILES, TILES)
    point_plots.grid(axes[1], TILES, TILES, color="0.9")
    point_plots.scatter(axes[1], whole / (side * TILES), "tiles, each row moved by a quarter", ms=2.5)
    for row in range(TILES):
        left = np.arange(-1, TILES + 1) + row % 4 / 4
        axes[1].vlines(left / TILES, row / TILES, (row + 1) / TILES, color="C1", lw=0.8)
        axes[1].axhline(row / TILES, color="C1", lw=0.8)
    patterned, sheared, alike = (
        analysis.squared_min_distance(points, side=period, shear=shear)
        for points, period, shear in ((whole, side * TILES, 0), (net, side, side // 4), (net, side, 0))
    )
    measured = {
        "squared distance of the 4 x 4 pixels, tiled regularly": patterned,
        "squared distance of the net, tiled with shear": sheared,
        "squared distance of the net, tiled regularly": alike,
    }
    return figure, {
        "measured": measured,
        "claims": {
            "the 4 x 4 pixels can be tiled regularly without a decrease in minimum distance": (
                patterned == sheared
            ),
            "the same pattern in each pixel would have less": alike < sheared,
        },
    }

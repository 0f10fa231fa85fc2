"""Colours and parameters of matplotlib that all figures share: nothing here imports JAX."""

from contextlib import AbstractContextManager

import matplotlib
from cycler import cycler

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
"""Colours that colour-blind readers tell apart (M. Okabe, K. Ito, "Color Universal Design", 2008)."""

GREY = "#999999"


def rc() -> AbstractContextManager[None]:
    """Return the context in which text is at least 8 pt at the printed size, and grids are light."""
    return matplotlib.rc_context(
        {
            "font.size": 9,
            "axes.titlesize": 9,
            "axes.labelsize": 9,
            "xtick.labelsize": 8,
            "ytick.labelsize": 8,
            "legend.fontsize": 8,
            "axes.prop_cycle": cycler(color=[BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY]),
            "axes.grid": False,
            "grid.alpha": 0.3,
            "axes.spines.top": False,
            "axes.spines.right": False,
        }
    )

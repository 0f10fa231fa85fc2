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

COLUMN, PAGE = 3.3, 7.0
"""Inches: the widths of a text column and of a page, one of which each figure has."""

LETTERS, TITLE = 8.0, 9.0
"""Points: of all text in print, and of what a figure says."""


def rc() -> AbstractContextManager[None]:
    """Return the context of figures for print: letters of 8 points, light grids."""
    return matplotlib.rc_context(
        {
            "pdf.fonttype": 42,
            **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), LETTERS),
            **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), LETTERS),
            "legend.handlelength": 1.8,
            "legend.columnspacing": 1.2,
            "axes.labelpad": 2.5,
            "axes.linewidth": 0.6,
            "axes.prop_cycle": cycler(color=[BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY]),
            "axes.grid": False,
            "grid.alpha": 0.3,
            "axes.spines.top": False,
            "axes.spines.right": False,
        }
    )

"""Curves of numbers over counts, and ratios with intervals, in the styles of samplers."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import StrMethodFormatter
from numpy.typing import ArrayLike

from figures.plot import Style


def curve(axes: Axes, of: Mapping[Any, float], drawn: Style, **look: Any) -> None:
    """Draw numbers over their counts, which may be texts."""
    look = {"ms": 4, "lw": 1, "ls": drawn.line} | look
    axes.plot([float(n) for n in of], list(of.values()), marker=drawn.marker, color=drawn.color, **look)


def ratios(axes: Axes, places: ArrayLike, of: Iterable[Sequence[float]], drawn: Style, **look: Any) -> None:
    """Draw ratios at places with their intervals: of each middle, low and high."""
    middle, low, high = np.array(list(of)).T
    look = {"ms": 5, "ls": "", "capsize": 3} | look
    span = [middle - low, high - middle]
    axes.errorbar(places, middle, span, marker=drawn.marker, color=drawn.color, **look)


def plain_numbers(axes: Axes) -> None:
    """Write 0.5 and not a power of ten at all ticks of the vertical axis."""
    for of_axis in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        of_axis(StrMethodFormatter("{x:g}"))

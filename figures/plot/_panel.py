"""Axes to draw in, and what is written there."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qmcjax.core import checks
from qmcjax.core.parameters import known, numbers, require


def panel(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return axes: those that are given, or of a new figure of a size in inches, which notebooks show."""
    if ax is None:
        # It decides how figures are shown, which is no business of scripts that save them.
        import matplotlib.pyplot as plt

        return plt.subplots(figsize=size, layout="constrained")[1]
    if not isinstance(ax, Axes):
        name = "a Figure, of which it is one of figure.axes" if isinstance(ax, Figure) else repr(ax)
        raise TypeError(f"ax must be matplotlib Axes, got {name}")
    return ax


def check_texts(**texts: Any) -> None:
    """Raise a TypeError that names what is no text."""
    for name, text in texts.items():
        if not isinstance(text, str):
            raise TypeError(f"{name} must be a text, got {checks.shown(text)}")


def number(name: str, value: Any, low: float = -np.inf, high: float = np.inf) -> float:
    """Return a real number in [low, high], or raise an error that names it."""
    given = numbers(name, known(name, value))
    require(name, given, lambda v: (v >= low) & (v <= high), f"in [{low:g}, {high:g}]")
    return float(given)

"""Axes to draw in."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure


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

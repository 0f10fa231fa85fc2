"""Images in rows, each at whole zoom with its caption, and room for curves below them."""

from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from figures import plot

DPI = 150
GAP = 14
LINE = 21
"""Of a caption, in pixels."""


class Panel(NamedTuple):
    caption: str
    image: NDArray
    limits: tuple[float, float] = (0.0, 1.0)
    """Values that are black and white."""


def image_grid(title: str, panels: Sequence[Panel], columns: int, size: int, below: int = 0) -> Figure:
    """Draw images up to ``size`` pixels wide, and leave ``below`` pixels free under them.

    All images have as many pixels a side; ``size`` is rounded down to a multiple of that.
    """
    side = len(panels[0].image)
    zoom = max(1, size // side)
    head = LINE * max(panel.caption.count("\n") + 1 for panel in panels) + 8
    cell, rows = zoom * side + GAP, -(-len(panels) // columns)
    top = 22 + 22 * (title.count("\n") + 1)
    width, height = columns * cell + GAP, top + rows * (cell + head) + GAP + below
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    figure.suptitle(title, y=1 - 14 / height)
    for k, (caption, image, limits) in enumerate(panels):
        row, column = divmod(k, columns)
        bottom = height - top - (row + 1) * (cell + head) + GAP
        axes = plot.place(figure, image, GAP + column * cell, bottom, zoom, limits=limits)
        axes.set_title(caption, fontsize=8, pad=4)
        # Outside of the image: a white one would end nowhere.
        edge = Rectangle(
            (-0.5 - 1 / zoom, -0.5 - 1 / zoom), side + 2 / zoom, side + 2 / zoom, fill=False, ec="0.8", lw=0.5
        )
        axes.add_patch(edge).set_clip_on(False)
    return figure


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Add axes to a figure of a fixed layout, at a place in pixels."""
    across, down = figure.get_size_inches() * DPI
    return figure.add_axes((left / across, bottom / down, width / across, height / down))

"""Rendered scenes: their references and errors, and sheets of images with crops."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from figures import plot
from figures._errors import rms
from figures.shared.rendered import diffusion
from figures.shared.sheets.image_grid import DPI
from qmcjax import scenes

GAP = 10


class Reference(NamedTuple):
    image: NDArray[np.float64]
    error: float
    """Root mean square of its standard errors."""
    origin: str


@cache
def reference(name: str, side: int, spp: int) -> Reference:
    """Return the stored reference of a scene of the package, or else an estimate by replicates of ``spp``."""
    found = diffusion.reference(getattr(scenes, name)(), side, spp * diffusion.REPLICATES)
    return Reference(found.image, rms(found.error), found.origin)


def rms_error(found: NDArray, exact: Reference) -> float:
    """Return the RMS error over pixels and colours, without the reference's: no less than that.

    Errors of both are independent, so their squares add.
    """
    square = np.mean(np.square(found - exact.image)) - exact.error**2
    return float(np.sqrt(max(square, exact.error**2)))


class Panel(NamedTuple):
    caption: str
    image: NDArray
    crop: tuple[float, float, float]
    """The left and upper edge and the side of the magnified area, in parts of the image."""


def sheet(panels: Sequence[Panel], columns: int, title: str, size: int, below: bool = False) -> Figure:
    """Lay images out with their magnified areas on their right, or below, both up to ``size`` pixels a side.

    Each pixel of an image is a whole number of the picture's.
    """
    rows, head, top = -(-len(panels) // columns), 44, 46 + 20 * title.count("\n")
    step = size + GAP  # from an image to its magnified area
    cell, row_height = (step, 2 * step + head) if below else (2 * step + GAP, step + head)
    width, height = columns * cell + GAP * below, rows * row_height + top
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    figure.suptitle(title, y=1 - 14 / height, fontsize=10)
    for k, panel in enumerate(panels):
        row, column = divmod(k, columns)
        y = height - top - row * row_height - head - size
        side = len(panel.image)
        left, upper, part = (round(c * side) for c in panel.crop)
        area = Rectangle((left - 0.5, upper - 0.5), part, part, fill=False, color="tab:red", lw=0.8)
        for j, pixels in enumerate((panel.image, panel.image[upper : upper + part, left : left + part])):
            x, zoom = column * cell + GAP + j * step * (not below), size // len(pixels)
            bottom = y - j * step * below + size - zoom * len(pixels)
            axes = plot.place(figure, pixels, x, bottom, zoom, transfer="srgb")
            if j == 0:
                axes.set_title(panel.caption, fontsize=8, pad=3, loc="left")
                axes.add_patch(area)
    return figure

"""Sheets of images: rows of squares at whole zoom below the heads of their columns, with keys of shades."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from figures import plot
from figures._errors import rms
from figures.shared.sheets.image_grid import DPI, add_axes

MARGIN, GAP, TOP, CAPTION, KEY = 40, 12, 64, 22, 96
"""Pixels: left of all, between images, above them, for a caption, and right of all for keys of shades."""
LINE = 20
"""Of a title after its first, in pixels."""

DECADES = (-2.0, 2.0)
"""Powers of ten of a spectrum that are black and white."""


class Shades(NamedTuple):
    """What black, white and greys between them mean."""

    label: str
    ticks: Mapping[float, str]


class Row(NamedTuple):
    """Square images by column."""

    images: Mapping[str, NDArray]
    limits: tuple[float, float] = (0.0, 1.0)
    """Values that are black and white."""
    shades: Shades | None = None
    captions: Mapping[str, str] = {}
    """Above the images, by column."""
    marked: tuple[int, int, int] | None = None
    """Left and upper edge and side of an area, in pixels."""


def image_sheet(title: str, rows: Mapping[str, Row], panel: int = 330) -> Figure:
    """Show rows of images by their labels, each up to ``panel`` pixels wide.

    Each pixel of an image is a whole number of the picture's: anything else would add patterns.
    """
    heads = list(dict.fromkeys(name for row in rows.values() for name in row.images))
    used = {label: 1 + max(map(heads.index, row.images)) for label, row in rows.items()}
    width = max(MARGIN + used[label] * (panel + GAP) + KEY * bool(row.shades) for label, row in rows.items())
    sizes = {
        label: max(panel // len(image) * len(image) for image in row.images.values())
        for label, row in rows.items()
    }
    above = TOP + LINE * title.count("\n")
    height = above + sum(sizes[label] + GAP + CAPTION * bool(row.captions) for label, row in rows.items())
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    figure.suptitle(title, y=1 - 12 / height, fontsize=9)
    top = height - above
    for label, row in rows.items():
        if row.captions:
            top -= CAPTION
        x, y = (MARGIN - 8) / width, (top - sizes[label] / 2) / height
        figure.text(x, y, label, rotation="vertical", ha="right", va="center", fontsize=8)
        for column, name in enumerate(heads):
            if name in row.images:
                left = MARGIN + column * (panel + GAP)
                _draw(figure, row, name, left, top, panel)
        if row.shades:
            _key(figure, row, MARGIN + used[label] * (panel + GAP), top - sizes[label], sizes[label])
        top -= sizes[label] + GAP
    for column, name in enumerate(heads):
        x = MARGIN + column * (panel + GAP) + panel / 2
        figure.text(x / width, (height - above + 6) / height, name, ha="center", va="bottom", fontsize=8)
    return figure


def _draw(figure: Figure, row: Row, name: str, left: int, top: int, panel: int) -> None:
    image = row.images[name]
    zoom = panel // len(image)
    size = zoom * len(image)
    axes = plot.place(figure, image, left + (panel - size) // 2, top - size, zoom, limits=row.limits)
    if name in row.captions:
        axes.set_title(row.captions[name], fontsize=8, pad=3)
    if row.marked:
        x, y, side = row.marked
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), side, side, fill=False, color="tab:red", lw=1))


def _key(figure: Figure, row: Row, left: int, bottom: int, size: int) -> None:
    """Draw a row's shades from black to white, with the values of some."""
    assert row.shades is not None
    axes = add_axes(figure, left, bottom, 14, size)
    shades, extent = np.linspace(0, 1, 256)[:, None], (0, 1, *row.limits)
    axes.imshow(shades, cmap="gray", aspect="auto", origin="lower", extent=extent)
    axes.yaxis.set_ticks_position("right")
    axes.yaxis.set_label_position("right")
    axes.set(xticks=[], yticks=list(row.shades.ticks))
    axes.spines[:].set_visible(True)
    axes.set_yticklabels(list(row.shades.ticks.values()), fontsize=8)
    axes.set_ylabel(row.shades.label, fontsize=8)


def errors(images: Mapping[str, NDArray], reference: NDArray, captions: Mapping[str, str]) -> Row:
    """Return the row of what grey images are above and below a reference."""
    found = {name: image - reference for name, image in images.items()}
    scale = 3 * rms(list(found.values()))
    ticks = {-scale: f"{-scale:.2g}", 0.0: "0", scale: f"{scale:.2g}"}
    return Row(found, (-scale, scale), Shades("error", ticks), captions)


def spectra(
    powers: Mapping[str, NDArray], captions: Mapping[str, str], decades: tuple[float, float] = DECADES
) -> Row:
    """Return the row of spectra between powers of ten, frequency 0 in the middle."""
    images = {
        name: np.log10(np.fft.fftshift(power) + 10 ** (decades[0] - 1)) for name, power in powers.items()
    }
    ticks = {float(power): f"{10.0**power:g}" for power in np.arange(decades[0], decades[1] + 1)}
    return Row(images, decades, Shades("power (white noise: 1)", ticks), captions)

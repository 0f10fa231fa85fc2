"""Sheets of images: each at whole zoom with its caption, labels of rows, keys of shades, room for curves."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from figures import plot
from figures._rc import PAGE
from figures.shared.sheets.panels import fold_title, write_title

DPI = 300
GAP, LINE = 24, 40
"""Pixels between images, and of a line of text."""

LABEL, KEY = 70, 210
"""Pixels left of rows that have labels, and right of those that have keys of shades."""

LARGE = 512
"""Pixels of the picture for the large image of `beside`."""

DECADES = (-2.0, 2.0)
"""Powers of ten of a spectrum that are black and white."""


class Panel(NamedTuple):
    caption: str
    image: NDArray
    limits: tuple[float, float] = (0.0, 1.0)
    """Values that are black and white."""
    transfer: str = "linear"
    """As of `plot.image`."""
    marked: tuple[int, int, int] | None = None
    """Left and upper edge and side of an area, in pixels of the image."""


def image_grid(title: str, panels: Sequence[Panel | None], columns: int, below: int = 0) -> Figure:
    """Draw images over the width of a page, and leave ``below`` pixels free under them.

    Each pixel of an image is a whole number of the picture's: anything else would add patterns.
    """
    rows = [list(panels[k : k + columns]) for k in range(0, len(panels), columns)]
    return _sheet(title, rows, columns, 0, 0, below)[0]


Crop = tuple[float, float, float]
"""Left and upper edge and side of a square area, in parts of the image."""


def pixels_of(crop: Crop, side: int) -> tuple[int, int, int]:
    """Return an area in pixels of an image."""
    left, upper, part = (round(c * side) for c in crop)
    return left, upper, part


def cut(image: NDArray, crop: Crop) -> NDArray:
    """Return an area of an image."""
    left, upper, part = pixels_of(crop, len(image))
    return image[upper : upper + part, left : left + part]


def mark(caption: str, image: NDArray, crop: Crop, transfer: str = "srgb") -> Panel:
    """Return an image with the border of an area."""
    left, upper, part = (round(c * len(image)) for c in crop)
    return Panel(caption, image, transfer=transfer, marked=(left, upper, part))


def beside(title: str, large: Panel, rows: Sequence[Sequence[Panel | None]]) -> Figure:
    """Draw an image on the left of rows of others, such as magnified areas."""
    figure, places = _sheet(title, rows, max(map(len, rows)), LARGE + 2 * GAP, 0, 0)
    (_, _, top, height), (_, _, bottom, _) = places[0], places[-1]
    side = _zoom(large.image, LARGE) * len(large.image)
    place_panel(figure, large, 2 * GAP, (top + height + bottom + side) // 2, LARGE)
    return figure


class Shades(NamedTuple):
    """What black, white and greys between them mean."""

    label: str
    ticks: Mapping[float, str]


class Row(NamedTuple):
    """Square images by column."""

    images: Mapping[str, NDArray]
    limits: tuple[float, float] = (0.0, 1.0)
    shades: Shades | None = None
    captions: Mapping[str, str] = {}
    """Above the images, by column."""
    marked: tuple[int, int, int] | None = None


def image_sheet(title: str, rows: Mapping[str, Row], room: int = 0) -> Figure:
    """Show rows of images by their labels over the width of a page, below the names of columns.

    ``room``: pixels that are left free on their right.
    """
    heads = list(dict.fromkeys(name for row in rows.values() for name in row.images))
    named: set[str] = set()
    table: list[list[Panel | None]] = []
    for row in rows.values():
        cells: list[Panel | None] = []
        for name in heads[: 1 + max(map(heads.index, row.images))]:
            lines = [name] * (name in row.images and name not in named) + [row.captions.get(name, "")]
            named |= row.images.keys() & {name}
            caption = "\n".join(filter(None, lines))
            image = row.images.get(name)
            cells.append(None if image is None else Panel(caption, image, row.limits, marked=row.marked))
        table.append(cells)
    if any(row.shades and heads[-1] in row.images for row in rows.values()):
        room += KEY
    figure, places = _sheet(title, table, len(heads), LABEL, room, GAP)
    across, down = figure.get_size_inches() * DPI
    for (label, row), (left, right, bottom, size) in zip(rows.items(), places, strict=True):
        x, y = (left - 16) / across, (bottom + size / 2) / down
        figure.text(x, y, label, rotation="vertical", ha="right", va="center")
        if row.shades:
            _draw_key(add_axes(figure, right, bottom, 28, size), row.limits, row.shades)
    return figure


def _sheet(
    title: str, rows: Sequence[Sequence[Panel | None]], columns: int, left: int, right: int, below: int
) -> tuple[Figure, list[tuple[int, int, int, int]]]:
    """Draw rows of images, centred; return left, right, bottom and height of each row."""
    width = round(PAGE * DPI)
    size = (width - left - right) // columns - GAP
    heads = [max(panel.caption.count("\n") + bool(panel.caption) for panel in row if panel) for row in rows]
    heads = [LINE * count + 16 * bool(count) for count in heads]
    sides = [max(_zoom(panel.image, size) * len(panel.image) for panel in row if panel) for row in rows]
    cell = max(max(sides), size - GAP) + GAP
    left += (width - left - right - columns * cell + GAP) // 2
    lines = "\n".join(fold_title(title, PAGE)).rstrip().count("\n") + 1
    top = 44 * (lines + 1)
    height = top + sum(heads) + sum(sides) + GAP * len(rows) + below
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    write_title(figure, title, y=1 - 28 / height)
    bottom, places = height - top, []
    for row, head, side in zip(rows, heads, sides, strict=True):
        bottom -= head + side
        for column, panel in enumerate(row):
            if panel is not None:
                spare = (cell - GAP - _zoom(panel.image, size) * len(panel.image)) // 2
                place_panel(figure, panel, left + column * cell + spare, bottom + side, size)
        places.append((left, left + len(row) * cell, bottom, side))
        bottom -= GAP
    return figure, places


def _zoom(image: NDArray, size: int) -> int:
    return max(1, size // len(image))


def place_panel(figure: Figure, panel: Panel, left: int, top: int, size: int) -> None:
    """Draw an image below a height in pixels, at the largest zoom at which it is no wider than ``size``."""
    side, zoom = len(panel.image), _zoom(panel.image, size)
    look = {"limits": panel.limits, "transfer": panel.transfer}
    axes = plot.place(figure, panel.image, left, top - zoom * side, zoom, **look)
    axes.set_title(panel.caption, pad=4, loc="left" if panel.marked else "center")
    # Outside of the image: a white one would end nowhere.
    low, edge = -0.5 - 1 / zoom, side + 2 / zoom
    axes.add_patch(Rectangle((low, low), edge, edge, fill=False, ec="0.8", lw=0.5)).set_clip_on(False)
    if panel.marked:
        x, y, part = panel.marked
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), part, part, fill=False, color="tab:red", lw=0.8))


def _draw_key(axes: Axes, limits: tuple[float, float], shades: Shades) -> None:
    """Draw shades from black to white, with the values of some."""
    axes.imshow(
        np.linspace(0, 1, 256)[:, None], cmap="gray", aspect="auto", origin="lower", extent=(0, 1, *limits)
    )
    axes.yaxis.set_ticks_position("right")
    axes.yaxis.set_label_position("right")
    axes.spines[:].set_visible(True)
    axes.set(xticks=[])
    axes.set_yticks(list(shades.ticks), list(shades.ticks.values()))
    axes.set_ylabel(shades.label)


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Add axes to a figure of a fixed layout, at a place in pixels."""
    across, down = figure.get_size_inches() * DPI
    return figure.add_axes((left / across, bottom / down, width / across, height / down))


def axes_below(figure: Figure, height: int, count: int) -> list[Axes]:
    """Add axes side by side, with room for their names, below the images: to a height in pixels."""
    across = round(figure.get_size_inches()[0] * DPI) // count
    return [add_axes(figure, k * across + 190, 120, across - 230, height - 200) for k in range(count)]


def spectra(
    powers: Mapping[str, NDArray], captions: Mapping[str, str], decades: tuple[float, float] = DECADES
) -> Row:
    """Return the row of spectra between powers of ten, frequency 0 in the middle."""
    images = {
        name: np.log10(np.fft.fftshift(power) + 10 ** (decades[0] - 1)) for name, power in powers.items()
    }
    ticks = {float(power): f"{10.0**power:g}" for power in np.arange(decades[0], decades[1] + 1)}
    return Row(images, decades, Shades("white noise: 1", ticks), captions)

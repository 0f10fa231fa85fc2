"""Sheets of the errors of all screen-space methods: pictures, and radial spectra."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from figures import plot

DPI = 150
CROP = 64
"""Pixels that are shown of the images, a side."""
ZOOM = 2

PANEL, GAP, CAPTION, LABEL, TOP = ZOOM * CROP, 12, 22, 190, 76
"""Pixels: a picture, between pictures, the numbers above one, a method's name, and above all."""

LONG = 14
"""Letters of a name that are too many for one line."""

Measures = Mapping[str, Mapping[str, float]]


def pictures(
    title: str,
    columns: Sequence[Sequence[str]],
    errors: Mapping[str, NDArray],
    measured: Mapping[str, Measures],
    key: str,
) -> Figure:
    """Draw rows of methods in columns; below the shorter one, what is shown.

    ``errors`` are of shape (side, side, integrands), by method, as ``measured``, whose order they have.
    """
    integrands = list(next(iter(measured.values())))
    block = LABEL + len(integrands) * (PANEL + GAP)
    rows = max(map(len, columns))
    width, height = len(columns) * block + 2 * GAP, TOP + rows * (PANEL + CAPTION + 4)
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    figure.suptitle(title, y=1 - 14 / height, fontsize=10)
    for column, names in enumerate(columns):
        for k, integrand in enumerate(integrands):
            x = column * block + LABEL + k * (PANEL + GAP) + PANEL / 2
            figure.text(x / width, 1 - (TOP - 2) / height, integrand, ha="center", va="bottom", fontsize=9)
        for row, name in enumerate(names):
            bottom = height - TOP - (row + 1) * (PANEL + CAPTION + 4) + 4
            _name(figure, name, column * block + GAP, bottom + PANEL // 2)
            for k, integrand in enumerate(integrands):
                _picture(
                    figure,
                    errors[name][:CROP, :CROP, k],
                    measured[name][integrand],
                    column * block + LABEL + k * (PANEL + GAP),
                    bottom,
                )
    shorter = min(range(len(columns)), key=lambda column: len(columns[column]))
    below = height - TOP - len(columns[shorter]) * (PANEL + CAPTION + 4)
    figure.text(
        (shorter * block + GAP) / width, (below - 24) / height, key, va="top", fontsize=9, linespacing=1.5
    )
    return figure


def _name(figure: Figure, name: str, left: int, middle: int) -> None:
    """Write a method's name below the mark that it has in all plots."""
    width, height = figure.get_size_inches() * figure.dpi
    drawn = plot.style(name)
    figure.add_artist(
        Line2D(
            [left / width, (left + 28) / width, (left + 56) / width],
            [(middle + 16) / height] * 3,
            color=drawn.color,
            ls=drawn.line,
            marker=drawn.marker,
            markevery=[1],
            ms=6,
            lw=1.2,
        )
    )
    figure.text(
        left / width,
        (middle - 2) / height,
        name.replace(", ", ",\n") if len(name) > LONG else name,
        va="top",
        fontsize=9,
    )


def _picture(figure: Figure, error: NDArray, measures: Mapping[str, float], left: int, bottom: int) -> None:
    """Draw errors up to three of their own root mean squares: what is compared is their pattern."""
    scale = 3 * measures["RMS error"]
    axes = plot.place(figure, error, left, bottom, ZOOM, limits=(-scale, scale))
    rms = measures["RMS error"]
    numbers = f"{rms:{'.2g' if rms >= 1e-4 else '.0e'}} | {measures['low-frequency power']:.2f}"
    axes.set_title(numbers, fontsize=8, pad=2)


def spectra(
    powers: Mapping[int, Mapping[str, tuple[NDArray, NDArray]]], families: Mapping[str, Sequence[str]]
) -> Figure:
    """Draw radial spectra: a row for each number of samples, a column for each family.

    ``powers`` has frequencies and powers, by samples and method.
    """
    figure = Figure(figsize=(3 * len(families), 2.4 * len(powers) + 1.6), layout="constrained")
    figure.suptitle("Radial spectra of the errors of all screen-space methods, mean of four integrands")
    panels = figure.subplots(len(powers), len(families), sharex=True, sharey=True, squeeze=False)
    for row, (spp, of) in zip(panels, powers.items(), strict=True):
        for axes, names in zip(row, families.values(), strict=True):
            axes.axhline(1, color="0.6", lw=0.8, zorder=0)
            for k, name in enumerate(names):
                drawn = plot.style(name)
                look = {"color": drawn.color, "marker": drawn.marker, "ms": 5, "lw": 1.2, "label": name}
                axes.plot(*of[name], drawn.line, markevery=(k, len(names)), **look)
            axes.grid(alpha=0.3)
        row[0].set_ylabel(f"{spp} spp\npower (white noise: 1)")
    panels[0, 0].set(yscale="log", ylim=(0.01, 20), xlim=(0, 0.5))
    for axes, family in zip(panels[0], families, strict=True):
        axes.set_title(family)
    for axes in panels[-1]:
        axes.set_xlabel("cycles per pixel")
        axes.legend(loc="upper left", bbox_to_anchor=(0, -0.25), frameon=False, handlelength=3)
    return figure

"""Titles of figures, and what panels show: lines, axes with names, ticks and legends, tables of text."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.ticker import LogLocator, NullLocator

from figures._rc import LETTERS, PAGE, TITLE
from figures.plot import Style

LETTER = 0.56
"""Mean width of a letter, in parts of its size."""


def new_figure(title: str, height: float, width: float = PAGE) -> Figure:
    """Return a figure of a height in inches, as wide as a page, whose panels find their own places."""
    figure = Figure(figsize=(width, height), layout="constrained")
    write_title(figure, title)
    return figure


def write_title(figure: Figure, title: str, **place: float) -> None:
    """Write what a figure says, and the lines after it, such as where it is from, in small letters below."""
    message, details = fold_title(title, figure.get_figwidth())
    lines = details.count("\n") + bool(details)
    head = figure.suptitle(message + "\n" * lines, fontsize=TITLE, weight="bold", **place)
    look: dict[str, Any] = {"xycoords": head, "ha": "center", "va": "bottom", "fontsize": LETTERS}
    figure.add_artist(Annotation(details, (0.5, 0), **look))


def fold_title(title: str, inches: float) -> tuple[str, str]:
    """Return the first line of a title and the others, folded to a width."""
    message, _, details = title.partition("\n")
    small = "\n".join(_fold(line, inches, LETTERS) for line in details.splitlines())
    return _fold(message, inches, 1.1 * TITLE), small


def _fold(line: str, inches: float, size: float) -> str:
    return textwrap.fill(line, int(72 * inches / (LETTER * size)), break_on_hyphens=False)


def curve(axes: Axes, of: Mapping[Any, float], drawn: Style, **look: Any) -> None:
    """Draw numbers over their counts, which may be texts."""
    look = {"ms": 4, "lw": 1, "ls": drawn.line} | look
    axes.plot([float(n) for n in of], list(of.values()), marker=drawn.marker, color=drawn.color, **look)


def curves(
    axes: Axes, of: Mapping[str, Mapping[Any, float]], drawn: Mapping[str, Style], **look: Any
) -> None:
    """Draw numbers by name, with the names as labels."""
    for name, values in of.items():
        curve(axes, values, drawn[name], label=name, **look)


def name_axes(
    axes: Axes,
    x: str = "",
    y: str = "",
    title: str = "",
    *,
    log: str = "",
    ticks: Sequence[float] | Mapping[float, str] = (),
    few_decades: bool = False,
    legend: str = "",
    **of_legend: Any,
) -> None:
    """Write the names of axes, draw a light grid, and a legend at a place if one is given.

    ``log``: which axes are logarithmic, "x", "y" or "xy". ``ticks``: of the horizontal axis.
    ``few_decades``: the vertical axis has 1, 2, 5, 10, ... in place of powers of ten.
    """
    for name in log:
        axes.set(**{f"{name}scale": "log"})
    axes.set(xlabel=x, ylabel=y)
    if title:
        axes.set_title(title)
    if len(ticks):
        texts = list(ticks.values()) if isinstance(ticks, Mapping) else [f"{tick:g}" for tick in ticks]
        axes.set_xticks(list(ticks), texts)
        axes.xaxis.set_minor_locator(NullLocator())
    if few_decades:
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=10))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_locator(NullLocator())
    axes.grid(alpha=0.3)
    if legend:
        axes.legend(**{"loc": legend, "frameon": False} | of_legend)


def legend_below(figure: Figure, panel: Axes, columns: int = 4, **look: Any) -> None:
    """Name below all panels what one of them shows."""
    handles = panel.get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=columns, frameon=False, **look)


def text_table(
    axes: Axes,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    groups: Sequence[tuple[str, int, int]] = (),
    widths: Sequence[float] | None = None,
) -> None:
    """Write rows of cells below the heads of their columns, flush right.

    ``groups`` are titles over columns from one to another, ``widths`` relative.
    """
    wide = widths or [1.0] * len(heads)
    ends = [sum(wide[: k + 1]) for k in range(len(wide))]
    for k, (end, head) in enumerate(zip(ends, heads, strict=True)):
        axes.text(end, -0.5, head, ha="right", va="center", weight="bold")
        for row, cells in enumerate(rows, start=1):
            axes.text(end, -row - 0.6, cells[k], ha="right", va="center")
    for title, first, last in groups:
        left, right = ends[first] - 0.9 * wide[first], ends[last]
        axes.text((left + right) / 2, 0.55, title, ha="center", va="center")
        axes.plot([left, right], [0.1, 0.1], color="black", lw=0.6)
    bottom = -len(rows) - 1.2
    for y, width in ((1.1 if groups else 0.1, 1.2), (-1.05, 0.6), (bottom, 1.2)):
        axes.plot([0, ends[-1]], [y, y], color="black", lw=width)
    axes.set(xlim=(0, ends[-1]), ylim=(bottom - 0.1, 1.2))
    axes.set_axis_off()

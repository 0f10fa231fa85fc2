"""Errors over run times: their lines, which are best, and the time that an error takes."""

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from figures.plot import Style, style
from figures.shared.sheets.curves import name_axes

ADAPTIVE = ", adaptive"
"""What the names of programs and samplers end with that skip constant pixels."""

Rows = list[dict]
"""Each has ``spp``, ``seconds``, ``rms error`` and the name of what was measured."""


def lines(axes: Axes, rows: Rows, by: str, styles: Mapping[str, Style] | None = None) -> None:
    """Draw a line for each name, with quartiles of times if rows have them; by default in samplers' styles.

    What is adaptive is drawn as what it is made of, dashed and with empty marks.
    """
    names = dict.fromkeys(row[by] for row in rows)
    for name in names:
        chosen = [row for row in rows if row[by] == name]
        seconds = np.array([row["seconds"] for row in chosen])
        errors = [row["rms error"] for row in chosen]
        spread = None
        if "seconds, lower quartile" in chosen[0]:
            edges = np.array([[row[f"seconds, {q} quartile"] for row in chosen] for q in ("lower", "upper")])
            spread = np.abs(edges - seconds)
        plain = name.removesuffix(ADAPTIVE)
        drawn = styles[plain] if styles else style(plain, names)
        look: dict[str, Any] = {"ls": drawn.line} if plain == name else {"ls": "--", "mfc": "white"}
        look |= {"color": drawn.color, "marker": drawn.marker, "label": name}
        axes.errorbar(seconds, errors, xerr=spread, ms=4, lw=1, **look)
    name_axes(axes, "seconds per image", "RMS error", log="xy")
    # Those of a decade would overlap.
    axes.xaxis.set_minor_formatter(NullFormatter())


def counted(rows: Rows) -> str:
    """Return in words which numbers of samples rows have."""
    counts = sorted({row["spp"] for row in rows})
    return f"{counts[0]} spp" if len(counts) == 1 else f"{counts[0]} to {counts[-1]} spp"


def legend(
    figure: Figure, panels: Iterable[Axes], height: Literal["upper", "center", "lower"], title: str
) -> None:
    """Name on the right of all panels what they show, at this height."""
    loc: Any = f"outside right {height}"  # matplotlib's types know the sides inside only
    named = {
        name: line for axes in panels for line, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(named.values(), named.keys(), loc=loc, title=title, frameon=False)


def best(rows: Rows, by: str) -> Rows:
    """Return the Pareto front: rows of less error than all that took no longer."""
    front: Rows = []
    for row in sorted(rows, key=lambda row: row["seconds"]):
        if not front or row["rms error"] < front[-1]["rms error"]:
            front.append({key: row[key] for key in (by, "spp", "seconds", "rms error")})
    return front


def time_for(rows: Rows, error: float) -> float:
    """Return the time that an error takes on one line, interpolated in logarithms, or prolonged."""
    if len(rows) == 1:
        return rows[0]["seconds"]
    errors = np.log([row["rms error"] for row in rows])
    seconds = np.log([row["seconds"] for row in rows])
    k = int(np.clip(np.searchsorted(-errors, -np.log(error)), 1, len(rows) - 1))
    part = (np.log(error) - errors[k - 1]) / (errors[k] - errors[k - 1])
    return float(np.exp(seconds[k - 1] + part * (seconds[k] - seconds[k - 1])))

"""Errors over run times: their lines, which are best, and the time that an error takes."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

Rows = list[dict]
"""Each has ``spp``, ``seconds``, ``rms error`` and the name of what was measured."""


def lines(axes: Axes, rows: Rows, by: str, styles: Mapping[str, tuple[str, str]] | None = None) -> None:
    """Draw a line for each name, with quartiles of times if rows have them; styles: colour and line."""
    for k, name in enumerate(dict.fromkeys(row[by] for row in rows)):
        chosen = [row for row in rows if row[by] == name]
        seconds = np.array([row["seconds"] for row in chosen])
        errors = [row["rms error"] for row in chosen]
        spread = None
        if "seconds, lower quartile" in chosen[0]:
            edges = np.array([[row[f"seconds, {q} quartile"] for row in chosen] for q in ("lower", "upper")])
            spread = np.abs(edges - seconds)
        color, style = styles[name] if styles else (f"C{k % 10}", "--" if "adaptive" in name else "-")
        axes.errorbar(seconds, errors, xerr=spread, fmt=f"o{style}", ms=3, lw=1, color=color, label=name)
    axes.set(xscale="log", yscale="log", xlabel="seconds an image", ylabel="RMS error")
    axes.grid(alpha=0.3)


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

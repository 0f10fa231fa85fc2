"""Which sampler has the least error: by kind of scene, dimensions, samples per pixel, and with a filter."""

from collections.abc import Callable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import qmcjax as qj
from figures import plot
from qmcjax.choosing import LEVELS, MEASURES, SIZES, SPPS, Measured

KINDS = {"edges": False, "smooth": True}

PALE = 0.45
"""How much of a sampler's colour there is in its cells: they are written on in black."""

NOTE = (
    "From the table of qmcjax.recommend, whatever the quality: geometric means over {scenes} scenes of "
    "this package with exact pixel means, {fewest} to {most} in a cell, {sizes} pixels, 8 keys, "
    "{samplers} samplers. Filtered: after a Gaussian of 1.5 pixels. The margin is how many times the "
    "error of the best the next sampler has that is certainly worse, by 2 % at both sizes, in Student's "
    "intervals over scenes for all pairs of samplers of a cell together (Holm, 5 %). Hatched cells: others "
    "are not certainly worse; the number says how "
    "many, and the picture which is least among them. {hatched} of {cells} cells are hatched. {often}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the map of recommendations."""
    del quality
    table: list[dict[str, Any]] = []
    for filtered, measure in enumerate(MEASURES):
        for kind, smooth in KINDS.items():
            for level in LEVELS:
                table += [_cell(kind, smooth, level, spp, bool(filtered), measure) for spp in SPPS]
        progress((filtered + 1) / len(MEASURES))
    return _draw(table), {
        "table": table,
        "measured": {
            "least error in cells": _counts([row for row in table if row["margin"] is not None], "sampler"),
            "cells where none differs": sum(row["margin"] is None for row in table),
        },
        "note": _note(table),
    }


def _cell(kind: str, smooth: bool, level: int, spp: int, filtered: bool, measure: str) -> dict[str, Any]:
    choice = qj.recommend(level, spp, smooth, filtered=filtered)
    margin, usual = choice.margin, choice.others.get("(0,2), Owen")
    scenes = Measured.of(not smooth, level, spp, filtered).scenes
    return {
        "measure": measure,
        "scenes": kind,
        "dimensions": LEVELS[level],
        "spp": spp,
        "sampler": choice.name,
        "no certain difference to": ", ".join(choice.alternatives),
        "alike": len(choice.alternatives),
        "margin": margin and margin.ratio,
        "margin, low": margin and margin.low,
        "margin, high": margin and margin.high,
        "Owen in each pixel": usual and usual.ratio,
        "number of scenes": len(scenes),
        "samplers": 1 + len(choice.others),
    }


def _counts(table: list[dict[str, Any]], column: str) -> dict[str, int]:
    """Return how often each value is in a column, the most frequent first."""
    values = [row[column] for row in table]
    return dict(sorted(((v, values.count(v)) for v in dict.fromkeys(values)), key=lambda item: -item[1]))


def _note(table: list[dict[str, Any]]) -> str:
    first = [row for row in table if row["measure"] == MEASURES[0] and row["spp"] == SPPS[0]]
    often = {
        measure: next(iter(_counts([row for row in table if row["measure"] == measure], "sampler").items()))
        for measure in MEASURES
    }
    each = len(table) // len(MEASURES)
    return NOTE.format(
        scenes=sum(row["number of scenes"] for row in first),
        fewest=min(row["number of scenes"] for row in first),
        most=max(row["number of scenes"] for row in first),
        sizes=" and ".join(f"{width} x {height}" for width, height in SIZES),
        samplers=max(row["samplers"] for row in table),
        hatched=sum(row["alike"] > 0 for row in table),
        cells=len(table),
        often="Most often least: "
        + "; ".join(f"{m}, {name} ({count} of {each} cells)" for m, (name, count) in often.items())
        + ".",
    )


def _draw(table: list[dict[str, Any]]) -> Figure:
    figure = Figure(figsize=(13.0, 5.6), layout="constrained")
    figure.suptitle(
        "The sampler of the least error, and how many times its error the next certainly worse one has",
        fontsize=11,
    )
    for axes, measure in zip(figure.subplots(1, len(MEASURES), sharey=True), MEASURES, strict=True):
        _panel(axes, measure, [row for row in table if row["measure"] == measure])
    return figure


def _panel(axes: Axes, measure: str, rows: list[dict[str, Any]]) -> None:
    """Draw one map: a row of cells for each kind and level, a column for each number of samples."""
    places = list(dict.fromkeys((row["scenes"], row["dimensions"]) for row in rows))
    for row in rows:
        x, y = SPPS.index(row["spp"]), places.index((row["scenes"], row["dimensions"]))
        alike, one_differs = row["alike"] > 0, row["margin"] is not None
        # Where none differs, the least is anybody's.
        color = plot.style(row["sampler"]).color if one_differs else "white"
        fill = [PALE * c + 1 - PALE for c in to_rgb(color)]
        edge = "white" if one_differs else "0.85"
        axes.add_patch(Rectangle((x, y), 1, 1, fc=fill, ec=edge, hatch="///" if alike else None, lw=1.5))
        name = row["sampler"].replace(", ", ",\n", 1) if len(row["sampler"]) > 14 else row["sampler"]
        like = f"\nand {row['alike']} others" if row["alike"] > 1 else "\nand 1 other" if alike else ""
        text = f"{name}{like}\n{row['margin']:.2f} ×" if one_differs else "no certain difference"
        axes.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=8, linespacing=1.15)
    axes.set(
        title=measure,
        xlim=(0, len(SPPS)),
        ylim=(len(places), 0),
        xlabel="samples per pixel",
        xticks=[k + 0.5 for k in range(len(SPPS))],
        yticks=[k + 0.5 for k in range(len(places))],
    )
    axes.set_xticklabels([str(spp) for spp in SPPS])
    axes.set_yticklabels([f"{kind},\n{dims}" for kind, dims in places])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)

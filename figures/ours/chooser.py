"""Which sampler has the least error: by use, kind of scene, dimensions, samples per pixel, with a filter."""

from collections.abc import Callable
from itertools import product
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import qmcjax as qj
from figures import plot
from qmcjax.choosing import LEVELS, MEASURES, SETTINGS, Measured

KINDS = {"edges": False, "smooth": True}

USES: dict[str, dict[str, Any]] = {
    "images": {},
    "prefixes": {"progressive": True},
    "frames": {"frames": 32},
}
"""Arguments of recommend, by setting."""

TITLES = {
    "images": "final images",
    "prefixes": "images shown while they are rendered: mean over 1, 2, 4, ... samples",
    "frames": "animations: moving average over 32 frames",
}

PALE = 0.45
"""How much of a sampler's colour there is in its cells: they are written on in black."""

NOTE = (
    "From the tables of qmcjax.recommend, whatever the quality: geometric means over {scenes} scenes of "
    "this package with exact pixel means, {fewest} to {most} in a cell; {uses}. "
    "Filtered: after a Gaussian of 1.5 pixels. The margin is how many times the "
    "error of the best the next sampler has that is certainly worse, by 2 % at both sizes, in Student's "
    "intervals over scenes for all pairs of samplers of a cell together (Holm, 5 %). Hatched cells: others "
    "are not certainly worse; the number says how "
    "many, and the picture which is least among them. {hatched} of {cells} cells are hatched. {often}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the map of recommendations."""
    del quality
    table: list[dict[str, Any]] = []
    for k, (use, filtered) in enumerate(product(USES, (False, True))):
        for (kind, smooth), level in product(KINDS.items(), LEVELS):
            table += [_cell(use, kind, smooth, level, spp, filtered) for spp in SETTINGS[use].spps]
        progress((k + 1) / len(USES) / len(MEASURES))
    certain = [row for row in table if row["margin"] is not None]
    return _draw(table), {
        "table": table,
        "measured": {
            "least error in cells": {
                use: _counts([row for row in certain if row["use"] == use], "sampler") for use in USES
            },
            "cells where none differs": len(table) - len(certain),
        },
        "note": _note(table),
    }


def _cell(use: str, kind: str, smooth: bool, level: int, spp: int, filtered: bool) -> dict[str, Any]:
    choice = qj.recommend(level, spp, smooth, filtered=filtered, **USES[use])
    margin, usual = choice.margin, choice.others.get(SETTINGS[use].usual)
    scenes = Measured.of(not smooth, level, spp, filtered, SETTINGS[use]).scenes
    return {
        "use": use,
        "measure": MEASURES[filtered],
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
    images = [row for row in table if row["use"] == "images"]
    first = [row for row in images if row["measure"] == MEASURES[0] and row["spp"] == images[0]["spp"]]
    often = {
        measure: next(iter(_counts([row for row in images if row["measure"] == measure], "sampler").items()))
        for measure in MEASURES
    }
    uses = [
        f"{TITLES[use].partition(':')[0]}, "
        + " and ".join("{} x {}".format(*size) for size in of.sizes)
        + f" pixels, {of.keys} keys, {len(of.candidates)} samplers"
        for use, of in ((use, SETTINGS[use]) for use in USES)
    ]
    return NOTE.format(
        scenes=sum(row["number of scenes"] for row in first),
        fewest=min(row["number of scenes"] for row in first),
        most=max(row["number of scenes"] for row in first),
        uses="; ".join(uses),
        hatched=sum(row["alike"] > 0 for row in table),
        cells=len(table),
        often="Most often least in final images: "
        + "; ".join(
            f"{m}, {name} ({count} of {len(images) // len(MEASURES)} cells)"
            for m, (name, count) in often.items()
        )
        + ".",
    )


def _draw(table: list[dict[str, Any]]) -> Figure:
    figure = Figure(figsize=(13.0, 15.5), layout="constrained")
    certain = sum(row["margin"] is not None for row in table)
    figure.suptitle(
        f"In {certain} of {len(table)} cases some samplers are certainly worse than the best: which is "
        "the best, "
        "and how many times\nas large the error of the first certainly worse one is (hatched: others are "
        "as good)",
        fontsize=11,
    )
    panels = figure.subplots(len(USES), len(MEASURES), sharey=True)
    for use, of_use in zip(USES, panels, strict=True):
        for axes, measure in zip(of_use, MEASURES, strict=True):
            rows = [row for row in table if (row["use"], row["measure"]) == (use, measure)]
            _panel(axes, f"{TITLES[use]}\n{measure}", rows, SETTINGS[use].spps)
    return figure


def _panel(axes: Axes, title: str, rows: list[dict[str, Any]], spps: tuple[int, ...]) -> None:
    """Draw one map: a row of cells for each kind and level, a column for each number of samples."""
    places = list(dict.fromkeys((row["scenes"], row["dimensions"]) for row in rows))
    for row in rows:
        x, y = spps.index(row["spp"]), places.index((row["scenes"], row["dimensions"]))
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
        title=title,
        xlim=(0, len(spps)),
        ylim=(len(places), 0),
        xlabel="samples per pixel",
        xticks=[k + 0.5 for k in range(len(spps))],
        yticks=[k + 0.5 for k in range(len(places))],
    )
    axes.set_xticklabels([str(spp) for spp in spps])
    axes.set_yticklabels([f"{kind},\n{dims}" for kind, dims in places])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)

"""The picture of a comparison: errors over those of random samples."""

import io
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plot
from figures._rc import PAGE
from figures.compare.scores import BASE, NAMES, Ratios, Score, class_means, families
from figures.shared.rivals import RIVALS

DRAWN = ("rms", "filtered")
"""Measures, a panel each, beside those that were asked for."""

MOST, LETTERS = 2, 42
"""Names of entries that a title has, and letters of its lines, which are no wider than a panel."""

NONE = Score(np.nan, np.nan, np.nan)

Curves = dict[str, dict[int, Score]]
"""By entry and number of samples; of an entry without a measure, none."""


def curves(
    ratios: Mapping[str, Ratios], spps: Sequence[int], further: Sequence[str] = ()
) -> dict[str, dict[str, Curves]]:
    """Return the scores of each number of samples, by family of tasks and by measure."""
    by_place: dict[str, dict[str, Curves]] = {}
    for spp in spps:
        at = {
            name: {key: ratio for key, ratio in of.items() if key[0].spp == key[0].samples == spp}
            for name, of in ratios.items()
        }
        classes = {name: class_means(of, [spp]) for name, of in at.items()}
        for name in [name for name in at if name != BASE]:
            for measure in (*DRAWN, *further):
                for place, score in families(classes[name], classes[BASE], measure).items():
                    of_place = by_place.setdefault(place, {each: {} for each in DRAWN})
                    of_place.setdefault(measure, {}).setdefault(name, {})[spp] = score
    return by_place


def errors(of: Mapping[str, Mapping[str, Curves]], names: Iterable[str], spps: Sequence[int]) -> bytes:
    """Draw curves as SVG, a row for each family and a panel for each measure; ``names``: of all entries."""
    labels = [_label(name) for name in names]
    look: dict[Any, Any] = {"svg.hashsalt": "compare", "svg.fonttype": "none", "font.family": "sans-serif"}
    with plot.rc(), mpl.rc_context(look):
        panels = max([len(DRAWN), *map(len, of.values())])
        size = (PAGE * panels / len(DRAWN), 3.2 * max(1, len(of)))
        figure = Figure(figsize=size, layout="constrained")
        rows = figure.subplots(max(1, len(of)), panels, squeeze=False)
        for row, (place, by_measure) in zip(rows, of.items(), strict=False):
            for axes in row[len(by_measure) :]:
                axes.set_axis_off()
            for axes, (measure, by_entry) in zip(row, by_measure.items(), strict=False):
                _panel(axes, title(f"{place}, {NAMES[measure]}", by_entry), by_entry, labels, spps)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
        return buffer.getvalue()


def _panel(axes: Axes, title: str, by_entry: Curves, labels: list[str], spps: Sequence[int]) -> None:
    means, bands = {}, {}
    for name, scores in by_entry.items():
        table = np.array([scores.get(spp, NONE) for spp in spps])
        table[table[:, 0] == 0] = np.nan
        if not np.isnan(table).all():
            means[_label(name)], bands[_label(name)] = table[:, 0], table[:, 1:].T
    if means:
        there = ~np.isnan(list(means.values())).all(axis=0)
        means = {name: values[there] for name, values in means.items()}
        bands = {name: ends[:, there] for name, ends in bands.items()}
        bands = {name: ends for name, ends in bands.items() if np.isfinite(ends).all() and ends.all()}
        look = {"slopes": (), "ylabel": "error / error of random samples", "among": labels}
        plot.convergence(np.array(spps)[there].tolist(), means, bands=bands, title=title, ax=axes, **look)
        axes.axhline(1, color="black", lw=0.8, zorder=1)


def _label(name: str) -> str:
    return RIVALS[name].name if name in RIVALS else name


def title(about: str, of: Curves) -> str:
    """Return which entries have the least error with the most samples.

    Entries whose intervals overlap with that of the least are not told apart: all are named, up to a number.
    """
    spp = max((spp for by_spp in of.values() for spp in by_spp), default=0)
    at = {name: by_spp[spp] for name, by_spp in of.items() if spp in by_spp}
    if not at:
        return about
    ordered = sorted(at, key=lambda name: at[name].middle)
    best = at[ordered[0]]
    alike = [name for name in ordered if at[name].low <= best.high]
    more = f" and {len(alike) - MOST} more" if len(alike) > MOST else ""
    lines = f"{about}, {spp} samples", f"least with {', '.join(alike[:MOST])}{more} ({best.middle:.2g})"
    return "\n".join(textwrap.fill(line, LETTERS) for line in lines)

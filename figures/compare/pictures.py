"""Pictures of the page: errors over those of random samples, and spectra of errors."""

import io
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from analysis import ComparisonRow
from figures import plot
from figures._rc import PAGE
from figures.compare.scores import BASE, MEASURES, Ratios, Score, class_means, families
from figures.compare.tasks import SCENE_CLASSES
from figures.shared.rivals import RIVALS
from figures.shared.sheets.panels import legend_below

DRAWN = ("rms", "filtered")
"""Measures, a panel each."""

MOST, LETTERS = 2, 42
"""Names of entries that a title has, and letters of its lines, which are no wider than a panel."""

NONE = Score(np.nan, np.nan, np.nan)

DPI = 200
"""Of spectra."""

Curves = dict[str, dict[int, Score]]
"""By entry and number of samples; of an entry without a measure, none."""


def curves(ratios: Mapping[str, Ratios], spps: Sequence[int]) -> dict[str, dict[str, Curves]]:
    """Return the scores of each number of samples, by family of tasks or scene, and by measure."""
    by_place: dict[str, dict[str, Curves]] = {}
    for spp in spps:
        at = {
            name: {key: ratio for key, ratio in of.items() if key[0].spp == key[0].samples == spp}
            for name, of in ratios.items()
        }
        classes = {name: class_means(of, [spp]) for name, of in at.items()}
        for name in [name for name in at if name != BASE]:
            for measure in DRAWN:
                scores = families(classes[name], classes[BASE], measure)
                for (task, of_task), ratio in at[name].items():
                    if of_task == measure and task.of in SCENE_CLASSES:
                        scores[task.name] = Score.of(ratio)
                for place, score in scores.items():
                    of_place = by_place.setdefault(place, {each: {} for each in DRAWN})
                    of_place[measure].setdefault(name, {})[spp] = score
    return by_place


def errors(place: str, of: Mapping[str, Curves], names: Iterable[str], spps: Sequence[int]) -> bytes:
    """Draw the curves of a family or scene as SVG, a panel for each measure; ``names``: of all entries."""
    labels = [_label(name) for name in names]
    look: dict[Any, Any] = {"svg.hashsalt": place, "svg.fonttype": "none", "font.family": "sans-serif"}
    with plot.rc(), mpl.rc_context(look):
        figure = Figure(figsize=(PAGE, 3.2), layout="constrained")
        for axes, (measure, by_entry) in zip(figure.subplots(1, len(of)), of.items(), strict=True):
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
                about = title(f"{place}, {MEASURES[measure]}", by_entry)
                plot.convergence(
                    np.array(spps)[there].tolist(), means, bands=bands, title=about, ax=axes, **look
                )
                axes.axhline(1, color="black", lw=0.8, zorder=1)
        return _file(figure, format="svg", metadata={"Date": None})


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


def spectra(scene: str, rows: Sequence[ComparisonRow], names: Iterable[str]) -> bytes:
    """Draw the radial power of the errors of a scene as PNG, at the least and the most samples."""
    counts, labels = sorted({row.spp for row in rows}), [_label(name) for name in names]
    counts = counts[:: max(1, len(counts) - 1)]
    with plot.rc():
        figure = Figure(figsize=(PAGE, 2.6 + 0.16 * -(-len(labels) // 4)), layout="constrained")
        panels = figure.subplots(1, len(counts), squeeze=False)[0]
        for axes, spp in zip(panels, counts, strict=True):
            of = [row for row in rows if row.spp == spp]
            for k, row in enumerate(of):
                look, label = plot.style(_label(row.sampler), labels), _label(row.sampler)
                marks: Any = {"marker": look.marker, "ms": 4, "markevery": (0.1 * k / len(of), 0.1)}
                axes.plot(row.frequency, row.power, look.line, color=look.color, lw=1.2, label=label, **marks)
            axes.axhline(1, color="0.6", lw=0.8, zorder=0)
            label = "power of the error (white noise: 1)"
            axes.set(xlim=(0, 0.5), ylim=(0, None), xlabel="cycles per pixel", ylabel=label)
            axes.set_title(f"{scene}, {spp} samples per pixel")
        legend_below(figure, panels[0])
        return _file(figure, format="png", dpi=DPI, metadata={"Software": None})


def _file(figure: Figure, **how: Any) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, **how)
    return buffer.getvalue()

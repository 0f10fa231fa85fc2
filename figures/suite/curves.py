"""Pictures of the page: errors over those of random samples, against samples per pixel."""

import io
import math
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

from figures.plot import Style, rc, style
from figures.shared.rivals import RIVALS
from figures.shared.sheets.panels import curve
from figures.suite.entries import Entry
from figures.suite.results import BASE, Measured, Score, by_samples, families

MEASURES = {"rms": "RMS error", "filtered": "filtered error"}

THEIRS = (
    "#8C564B",
    "#E377C2",
    "#7F7F7F",
    "#BCBD22",
    "#17BECF",
    "#1F3A93",
    "#F58231",
    "#2E8B57",
    "#9A6324",
    "#808000",
    "#911EB4",
    "#469990",
)
"""Colours of other projects' entries: none is one of ours."""

MARKERS = "ov^sD<>pPXdh"

LINES = ("--", ":", "-.")
"""Of other projects, a kind for each; thin, and without fill below marks."""

FEW = 30.0
"""Up to this ratio of the ends of an axis, powers of ten are too few ticks."""

MOST = 2
"""Names of entries that a title has."""


def drawn(found: Mapping[str, Measured], entries: Mapping[str, Entry], spps: Sequence[int]) -> dict[str, str]:
    """Return a picture for each family of tasks as SVG, by the family; a panel for each measure."""
    of = by_samples(found, spps)
    scores = {
        measure: {
            name: {spp: families(at, measure) for spp, at in by_spp.items()}
            for name, by_spp in of.items()
            if name != BASE
        }
        for measure in MEASURES
    }
    named = dict.fromkeys(
        family
        for of_measure in scores.values()
        for by_spp in of_measure.values()
        for at in by_spp.values()
        for family in at
    )
    made = {}
    for family in named:
        curves = {
            measure: {
                name: {spp: at[family] for spp, at in by_spp.items() if family in at}
                for name, by_spp in of_measure.items()
            }
            for measure, of_measure in scores.items()
        }
        made[family] = _picture(family, curves, entries, spps)
    return made


Curves = Mapping[str, Mapping[int, Score]]
"""By entry and number of samples; of an entry without a measure, none."""


def _picture(
    family: str, curves: Mapping[str, Curves], entries: Mapping[str, Entry], spps: Sequence[int]
) -> str:
    styles = _styles(entries)
    with rc(), plt.rc_context({"svg.hashsalt": family, "svg.fonttype": "none", "font.family": "sans-serif"}):
        rows = math.ceil(len(styles) / 4)
        figure, axes = plt.subplots(1, len(curves), figsize=(10.5, 4.3 + 0.2 * rows), layout="constrained")
        try:
            for panel, (measure, of) in zip(axes, curves.items(), strict=True):
                _panel(panel, of, entries, styles, spps)
                panel.set_title(title(f"{family}, {MEASURES[measure]}", of, entries))
            axes[0].set_ylabel("error / error of random samples")
            handles = {h.get_label(): h for panel in axes for h in panel.get_legend_handles_labels()[0]}
            named = [name for name in styles if name in handles]
            shown, look = [handles[name] for name in named], {"frameon": False, "handlelength": 4}
            figure.legend(shown, named, loc="outside lower center", ncols=4, **look)
            buffer = io.StringIO()
            figure.savefig(buffer, format="svg", metadata={"Date": None})
        finally:
            plt.close(figure)
    return buffer.getvalue()


def _panel(
    axes: Axes,
    of: Curves,
    entries: Mapping[str, Entry],
    styles: Mapping[str, Style],
    spps: Sequence[int],
) -> None:
    """Draw a curve for each entry: ours and yours thick, with bands; other projects' thin, with bars."""
    for name, by_spp in of.items():
        known = {spp: score for spp, score in by_spp.items() if 0 < score.middle}
        if not known:
            continue
        x = np.array(list(known))
        middle, low, high = np.array(list(known.values())).T
        there = (low > 0) & np.isfinite(high)
        low, high = np.where(there, low, middle), np.where(there, high, middle)
        color, of_entry = styles[name].color, {spp: score.middle for spp, score in known.items()}
        if entries[name].project:
            look = {"ms": 4, "mfc": "white", "lw": 0.9, "zorder": 2}
            axes.vlines(x, low, high, color=color, lw=0.9, zorder=2)
        else:
            look = {"ms": 6, "lw": 2, "zorder": 3}
            axes.fill_between(x, low, high, color=color, alpha=0.15, lw=0)
        curve(axes, of_entry, styles[name], label=name, **look)
    axes.axhline(1, color="black", lw=0.8, zorder=1)
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_xticks(spps, [f"{spp}" for spp in spps])
    axes.xaxis.set_minor_locator(NullLocator())
    bottom, top = axes.get_ylim()
    if top < FEW * bottom:
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0, 7.0)))
        axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.3)
    axes.set_xlabel("samples per pixel")


def title(about: str, of: Curves, entries: Mapping[str, Entry]) -> str:
    """Return which entries have the least error with the most samples; and of other projects, or of ours.

    Entries whose intervals overlap with that of the least are not told apart: all are named, up to a number.
    """
    spp = max((spp for by_spp in of.values() for spp in by_spp), default=0)
    at = {name: by_spp[spp] for name, by_spp in of.items() if spp in by_spp}
    if not at:
        return about
    theirs = bool(entries[min(at, key=lambda name: at[name].middle)].project)
    others = {name: score for name, score in at.items() if bool(entries[name].project) != theirs}
    lines = [f"{about}, {spp} samples", f"least with {_least(at)}"]
    if others:
        lines.append(f"of {'qmcjax and yours' if theirs else 'other projects'}: {_least(others)}")
    return "\n".join(lines)


def _least(at: Mapping[str, Score]) -> str:
    ordered = sorted(at, key=lambda name: at[name].middle)
    best = at[ordered[0]]
    alike = [name for name in ordered if at[name].low <= best.high]
    more = f" and {len(alike) - MOST} more" if len(alike) > MOST else ""
    return f"{', '.join(alike[:MOST])}{more} ({best.middle:.2g})"


def _styles(entries: Mapping[str, Entry]) -> dict[str, Style]:
    """Return how entries are drawn, ours and yours first; other projects share no colour, each has a line."""
    plain = [name for name, entry in entries.items() if name != BASE and not entry.project]
    known = {name: RIVALS[name].name if name in RIVALS else name for name in plain}
    made = {name: style(known[name], known.values()) for name in plain}
    theirs = [name for name, entry in entries.items() if entry.project]
    projects = list(dict.fromkeys(entries[name].project for name in theirs))
    for place, name in enumerate(theirs):
        line = LINES[projects.index(entries[name].project) % len(LINES)]
        made[name] = Style(THEIRS[place % len(THEIRS)], MARKERS[place % len(MARKERS)], line)
    return made

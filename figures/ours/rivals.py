"""Samplers of other projects by their own code, beside ours: stored scores of the suite."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from figures import ledger
from figures._rc import BLACK, BLUE, VERMILLION

STORED = ledger.FILE.with_name("suite.json")
"""``scores.json`` of a run of ``python -m figures suite``."""

MEASURES = {"rms": ("RMS error", BLUE, "o"), "filtered": ("filtered error", VERMILLION, "D")}

OURS = "qmcjax"
"""Origins of ours begin so."""

NOTE = (
    "Stored scores of python -m figures suite ({run}; {processor}): samplers of other projects by their own "
    "code, which is not shipped. Errors over those of independent random samples, geometric means over "
    "classes, tasks and numbers of samples of equal weight, with Student's intervals of 95 % over keys; "
    "sequences without a place in an image have no scenes. Times were taken beside other programs. {origins}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw what is stored; no quality measures anew."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    entries = stored["entries"]
    progress(0.5)
    theirs = {name: of["origin"] for name, of in entries.items() if not of["origin"].startswith(OURS)}
    return _drawn(entries), {
        "measured": {
            name: {
                "origin": of["origin"],
                "seconds per million points": of["seconds per million points"],
                **{MEASURES[measure][0]: of["summary"][measure] for measure in MEASURES},
            }
            for name, of in entries.items()
        },
        "note": NOTE.format(
            run=stored["run"],
            processor=stored["machine"]["processor"],
            origins=" ".join(f"{name}: {origin}." for name, origin in theirs.items()),
        ),
    }


def _drawn(entries: dict[str, Any]) -> Figure:
    names = sorted(entries, key=lambda name: (not entries[name]["origin"].startswith(OURS), name))
    families = list(dict.fromkeys(f for of in entries.values() for f in of["summary"]["rms"]))
    figure = Figure(figsize=(2.5 * len(families) + 2, 0.3 * len(names) + 1.6), layout="constrained")
    figure.suptitle(_title(entries, families))
    panels = np.atleast_1d(figure.subplots(1, len(families), sharey=True))
    for axes, family in zip(panels, families, strict=True):
        for shift, (measure, (label, color, marker)) in zip((-0.15, 0.15), MEASURES.items(), strict=True):
            known = [
                (row + shift, *entries[name]["summary"][measure][family])
                for row, name in enumerate(names)
                if family in entries[name]["summary"][measure]
            ]
            rows, middle, low, high = np.array(known, float).T
            span = [middle - low, high - middle]
            axes.errorbar(middle, rows, xerr=span, color=color, marker=marker, ls="", ms=5, label=label)
        axes.axvline(1, color=BLACK, lw=0.8)
        axes.set(title=family, yticks=range(len(names)))
        axes.grid(axis="both", alpha=0.3)
    panels[0].set_yticklabels(names)
    panels[0].invert_yaxis()
    figure.supxlabel("error / error of random samples", fontsize="medium")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower right", ncols=2, frameon=False)
    return figure


def _title(entries: dict[str, Any], families: list[str]) -> str:
    """Return which entry has the least filtered error of each family."""
    least: dict[str, list[str]] = {}
    for family in families:
        scores = {name: of["summary"]["filtered"].get(family) for name, of in entries.items()}
        known = {name: score[0] for name, score in scores.items() if score is not None}
        if known:
            least.setdefault(min(known, key=lambda name: known[name]), []).append(family)
    best = "; ".join(f"{name} ({', '.join(of)})" for name, of in least.items())
    return f"Errors over those of random samples. Least filtered errors: {best}"

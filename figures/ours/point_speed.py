"""Coordinates a second that sequences make, against the programs that a user would take instead."""

import os
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures.making import own_process
from figures.plot import Style
from figures.shared import point_rates

SETTINGS = {"4 KiB pages": None, "large pages": "glibc.malloc.hugetlb=1"}
"""The memory that programs get from malloc: as it comes, and as GLIBC_TUNABLES asks for."""

ALIKE = 1.25
"""Ratio of rates that are about the same."""

STYLES = {
    "float32": Style("C0", "o"),
    "float64": Style("C5", "D"),
    "scipy": Style("C4", "s"),
    "QMCPy": Style("C2", "v"),
    "torch": Style("C1", "^"),
}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in processes of their own, one setting after the other, and draw dots."""
    measured = {}
    for done, (name, tunables) in enumerate(SETTINGS.items(), start=1):
        measured[name] = _measure(quality, tunables)
        progress(done / len(SETTINGS))
    first, *_ = measured.values()
    titles = [entry["case"] for entry in first["cases"]]

    figure = Figure(figsize=(11, 1.2 + 0.5 * len(titles)), layout="constrained")
    figure.suptitle("Points made, median of calls after others (further right is better)")
    for axes, (name, result) in zip(
        figure.subplots(1, 2, sharey=True, sharex=True), measured.items(), strict=True
    ):
        _dots(axes, result["cases"])
        axes.set(title=name, xlabel="coordinates a second", xscale="log")
        axes.grid(axis="x", alpha=0.3)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    between = {
        f"{one} / {other}": {
            name: _rate(of["cases"], one) / _rate(of["cases"], other) for name, of in measured.items()
        }
        for one, other in (("Faure", "Sobol'"), ("permutation net", "rank-1 lattice"))
    }
    numbers = {
        "measured": {
            name: result | {"ours / fastest peer": _ratios(result["cases"])}
            for name, result in measured.items()
        }
        | {"rates over those of others": between},
        "claims": {
            "bases above 2 are slower: Faure's sequence makes fewer coordinates a second than Sobol's": {
                name: rate < 1 for name, rate in between["Faure / Sobol'"].items()
            },
            "permutation nets are as fast as rank-1 lattices, within 25 %": {
                name: 1 / ALIKE < rate < ALIKE
                for name, rate in between["permutation net / rank-1 lattice"].items()
            },
        },
        "note": "Peers not installed are left out (pip install -e '.[bench]' brings QMCPy and torch). "
        "scipy and torch draw block after block, QMCPy its first points each time. Peers make float64, and "
        "both of our ratios are to that. The peers' scrambling is linear, but for QMCPy's nested uniform one "
        "beside our exact Owen scrambling. Drafts are small and say little.",
    }
    return figure, numbers


def _measure(quality: str, tunables: str | None) -> dict:
    environment = {key: value for key, value in os.environ.items() if key != "GLIBC_TUNABLES"}
    if tunables is not None:
        environment["GLIBC_TUNABLES"] = tunables
    return own_process.measured(point_rates, quality, environment)


def _dots(axes: Axes, cases: list[dict]) -> None:
    """Draw a row of dots for each case: on a logarithmic axis there is nothing that bars could begin at."""
    for row, case in enumerate(cases):
        rates = case["ours"] | case["peers"]
        axes.plot([min(rates.values()), max(rates.values())], [row, row], color="0.8", lw=1, zorder=0)
    for name, look in STYLES.items():
        of = [(case["ours"] | case["peers"]).get(name, np.nan) for case in cases]
        ours = any(name in case["ours"] for case in cases)
        if not np.isnan(of).all():
            # Hollow, so that none hides another.
            axes.plot(
                of,
                range(len(cases)),
                look.marker,
                color=look.color,
                ms=6,
                mfc="none",
                mew=1.5,
                label=f"qmcjax, {name}" if ours else name,
            )
    axes.set_yticks(range(len(cases)), [case["case"].replace(", ", ",\n") for case in cases])
    if not axes.yaxis_inverted():
        axes.invert_yaxis()


def _rate(cases: list[dict], title: str) -> float:
    """Return our rate, float32, in the first case with such a title."""
    return next(case["ours"]["float32"] for case in cases if case["case"].startswith(title))


def _ratios(cases: list[dict]) -> dict:
    return {
        case["case"]: {name: rate / max(case["peers"].values()) for name, rate in case["ours"].items()}
        for case in cases
        if case["peers"]
    }

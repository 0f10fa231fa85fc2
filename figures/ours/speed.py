"""How fast points, rays, paths and measures are, beside the programs that a user would take instead."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures.making import own_process
from figures.plot import Style
from figures.shared.sheets.curves import titled
from figures.shared.timing import device_rates, measure_rates, path_rates, point_rates, ray_rates

ALIKE = 1.25
"""Ratio of rates that are about the same."""

STYLES = {
    "float32": Style("C0", "o"),
    "float64": Style("C5", "D"),
    "scipy": Style("C4", "s"),
    "QMCPy": Style("C2", "v"),
    "torch": Style("C1", "^"),
    "fused loops": Style("C0", "o"),
    "tree, JAX": Style("C1", "^"),
    "compiled": Style("C2", "v"),
    "Embree": Style("0.6", "s"),
    "Embree, all threads": Style("0.3", "D"),
    "qmcjax, Sobol'": Style("C0", "o"),
    "qmcjax, random": Style("C1", "^"),
    "Mitsuba": Style("0.3", "s"),
    "qmcjax": Style("C0", "o"),
    "cKDTree": Style("0.3", "D"),
    "GPU": Style("C0", "o"),
    "processor": Style("C1", "^"),
    "bound of an H100": Style("0.6", "s"),
}
"""By way or program: of points, rays, paths, measures and devices."""

OURS = ("float32", "float64", "fused loops", "tree, JAX", "compiled")
"""Ways of ours, whose names do not say so."""

NOTE = (
    "All are medians of calls after the first. Points: scipy and torch draw block after block, QMCPy its "
    "first points each time. Peers make float64. Their scrambling is linear, but for QMCPy's nested uniform "
    "one beside our exact Owen scrambling. {rays} {paths} {measures} Where there is a "
    "GPU, rates of whole programs on it stand beside those on the processor and what an H100 could do at "
    "most, by the operations and bytes that XLA counts. Peers not installed are left out "
    "(pip install -e '.[bench]' brings QMCPy and torch)."
)

Rates = Mapping[str, Mapping[str, float]]
"""By case and way."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure one kind after the other, points in a process of its own, and draw dots."""
    made = own_process.measured(point_rates, quality)
    progress(0.2)
    on_device = own_process.measured(device_rates, quality)
    progress(0.3)
    of_rays, about_rays = ray_rates.measured(quality)
    progress(0.6)
    of_paths, about_paths = path_rates.measured(quality)
    progress(0.8)
    measures = measure_rates.measured(quality)
    points = {case["case"]: case["ours"] | case["peers"] for case in made["cases"]}
    rays = {name: {way: of["per second"] for way, of in ways.items()} for name, ways in of_rays.items()}
    paths = {name: of["paths per second"] for name, of in of_paths.items()}

    figure = titled("How fast points, rays, paths and measures are (further right is better)", 16, 11)
    parts: Any = figure.subfigures(1, 2)
    left, right = parts
    columns = {
        left: {"Coordinates of points per second": points, "Paths per second": paths},
        right: {"Rays per second": rays, "Points measured per second": measures},
    }
    if on_device:
        columns[left][f"Samples per second on a {on_device['device']}"] = {
            name: {"GPU": of["rate"], "processor": of["processor"], "bound of an H100": of["bound"]}
            for name, of in on_device["programs"].items()
        }
    for part, panels in columns.items():
        heights = [len(rates) + 3 for rates in panels.values()]
        axes = part.subplots(len(panels), 1, height_ratios=heights)
        for ax, (title, rates) in zip(axes, panels.items(), strict=True):
            _dots(ax, rates)
            ax.set_title(title)
    claims, between = _claims(points)
    numbers = {
        "measured": {
            "points": made,
            "points, ours / fastest peer": _ratios(made["cases"]),
            "rates over those of others": between,
            "rays": of_rays,
            "rays, compiled / Embree per processor second": {
                name: ways["compiled"]["per processor second"] / ways["Embree"]["per processor second"]
                for name, ways in of_rays.items()
                if "compiled" in ways and "Embree" in ways
            },
            "paths": of_paths,
            "measures": measures,
            "devices": on_device,
        },
        "claims": claims,
        "note": NOTE.format(rays=about_rays, paths=about_paths, measures=measure_rates.NOTE),
    }
    return figure, numbers


def _dots(axes: Axes, rates: Rates) -> None:
    """Draw a row of dots for each case: on a logarithmic axis there is nothing that bars could begin at."""
    for row, of in enumerate(rates.values()):
        axes.plot([min(of.values()), max(of.values())], [row, row], color="0.8", lw=1, zorder=0)
    for name, look in STYLES.items():
        of = [found.get(name, np.nan) for found in rates.values()]
        if not np.isnan(of).all():
            # Hollow, so that none hides another.
            looks = {"color": look.color, "ms": 6, "mfc": "none", "mew": 1.5}
            label = f"qmcjax, {name}" if name in OURS else name
            axes.plot(of, range(len(rates)), look.marker, label=label, **looks)
    axes.set_yticks(range(len(rates)), list(rates))
    axes.set(xscale="log", ylim=(len(rates) - 0.5, -0.5))
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.3, -0.5 / len(rates)), ncols=3, frameon=False)


def _claims(points: Rates) -> tuple[dict[str, bool], dict[str, float]]:
    """Return what the thesis says about rates, and ratios of ours in float32."""

    def rate(title: str) -> float:
        return next(of["float32"] for case, of in points.items() if case.startswith(title))

    pairs = (("Faure", "Sobol'"), ("permutation net", "rank-1 lattice"))
    ratios = {f"{one} / {other}": rate(one) / rate(other) for one, other in pairs}
    return {
        "bases above 2 are slower: Faure's sequence makes fewer coordinates per second than Sobol's": (
            ratios["Faure / Sobol'"] < 1
        ),
        "permutation nets are as fast as rank-1 lattices, within 25 %": (
            1 / ALIKE < ratios["permutation net / rank-1 lattice"] < ALIKE
        ),
    }, ratios


def _ratios(cases: list[dict]) -> dict[str, dict[str, float]]:
    return {
        case["case"]: {name: rate / max(case["peers"].values()) for name, rate in case["ours"].items()}
        for case in cases
        if case["peers"]
    }

"""Samplers of ours in Mitsuba 3 beside its own: errors, what a filter leaves of them, spectra, and speed."""

import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.making import own_process
from figures.ours import benchmark_traced
from figures.shared import diffusion, mitsuba_scenes
from figures.shared import mitsuba_samplers_process as process
from figures.shared.image_grid import Panel, add_axes, image_grid
from figures.shared.mitsuba_scenes import Run

OWEN, OPTIMIZED = "(0,2), Owen per pixel", "optimised orders"
REFERENCE, REFERENCE_SPP = "multijitter", 64
KEY, SPEED_KEY, REFERENCE_KEY = 1, 2, 2**20
SHOWN = ("independent", "multijitter", OWEN, OPTIMIZED)
SHOWN_SPP, SPECTRUM_SPP = 4, 1
GOAL = 1.5
PANEL = 256

EDGES = {"Cornell box": 8, "glossy": 4, "depth of field": 3}
"""Of the longest paths."""


class Size(NamedTuple):
    """How much is measured."""

    scenes: tuple[str, ...]
    side: int
    counts: tuple[int, ...]
    samplers: tuple[str, ...]
    timed: int
    """Samples per pixel of images that are timed, of which there is one before."""

    replicates: int
    """Of the reference."""


SIZES = {
    "draft": Size(("depth of field",), 32, (1, 4), ("independent", "multijitter", OWEN), 4, 2),
    "paper": Size(
        ("Cornell box", "glossy", "depth of field"),
        64,
        (1, 4, 16, 64),
        (*process.THEIRS, *process.OURS),
        16,
        12,
    ),
}

Images = dict[Run, NDArray]

NOTE = (
    "{side} x {side} pixels, box filter, linear RGB, scalar_rgb, paths of up to {edges} edges; one image "
    "by each sampler: Mitsuba's own, and ours as the plug-in of qmcjax.bridges.mitsuba. Ours have 8 "
    "dimensions; behind them the plug-in hands out pairs with fresh keys. {lamp}References are means of "
    "{replicates} images of 64 multijittered samples. {explained} Their RMS errors: {noise}. At {most} "
    "samples the RMS error of independent samples is {ratios} times that of Owen-scrambled Sobol' points in "
    "each pixel; the goal was {goal} on two scenes. {verdict} Least of all: {best}; after the filter: "
    "{filtered}. Samples a second of the second image by a sampler, of {speed_spp} samples a pixel, alone "
    "({scene}): {speeds}. Mitsuba's samplers run on all threads; ours on one: "
    "several would wait for each other at each number that they ask Python for. At one sample Mitsuba's "
    "three are the same points."
)

LAMP = (
    "In the Cornell box errors are measured in the lower three quarters: above, a few pixels at the edge of "
    "the lamp have most of the square error. "
)


def make(
    quality: str, progress: Callable[[float], None]
) -> tuple[Figure, dict] | tuple[Figure, dict, dict[str, NDArray]]:
    """Render all scenes in processes of their own, and draw images, errors, spectra and speeds."""
    if not mitsuba_scenes.installed():
        return _missing()
    size = SIZES[quality]
    *others, last = size.scenes
    with ThreadPoolExecutor(2) as pool:
        found: dict[str, Images] = {}
        for name, (images, _) in zip(others, pool.map(lambda name: _run(name, size), others), strict=True):
            found[name] = images
            progress(0.7 * len(found) / len(size.scenes))
    # Alone, since it is timed.
    found[last], seconds = _run(last, size)
    speeds = {
        _shown(run.sampler): run.spp * size.side**2 / seconds[run]
        for run in found[last]
        if run.seed == SPEED_KEY
    }
    exact = {name: _exact(of) for name, of in found.items()}
    rows = [
        {"scene": name, "sampler": _shown(run.sampler), "spp": run.spp}
        | diffusion.measures(image, exact[name], _area(name, size.side))
        for name, of in found.items()
        for run, image in of.items()
        if run.seed == KEY
    ]
    errors = {(row["scene"], row["sampler"], row["spp"]): row for row in rows}
    most = size.counts[-1]
    ratios = {
        name: errors[name, _shown("independent"), most]["RMS error"] / errors[name, OWEN, most]["RMS error"]
        for name in found
    }
    least = {
        what: {
            name: min(map(_shown, size.samplers), key=lambda s: errors[name, s, most][what]) for name in found
        }
        for what in ("RMS error", "filtered error")
    }
    numbers = {
        "measured": {
            f"RMS error of independent samples / Owen's, {most} spp": ratios,
            f"least of all, {most} spp": least,
            "samples a second": speeds,
        },
        "table": rows,
        "note": NOTE.format(
            side=size.side,
            edges=_listed({name: str(EDGES[name]) for name in found}),
            lamp=LAMP if "Cornell box" in found else "",
            replicates=size.replicates,
            explained=diffusion.EXPLAINED,
            noise=_listed({name: f"{np.sqrt(np.mean(of.error**2)):.1e}" for name, of in exact.items()}),
            most=most,
            ratios=_listed({name: f"{ratio:.2f}" for name, ratio in ratios.items()}),
            goal=GOAL,
            verdict=_verdict(ratios),
            best=_listed(least["RMS error"]),
            filtered=_listed(least["filtered error"]),
            speed_spp=size.timed,
            scene=last,
            speeds=", ".join(f"{name} {speed:,.0f}" for name, speed in speeds.items()),
        ),
    }
    images = {
        f"{name}, {_shown(sampler)}": of[Run(sampler, SHOWN_SPP, KEY)]
        for name, of in found.items()
        for sampler in _pictured(size)
    }
    return _drawn(size, found, exact, rows, speeds), numbers, images


def _shown(sampler: str) -> str:
    """Return a name that says whose sampler it is."""
    return f"Mitsuba, {sampler}" if sampler in process.THEIRS else sampler


def _pictured(size: Size) -> list[str]:
    """Return the samplers whose images are drawn."""
    return [name for name in SHOWN if name in size.samplers]


def _listed(of: dict[str, str]) -> str:
    return ", ".join(f"{value} ({name})" for name, value in of.items())


def _verdict(ratios: dict[str, float]) -> str:
    reached = sum(ratio >= GOAL for ratio in ratios.values())
    if len(ratios) < 3:
        return "Drafts have one scene."
    return f"It is reached on {reached} of {len(ratios)}."


def _area(scene: str, side: int) -> diffusion.Area:
    """Return the part of an image in which errors are measured."""
    return (slice(side // 4, side), slice(None)) if scene == "Cornell box" else diffusion.WHOLE


def _run(scene: str, size: Size) -> tuple[Images, dict[Run, float]]:
    """Return images by a process of their own, and the seconds that each took."""
    runs = [Run(REFERENCE, REFERENCE_SPP, REFERENCE_KEY + k) for k in range(size.replicates)]
    for name in size.samplers:
        runs += [Run(name, spp, KEY) for spp in size.counts]
        if scene == size.scenes[-1]:
            # The images before it compile, and wake threads.
            runs += [Run(name, size.timed, SPEED_KEY)]
    with tempfile.TemporaryDirectory() as folder:
        task = {"scene": scene, "side": size.side, "runs": runs, "file": str(Path(folder, "images.npz"))}
        own_process.run(process, task=task)
        with np.load(task["file"]) as result:
            images, seconds = result["images"].astype(np.float64), result["seconds"].tolist()
    return dict(zip(runs, images, strict=True)), dict(zip(runs, seconds, strict=True))


def _exact(images: Images) -> diffusion.Reference:
    replicates = [image for run, image in images.items() if run.seed >= REFERENCE_KEY]
    error = np.std(replicates, axis=0, ddof=1) / np.sqrt(len(replicates))
    return diffusion.Reference(np.mean(replicates, axis=0), error, "")


def _missing() -> tuple[Figure, dict]:
    """Return what there is without Mitsuba."""
    note = "Mitsuba is not installed: pip install 'qmcjax[mitsuba]'."
    figure = Figure(figsize=(6, 1))
    figure.text(0.5, 0.5, note, ha="center", va="center")
    return figure, {"measured": {}, "note": note}


def _style(sampler: str) -> plot.Style:
    name = _shown(sampler)
    if name == "Mitsuba, multijitter":  # Its colour elsewhere is that of our optimised orders.
        return plot.Style(plot.style("rank-1 lattice").color, "v", "--")
    return benchmark_traced.STYLES[name] if name in benchmark_traced.STYLES else plot.style(sampler)


ROW, HIGH, BAR = 266, 190, 26
"""Pixels from one row of curves to the next, of one of them, and of a bar."""

CURVES = ("RMS error", "filtered error", "spectrum")


def _drawn(
    size: Size,
    found: dict[str, Images],
    exact: dict[str, diffusion.Reference],
    rows: list[dict[str, Any]],
    speeds: dict[str, float],
) -> Figure:
    """Draw images of each scene in a row, and below them curves, a scene in each column."""
    panels = []
    for name, of in found.items():
        panels.append(Panel(f"{name}\nreference", diffusion.shown(exact[name].image)))
        for sampler in _pictured(size):
            error = next(
                row["RMS error"]
                for row in rows
                if (row["scene"], row["sampler"], row["spp"]) == (name, _shown(sampler), SHOWN_SPP)
            )
            caption = f"{_shown(sampler)}, {SHOWN_SPP} spp\nRMS error {error:.3f}"
            panels.append(Panel(caption, diffusion.shown(of[Run(sampler, SHOWN_SPP, KEY)])))
    bars = BAR * len(speeds) + 70
    below = len(CURVES) * ROW + bars + 20
    title = "Samplers of ours in Mitsuba 3, beside its own"
    figure = image_grid(title, panels, 1 + len(_pictured(size)), PANEL, below=below)
    across, down = (int(inches * figure.dpi) for inches in figure.get_size_inches())
    column = across // len(found)
    for k, (name, of) in enumerate(found.items()):
        for row, what in enumerate(CURVES):
            bottom = bars + (len(CURVES) - 1 - row) * ROW + 60
            axes = add_axes(figure, 90 + k * column, bottom, min(column - 110, 400), HIGH)
            if what == "spectrum":
                _draw_spectra(axes, name, of, exact[name], size)
            else:
                _draw_errors(axes, what, name, rows, size)
            axes.yaxis.set_label_coords(-62 / min(column - 110, 400), 0.5)
            if not row:
                axes.set_title(name)
    axes = add_axes(figure, 260, 60, min(across // 2 - 260, 480), BAR * len(speeds))
    for k, sampler in enumerate(size.samplers):
        speed = speeds[_shown(sampler)]
        axes.barh(k, speed / 1e6, color=_style(sampler).color)
        axes.text(speed / 1e6, k, f"  {speed / 1e6:.2f}", va="center", fontsize=8)
    axes.set_yticks(range(len(size.samplers)), list(map(_shown, size.samplers)))
    axes.invert_yaxis()
    axes.set(xlabel=f"million samples a second, {list(found)[-1]}", xlim=(0, 1.2e-6 * max(speeds.values())))
    handles, names = figure.axes[len(panels)].get_legend_handles_labels()
    place = (across // 2 + 60) / across, (60 + BAR * len(speeds) / 2) / down
    figure.legend(handles, names, loc="center left", bbox_to_anchor=place, frameon=False)
    return figure


def _draw_errors(axes: Axes, what: str, scene: str, rows: list[dict[str, Any]], size: Size) -> None:
    for sampler in size.samplers:
        chosen = [row for row in rows if (row["scene"], row["sampler"]) == (scene, _shown(sampler))]
        drawn = _style(sampler)
        axes.plot(
            [row["spp"] for row in chosen],
            [row[what] for row in chosen],
            drawn.line,
            color=drawn.color,
            marker=drawn.marker,
            ms=4,
            lw=1,
            label=_shown(sampler),
        )
    axes.set(xscale="log", yscale="log", xlabel="samples per pixel", ylabel=what)
    axes.set_xticks(size.counts, list(map(str, size.counts)))
    axes.xaxis.set_minor_locator(NullLocator())
    # Less than a decade has few labels by default.
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=10))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())
    axes.grid(alpha=0.3)


def _draw_spectra(axes: Axes, scene: str, images: Images, exact: diffusion.Reference, size: Size) -> None:
    area = _area(scene, size.side)
    for sampler in size.samplers:
        image = images[Run(sampler, SPECTRUM_SPP, KEY)]
        frequency, mean = analysis.radial_average(analysis.error_spectrum(image[area], exact.image[area]))
        drawn = _style(sampler)
        axes.plot(frequency / max(image[area].shape[:2]), mean, drawn.line, color=drawn.color, lw=1.2)
    axes.axhline(1, color="0.6", lw=0.8, zorder=0)
    axes.set(
        xlim=(0, 0.5),
        ylim=(0, None),
        xlabel="cycles per pixel",
        ylabel=f"power, {SPECTRUM_SPP} spp",
    )

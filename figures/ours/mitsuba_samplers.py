"""Samplers of ours in Mitsuba 3 beside its own: errors, what a filter leaves of them, spectra, and speed."""

import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._errors import rms
from figures.making import this_machine
from figures.shared.mitsuba_runs import mitsuba_samplers_process as process
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.mitsuba_runs.mitsuba_scenes import Run
from figures.shared.rendered import diffusion
from figures.shared.sheets.image_sheets import Panel, add_axes, image_grid
from figures.shared.sheets.panels import curve, name_axes

REFERENCE, REFERENCE_SPP = "multijitter", 64
KEY, REFERENCE_KEY = 1, 2**20
TIMED_SPP = 16


class Size(NamedTuple):
    """How much is measured."""

    scenes: tuple[str, ...]
    side: int
    counts: tuple[int, ...]
    samplers: tuple[str, ...]
    replicates: int
    """Of the reference."""

    timed_side: int
    turns: int
    """Images whose median is the time of a sampler, after the first."""


Images = dict[Run, NDArray]

Rates = dict[str, dict[str, list[float]]]
"""Seconds of the first image and the median of others, by variants and samplers."""


def rates_of(size: Size) -> Rates:
    """Return first and median seconds of images, by variants and modes of loops, and by samplers."""
    found: Rates = {}
    for variant in ("scalar_rgb", *(["llvm_ad_rgb"] if mitsuba_scenes.has_llvm() else [])):
        task = {
            "variant": variant,
            "samplers": size.samplers,
            "side": size.timed_side,
            "spp": TIMED_SPP,
            "turns": size.turns,
        }
        for mode, taken in this_machine.measure_apart(process, task).items():
            found[f"{variant}, {mode} loops" if mode else variant] = taken
    return found


def shown(sampler: str) -> str:
    """Return a name that says whose sampler it is."""
    return f"Mitsuba, {sampler}" if sampler in process.THEIRS else sampler


def measured_area(scene: str, side: int) -> diffusion.Area:
    """Return the part of an image in which errors are measured."""
    return (slice(side // 4, side), slice(None)) if scene == "Cornell box" else diffusion.WHOLE


def render_images(scene: str, size: Size) -> Images:
    """Return images in a separate process."""
    runs = [Run(REFERENCE, REFERENCE_SPP, REFERENCE_KEY + k) for k in range(size.replicates)]
    runs += [Run(name, spp, KEY) for name in size.samplers for spp in size.counts]
    with tempfile.TemporaryDirectory() as folder:
        task = {"scene": scene, "side": size.side, "runs": runs, "file": str(Path(folder, "images.npz"))}
        this_machine.run_apart(process, task=task)
        with np.load(task["file"]) as result:
            return dict(zip(runs, result["images"].astype(np.float64), strict=True))


def reference(images: Images) -> diffusion.Reference:
    """Return the mean of the replicates of the reference, and its standard error."""
    return diffusion.of_replicates([of for run, of in images.items() if run.seed >= REFERENCE_KEY], "")


OWEN, OPTIMIZED = "(0,2), Owen per pixel", "optimised orders"
SHOWN = ("independent", "multijitter", OWEN, OPTIMIZED)
SHOWN_SPP, SPECTRUM_SPP = 4, 1
GOAL = 1.5
PANEL = 256

SIZES = {
    "draft": Size(("depth of field",), 32, (1, 4), ("independent", "multijitter", OWEN), 2, 32, 1),
    "paper": Size(
        ("Cornell box", "glossy", "depth of field"),
        64,
        (1, 4, 16, 64),
        (*process.THEIRS, *process.OURS),
        12,
        256,
        5,
    ),
}

NOTE = (
    f"{{side}} x {{side}} pixels, box filter, linear RGB, scalar_rgb, paths of up to 8 (Cornell box), 4 "
    "(glossy) and 3 edges (depth of field); one image by each sampler: Mitsuba's, and ours through "
    "qmcjax.bridges.mitsuba. Ours have 8 dimensions; after these the plug-in returns pairs with fresh "
    "keys. In the Cornell box errors are measured in the lower three quarters: above, a few pixels at "
    f"the edge of the lamp dominate the squared error. References are means of {{replicates}} images of "
    f"64 multijittered samples. {diffusion.EXPLAINED} Asked for was {GOAL} times the error of "
    "Owen-scrambled Sobol' points by independent samples, on two scenes. Rates are of the Cornell box, "
    f"{{timed_side}} x {{timed_side}} pixels at {TIMED_SPP} samples, paths of up to 8 edges, medians of "
    f"{{turns}} alternating images, on all threads. At one sample Mitsuba's three are the same points."
)


def make(
    quality: str, progress: Callable[[float], None]
) -> tuple[Figure, dict] | tuple[Figure, dict, dict[str, NDArray]]:
    """Render all scenes in separate processes, and draw images, errors, spectra and speeds."""
    if not mitsuba_scenes.installed():
        return _missing()
    size = SIZES[quality]
    with ThreadPoolExecutor(2) as pool:
        found: dict[str, Images] = {}
        runs = pool.map(lambda name: render_images(name, size), size.scenes)
        for name, images in zip(size.scenes, runs, strict=True):
            found[name] = images
            progress(0.7 * len(found) / len(size.scenes))
    rates = rates_of(size)
    exact = {name: reference(of) for name, of in found.items()}
    rows = [
        {"scene": name, "sampler": shown(run.sampler), "spp": run.spp}
        | diffusion.measures(image, exact[name], measured_area(name, size.side))
        for name, of in found.items()
        for run, image in of.items()
        if run.seed == KEY
    ]
    errors = _by_case(rows)
    most = size.counts[-1]
    ratios = {
        name: errors[name, shown("independent"), most]["RMS error"] / errors[name, OWEN, most]["RMS error"]
        for name in found
    }
    least = {
        what: {
            name: min(map(shown, size.samplers), key=lambda s: errors[name, s, most][what]) for name in found
        }
        for what in ("RMS error", "filtered error")
    }
    samples = size.timed_side**2 * TIMED_SPP
    numbers = {
        "measured": {
            f"RMS error of independent samples / Owen's, {most} spp": ratios,
            f"least of all, {most} spp": least,
            "RMS error of references": {name: rms(of.error) for name, of in exact.items()},
            "seconds of the first image, and of others": {
                what: {shown(name): taken for name, taken in of.items()} for what, of in rates.items()
            },
            "million independent samples per second": {
                what: samples / of["independent"][1] / 1e6 for what, of in rates.items()
            },
        },
        "table": rows,
        "note": NOTE.format(
            side=size.side, replicates=size.replicates, timed_side=size.timed_side, turns=size.turns
        ),
    }
    images = {
        f"{name}, {shown(sampler)}": of[Run(sampler, SHOWN_SPP, KEY)]
        for name, of in found.items()
        for sampler in _pictured(size)
    }
    return _draw(size, found, exact, rows, rates), numbers, images


def _by_case(rows: list[dict[str, Any]]) -> dict[tuple[str, str, int], dict[str, Any]]:
    return {(row["scene"], row["sampler"], row["spp"]): row for row in rows}


def _pictured(size: Size) -> list[str]:
    return [name for name in SHOWN if name in size.samplers]


def _missing() -> tuple[Figure, dict]:
    note = "Mitsuba is not installed: pip install 'qmcjax[mitsuba]'."
    figure = Figure(figsize=(6, 1))
    figure.text(0.5, 0.5, note, ha="center", va="center")
    return figure, {"measured": {}, "note": note}


ROW, HIGH, BAR = 266, 190, 26
"""Pixels from one row of curves to the next, of one of them, and of a bar."""

CURVES = ("RMS error", "filtered error", "spectrum")


def _draw(
    size: Size,
    found: dict[str, Images],
    exact: dict[str, diffusion.Reference],
    rows: list[dict[str, Any]],
    rates: Rates,
) -> Figure:
    """Draw images of each scene in a row, and below them curves, a scene in each column."""
    panels, errors = [], _by_case(rows)
    for name, of in found.items():
        panels.append(Panel(f"{name}\nreference", diffusion.shown(exact[name].image)))
        for sampler in _pictured(size):
            error = errors[name, shown(sampler), SHOWN_SPP]["RMS error"]
            caption = f"{shown(sampler)}, {SHOWN_SPP} spp\nRMS error {error:.3f}"
            panels.append(Panel(caption, diffusion.shown(of[Run(sampler, SHOWN_SPP, KEY)])))
    bars = BAR * len(size.samplers) + 190
    below = len(CURVES) * ROW + bars + 20
    title = "Our samplers and Mitsuba's, in Mitsuba 3: errors, filtered errors and rates"
    figure = image_grid(title, panels, 1 + len(_pictured(size)), below=below)
    across = int(figure.get_figwidth() * figure.dpi)
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
    wide = min((across - 290) // len(rates), 480)
    for k, (what, taken) in enumerate(rates.items()):
        axes = add_axes(figure, 260 + k * wide, 120, wide - 30, BAR * len(size.samplers))
        _draw_rates(axes, what, taken, size)
        if k:
            axes.set_yticklabels([])
    handles, names = figure.axes[len(panels)].get_legend_handles_labels()
    figure.legend(
        handles, names, loc="lower left", bbox_to_anchor=(0.02, 0), ncols=len(names) // 2 + 1, frameon=False
    )
    return figure


def _draw_errors(axes: Axes, what: str, scene: str, rows: list[dict[str, Any]], size: Size) -> None:
    for sampler in size.samplers:
        name = shown(sampler)
        chosen = {row["spp"]: row[what] for row in rows if (row["scene"], row["sampler"]) == (scene, name)}
        curve(axes, chosen, plot.style(shown(sampler)), label=name)
    name_axes(axes, "samples per pixel", what, log="xy", ticks=size.counts, few_decades=True)


def _draw_rates(axes: Axes, what: str, taken: dict[str, list[float]], size: Size) -> None:
    base = taken["independent"][1]
    for k, sampler in enumerate(size.samplers):
        ratio = base / taken[sampler][1]
        axes.barh(k, ratio, color=plot.style(shown(sampler)).color)
        axes.text(ratio, k, f"  {ratio:.2f}", va="center", fontsize=8)
    axes.set_yticks(range(len(size.samplers)), list(map(shown, size.samplers)))
    axes.invert_yaxis()
    axes.set(xlabel="rate / independent", xlim=(0, 1.3))
    axes.set_title(what, fontsize=9)


def _draw_spectra(axes: Axes, scene: str, images: Images, exact: diffusion.Reference, size: Size) -> None:
    area = measured_area(scene, size.side)
    for sampler in size.samplers:
        image = images[Run(sampler, SPECTRUM_SPP, KEY)]
        frequency, mean = analysis.radial_average(analysis.error_spectrum(image[area], exact.image[area]))
        drawn = plot.style(shown(sampler))
        axes.plot(frequency / max(image[area].shape[:2]), mean, drawn.line, color=drawn.color, lw=1.2)
    axes.axhline(1, color="0.6", lw=0.8, zorder=0)
    axes.set(xlim=(0, 0.5), ylim=(0, None), xlabel="cycles per pixel", ylabel=f"power, {SPECTRUM_SPP} spp")

"""Samplers of ours in Mitsuba 3 beside its own: errors, what a filter leaves of them, and speed."""

import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures import plot
from figures._errors import rms
from figures._rc import PAGE
from figures.making import this_machine
from figures.shared.mitsuba_runs import mitsuba_samplers_process as process
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.mitsuba_runs.mitsuba_scenes import Run
from figures.shared.rendered import diffusion
from figures.shared.sheets.image_sheets import DPI, Panel, add_axes, image_grid
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
SHOWN_SPP = 4
GOAL = 1.5

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
    """Render all scenes in separate processes, and draw images, errors and speeds."""
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
    figure = Figure(figsize=(PAGE, 1))
    figure.text(0.5, 0.5, note, ha="center", va="center")
    return figure, {"measured": {}, "note": note}


ROW, HIGH, BAR, BOTTOM = 520, 340, 42, 300
"""Pixels from one row of curves to the next, of one of them, of a bar, and below all bars."""

CURVES = ("RMS error", "filtered error")


def _draw(
    size: Size,
    found: dict[str, Images],
    exact: dict[str, diffusion.Reference],
    rows: list[dict[str, Any]],
    rates: Rates,
) -> Figure:
    """Draw images of the first scene in a row, and below them curves, a scene in each column, and rates."""
    errors = _by_case(rows)
    name, of = next(iter(found.items()))
    panels = [Panel(f"{name}\nreference", diffusion.shown(exact[name].image))]
    for sampler in _pictured(size):
        error = errors[name, shown(sampler), SHOWN_SPP]["RMS error"]
        caption = f"{shown(sampler).removesuffix(' per pixel')}\nRMS error {error:.3f}"
        panels.append(Panel(caption, diffusion.shown(of[Run(sampler, SHOWN_SPP, KEY)])))
    most = size.counts[-1]
    ratios = [
        errors[each, shown("independent"), most]["RMS error"] / errors[each, OWEN, most]["RMS error"]
        for each in found
    ]
    factor = f"{min(ratios):.1f}" + f" to {max(ratios):.1f}" * (len(ratios) > 1)
    bars = BAR * len(size.samplers) + BOTTOM
    figure = image_grid(
        f"In Mitsuba 3, independent samples have {factor} times the error of Owen's at {most} spp\n"
        f"images of {SHOWN_SPP} samples per pixel; last row: rates",
        panels,
        len(panels),
        below=len(CURVES) * ROW + bars + 110,
    )
    across, down = figure.get_size_inches() * DPI
    column = int(across) // len(found)
    for k, each in enumerate(found):
        for row, what in enumerate(CURVES):
            bottom = bars + (len(CURVES) - 1 - row) * ROW + 230
            axes = add_axes(figure, 230 + k * column, bottom, column - 260, HIGH)
            _draw_errors(axes, what, each, rows, size)
            if not row:
                axes.set_title(each)
    wide = (int(across) - 620) // len(rates)
    for k, (what, taken) in enumerate(rates.items()):
        axes = add_axes(figure, 580 + k * wide, BOTTOM, wide - 60, BAR * len(size.samplers))
        _draw_rates(axes, what, taken, size)
        if k:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel("sampler")
    handles, names = figure.axes[len(panels)].get_legend_handles_labels()
    look = {"loc": "lower center", "frameon": False, "ncols": 3}
    figure.legend(handles, names, bbox_to_anchor=(0.5, 10 / down), **look)
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
        axes.text(ratio, k, f" {ratio:.2f}", va="center")
    axes.set_yticks(range(len(size.samplers)), list(map(shown, size.samplers)))
    axes.invert_yaxis()
    axes.set(xlabel="rate / independent", xlim=(0, 1.5), xticks=[0, 0.5, 1])
    axes.set_title(what.removesuffix(" loops").replace("_rgb", ""))

"""Designed samplers: tiles beside other samplers, animations after filters in space and time, and scenes."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

import analysis
from analysis import design_samples
from figures.ours import designed_tiles, space_time
from figures.shared.sheets.image_sheets import DPI, add_axes, image_grid
from figures.shared.sheets.panels import name_axes
from qmcjax import samplers, scenes
from qmcjax.core import student

SIDE = {"draft": 32, "paper": 64}
COUNTS = {"draft": (1,), "paper": (1, 4)}
STEPS = {"draft": 120, "paper": 400}
DESIGNS = {"draft": 1, "paper": 3}
KEYS = 16
"""Of tiles designed for the class."""

PANS = (0, 1, 8)
"""Pixels by which the camera is panned to the right and downward; the image goes on at its other side."""

CAMERAS = ("its own camera", "panned by 1 pixel", "panned by 8 pixels")

SCENES = {
    "soft_shadow": scenes.soft_shadow,
    "occluder": scenes.occluder,
    "sports": scenes.sports,
    "defocus": scenes.defocus,
    "cornell_box": scenes.cornell_box,
}
SHOWN = {"draft": ("soft_shadow", "occluder"), "paper": tuple(SCENES)}

NOTE = (
    "{side} x {side} pixels, RMS error after a Gaussian of 1.5 pixels, relative to the mean over {keys} "
    "keys of tiles designed for half spaces (samplers.designed), with 95 % intervals. Points for a "
    "scene come from design_samples(integrands=[scene]), {steps} steps from a tile of the class; the "
    "geometric mean over {designs} keys is shown. They are the same in every image, and so biased: they "
    "fit the error of each pixel to its neighbours. Gains hold for the camera they were designed for. "
    "References of traced scenes are estimates from 1024 samples per pixel."
)


def measure_scenes(
    quality: str, progress: Callable[[float], None]
) -> tuple[dict[str, dict[str, dict[str, float]]], dict]:
    """Design points for each scene, and measure them by all cameras."""
    side, counts = SIDE[quality], COUNTS[quality]
    found: dict[str, dict[str, Any]] = {}
    for k, spp in enumerate(counts):
        for done, name in enumerate(SHOWN[quality], start=1):
            of_scene = _measure(SCENES[name](), side, spp, STEPS[quality], DESIGNS[quality])
            found.setdefault(f"{spp} spp", {})[name] = of_scene
            progress((k + done / len(SHOWN[quality])) / len(counts))
    gains = {camera: [of[camera] for row in found.values() for of in row.values()] for camera in CAMERAS}
    means = {camera: float(np.exp(np.mean(np.log(of)))) for camera, of in gains.items()}
    note = NOTE.format(side=side, keys=KEYS, steps=STEPS[quality], designs=DESIGNS[quality])
    return found, {"measured": {**found, "geometric means": means}, "note": note}


def _measure(scene: scenes.Scene, side: int, spp: int, steps: int, designs: int) -> dict[str, float]:
    dims = len(scene.needs)
    y, x, sample = np.indices((side, side, spp), np.uint32)
    tiles = [
        samplers.designed(side, side, spp, key, dims)(x, y, sample, tuple(range(dims))) for key in range(KEYS)
    ]
    for key in range(designs):
        points = design_samples(side, side, spp, key, dims, integrands=[scene], steps=steps).points
        tiles += [np.roll(points.astype(np.float32), (pan, pan), axis=(0, 1)) for pan in PANS]
    # One trace, and one estimate of the reference.
    errors = jax.jit(lambda tiles: jax.lax.map(lambda one: analysis.expected_error(one, [scene]), tiles))
    found = np.asarray(errors(np.stack(tiles)), np.float64)
    of_class, of_scene = found[:KEYS], found[KEYS:].reshape(designs, len(PANS))
    middle, (low, high) = of_class.mean(), student.interval(of_class)
    gains = np.exp(np.log(of_scene).mean(axis=0)) / middle
    half = float((high - low) / 2 / middle)
    return {**dict(zip(CAMERAS, gains.tolist(), strict=True)), "half interval": half}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict, dict[str, bytes]]:
    """Measure all parts, and draw errors of tiles, over samples, in scenes, and in animations."""
    tiles = designed_tiles.measure(quality, lambda part: progress(part / 3))
    jax.clear_caches()  # Programs of the tiles take memory, and are of no use to the other parts.
    tables, of_frames, files = space_time.measure(quality, lambda part: progress((1 + part) / 3))
    jax.clear_caches()
    found, of_scenes = measure_scenes(quality, lambda part: progress((2 + part) / 3))
    parts = {"tiles": tiles.numbers, "animations": of_frames, "scenes": of_scenes}
    return (
        _draw(tiles, tables, found),
        {
            "measured": {name: of["measured"] for name, of in parts.items()},
            "note": " ".join(f"{name.capitalize()}: {of['note']}" for name, of in parts.items()),
        },
        {},
        files,
    )


HIGH, LEFT, TABLE = 420, 200, 560
"""Pixels of axes, and left of them, and the height of the table."""


def _draw(tiles: designed_tiles.Tiles, tables: space_time.Tables, found: dict[str, dict]) -> Figure:
    low, high = (of(case["ratio"] for case in tiles.beside.values()) for of in (min, max))
    case, table = next(iter(tables.items()))
    figure = image_grid(
        f"Designed tiles leave {low:.2f} to {high:.2f} of the best other sampler's filtered error\n"
        "above: errors of one sample per pixel, where all pixels have the same integrand\n"
        f"below: animations, {case} and frame, filtered errors / white noise; bold: least",
        designed_tiles.draw_errors(tiles),
        len(designed_tiles.SHOWN),
        below=HIGH + TABLE + 640,
    )
    bottom = TABLE + 510
    for k, dims in enumerate(designed_tiles.DIMS):
        axes = add_axes(figure, LEFT + 640 * k, bottom, 430, HIGH)
        designed_tiles.draw_curves(axes, tiles, dims)
    handles, names = figure.axes[-1].get_legend_handles_labels()
    across, down = figure.get_size_inches() * DPI
    look = {"loc": "upper left", "frameon": False, "ncols": 2}
    figure.legend(handles, names, bbox_to_anchor=(80 / across, (bottom - 90) / down), **look)
    axes = add_axes(figure, LEFT + 1330, bottom, 520, HIGH)
    _draw_scenes(axes, found)
    handles, names = axes.get_legend_handles_labels()
    look["ncols"] = 1
    figure.legend(handles, names, bbox_to_anchor=(1400 / across, (bottom - 90) / down), **look)
    space_time.draw_table(add_axes(figure, 620, 100, 1400, TABLE), table)
    return figure


def _draw_scenes(axes: Axes, found: dict[str, dict]) -> None:
    """Draw what points that were designed for a scene leave of the errors of others."""
    (count, row), *_ = found.items()
    for camera, marker in zip(CAMERAS, "os^", strict=True):
        axes.plot([of[camera] for of in row.values()], range(len(row)), marker, ms=5, label=camera)
    half = [of["half interval"] for of in row.values()]
    axes.errorbar(np.ones(len(row)), range(len(row)), xerr=half, fmt="none", ecolor="0.4", capsize=3)
    axes.axvline(1, color="0.4", linewidth=0.8)
    name_axes(axes, "error / that of tiles", title=f"designed for a scene, {count}", log="x")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_yticks(range(len(row)), [name.replace("_", "\n") for name in row])
    axes.set_ylim(-0.5, len(row) - 0.5)

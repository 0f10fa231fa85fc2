"""Designed samplers: tiles beside other samplers, animations after filters in space and time, and scenes."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import analysis
from analysis import design_samples
from figures.ours import designed_tiles, space_time
from figures.shared.sheets.image_sheets import DPI
from figures.shared.sheets.panels import name_axes, write_title
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


def make_scenes(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Design points for each scene, and measure them by all cameras."""
    side, counts = SIDE[quality], COUNTS[quality]
    measured: dict[str, dict[str, Any]] = {}
    for k, spp in enumerate(counts):
        for done, name in enumerate(SHOWN[quality], start=1):
            found = _measure(SCENES[name](), side, spp, STEPS[quality], DESIGNS[quality])
            measured.setdefault(f"{spp} spp", {})[name] = found
            progress((k + done / len(SHOWN[quality])) / len(counts))
    gains = {camera: [of[camera] for row in measured.values() for of in row.values()] for camera in CAMERAS}
    figure = Figure(figsize=(5.5 * len(counts) + 1, 4.6), layout="constrained")
    ranges = [f"{min(gains[camera]):.2f} to {max(gains[camera]):.2f}" for camera in (CAMERAS[0], CAMERAS[2])]
    write_title(
        figure,
        f"Points that know their scene have {ranges[0]} of the errors of designed tiles, "
        f"and {ranges[1]} after a pan by 8 pixels",
    )
    panels = np.atleast_1d(figure.subplots(1, len(counts)))
    for axes, (count, row) in zip(panels, measured.items(), strict=True):
        _draw(axes, count, row)
    measured["geometric means"] = {camera: float(np.exp(np.mean(np.log(of)))) for camera, of in gains.items()}
    note = NOTE.format(side=side, keys=KEYS, steps=STEPS[quality], designs=DESIGNS[quality])
    return figure, {"measured": measured, "note": note}


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


def _draw(axes: Axes, count: str, row: dict[str, dict[str, float]]) -> None:
    places = np.arange(len(row))
    half = [of["half interval"] for of in row.values()]
    axes.errorbar(
        places, np.ones(len(row)), half, fmt="none", ecolor="0.4", capsize=4, label="designed for the class"
    )
    for camera, marker in zip(CAMERAS, "os^", strict=True):
        axes.plot(places, [of[camera] for of in row.values()], marker, label=f"for the scene, {camera}")
    axes.axhline(1, color="0.4", linewidth=0.8)
    y = "filtered error / that of tiles for the class"
    name_axes(axes, y=y, title=count, log="y", few_decades=True, legend="best")
    axes.set_xticks(places, list(row), rotation=20)


PARTS = {
    "tiles": designed_tiles.make,
    "animations": space_time.make,
    "scenes": make_scenes,
}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict, dict[str, bytes]]:
    """Make all parts, and put their pictures below each other."""
    pictures, measured, notes, files = [], {}, [], {}
    for done, (name, part) in enumerate(PARTS.items()):
        made: Any = part(quality, lambda of_part, done=done: progress((done + of_part) / len(PARTS)))
        picture, numbers, *handed = made
        pictures.append(picture)
        measured[name] = numbers["measured"]
        notes.append(f"{name.capitalize()}: {numbers['note']}")
        files |= dict(*handed[1:])
    return _stack(pictures), {"measured": measured, "note": " ".join(notes)}, {}, files


def _stack(figures: list[Figure]) -> Figure:
    """Return one figure of the pixels of several, from top to bottom."""
    images = []
    for figure in figures:
        figure.set_dpi(DPI)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        images.append(np.asarray(canvas.buffer_rgba())[..., :3])
    width, height = max(image.shape[1] for image in images), sum(len(image) for image in images)
    whole = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    top = height
    for image in images:
        top -= len(image)
        whole.figimage(image, (width - image.shape[1]) // 2, top, origin="upper")
    return whole

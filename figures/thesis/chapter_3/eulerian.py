"""Thesis Sect. 3.1.8: smoke on a grid between two frames, interpolated and advected."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from figures._errors import rms
from figures._rc import BLUE, VERMILLION
from figures.plot import Style
from figures.shared import judged
from figures.shared.sheets.image_sheets import Panel, axes_below, image_grid
from figures.shared.sheets.panels import curve, name_axes

Complex = NDArray[np.complexfloating]
"""Places x + i y in the plane."""

KEYS = 16
PUFFS, WIDTH = 6, 0.08
"""Of smoke: Gaussians, and their standard deviation."""

TURN, SHEAR = 0.6, 0.4
"""From frame to frame: radians, and the largest displacement."""

MOTIONS = {f"turn of {turn:g}": (turn, 0.0) for turn in (0.1, 0.2, TURN)} | {
    f"fall of {fall:g}": (0.0, fall) for fall in (0.02, 0.1)
}
"""From frame to frame: radians, and a displacement."""

FLOWS = ("rotation", "shear")
GRIDS = (32, 64, 128, 256)
"""Cells along each side of [-1, 1] x [-1, 1]."""

SHOWN = GRIDS[1]
TIMES = np.linspace(0, 1, 9)
WAYS = {"interpolated": VERMILLION, "advected": BLUE}
BELOW = 640
"""Pixels of the curves below the images."""

INCORRECT = "interpolation is incorrect: the error is above half of the density"
UNRELATED = "its error is not related to the resolution: the same within 5 % from 32 to 256 cells"
ADVECTED = "advection has less than half the error"
OFTEN = "smoke whose vertices move linearly: the error is below a tenth of the density"
RESOLVED = "from 32 to 256 cells, the error of advection falls below a tenth"

NOTE = (
    f"The smoke is {PUFFS} Gaussian puffs at random places, {KEYS} keys. It rotates by {TURN} radians from "
    "frame to frame, or is sheared along x, faster or slower by y; the exact density is that at the place "
    "where the flow comes from. Both frames and the velocity at the first one are exact on the grid, and "
    "bilinear in between. Interpolation blends both frames linearly; advection reads the first frame at "
    "x - t v(x). Vertices that turn, or fall from rest, carry smoke along straight lines. Errors are "
    "relative to the root mean square of the exact density."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw smoke between two frames, and errors over time and over the resolution of the grid."""
    points = _cells(96 if quality == "draft" else 128)
    clouds = [place_puffs(key) for key in range(KEYS)]

    def measure(flow: str, cells: int, time: float) -> dict[str, NDArray]:
        errors = {way: np.empty(KEYS) for way in WAYS}
        for key, puffs in enumerate(clouds):
            exact = density(puffs, trace_back(flow, points, time))
            for way, estimate in estimates(flow, puffs, cells, points, time).items():
                errors[way][key] = rms(estimate - exact) / rms(exact)
        return errors

    by_grid = {flow: {n: measure(flow, n, 0.5) for n in GRIDS} for flow in FLOWS}
    progress(0.5)
    by_time = {t: measure("rotation", SHOWN, t) for t in TIMES.tolist()}
    angles = np.linspace(0.1, 0.8, 8)
    # How far the middle of a chord is from the arc, in radii.
    lagrangian = abs(0.5 * (1 + np.exp(1j * angles)) - np.exp(0.5j * angles)) / angles**2
    by_motion = {
        motion: [_vertex_error(puffs, *of, points) for puffs in clouds] for motion, of in MOTIONS.items()
    }
    # Two densities, or one and a velocity.
    stored = {"interpolation": 2, "advection": 3}
    late = by_time[TIMES[-2]]
    measured: dict[str, Any] = {
        "error over acceleration of a vertex, largest over smallest": float(
            lagrangian.max() / lagrangian.min()
        ),
        "numbers per cell": stored,
        "vertices that move linearly": {name: judged.interval(of) for name, of in by_motion.items()},
    }
    claims: dict[str, Any] = {
        INCORRECT: {},
        UNRELATED: {},
        ADVECTED: {},
        RESOLVED: {},
        OFTEN: {name: judged.below(of, 0.1) for name, of in by_motion.items()},
        "at 7/8 of the time to the next frame, advection has less error": judged.smaller(
            late["advected"], late["interpolated"]
        ),
        "vertices that move linearly: the error is proportional to the acceleration, within 2 %": bool(
            np.ptp(lagrangian) < 0.02 * lagrangian.min()
        ),
        "advection needs more memory": stored["advection"] > stored["interpolation"],
    }
    for flow, of in by_grid.items():
        interpolated, advected = ([errors[way] for errors in of.values()] for way in WAYS)
        measured[flow] = {
            "interpolated": judged.interval(interpolated[-1]),
            "interpolated, finest over coarsest grid": judged.ratio(interpolated[-1], interpolated[0]),
            "advected over interpolated": judged.ratio(advected[1], interpolated[1]),
            "advected, finest over coarsest grid": judged.ratio(advected[-1], advected[0]),
        }
        claims[INCORRECT][flow] = judged.smaller(np.full(KEYS, 0.5), interpolated[-1])
        claims[UNRELATED][flow] = judged.alike(interpolated[-1], interpolated[0], 1.05)
        claims[ADVECTED][flow] = judged.smaller(advected[1], interpolated[1], 0.5)
        claims[RESOLVED][flow] = judged.smaller(advected[-1], advected[0], 0.1)
    figure = _draw(clouds[0], points, by_grid, by_time)
    progress(1.0)
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def _cells(count: int) -> Complex:
    """Return the middles of the cells of [-1, 1] x [-1, 1] as x + i y."""
    axis = (np.arange(count) + 0.5) / count * 2 - 1
    return axis + 1j * axis[:, None]


def place_puffs(key: int) -> Complex:
    """Return random places that stay inside while they turn."""
    random = np.random.default_rng(key).random((2, PUFFS))
    return 0.75 * np.sqrt(random[0]) * np.exp(2j * np.pi * random[1])


def density(puffs: Complex, place: Complex) -> NDArray[np.float64]:
    """Return the density of smoke at the first frame."""
    return np.sum([np.exp(-0.5 * (abs(place - puff) / WIDTH) ** 2) for puff in puffs], axis=0)


def velocity(flow: str, place: Complex) -> Complex:
    """Return the displacement from frame to frame that a steady flow has at a place."""
    return 1j * TURN * place if flow == "rotation" else SHEAR * np.sin(np.pi * place.imag) + 0j


def trace_back(flow: str, place: Complex, time: float) -> Complex:
    """Return where the smoke of a place was at the first frame."""
    return np.exp(-1j * TURN * time) * place if flow == "rotation" else place - time * velocity(flow, place)


def estimates(flow: str, puffs: Complex, cells: int, points: Complex, time: float) -> dict[str, NDArray]:
    """Return densities at a time between two frames of a grid, by both ways."""
    grid = _cells(cells)
    first, last = (density(puffs, trace_back(flow, grid, at)) for at in (0.0, 1.0))
    moved = velocity(flow, grid)
    moved = _read(moved.real, points) + 1j * _read(moved.imag, points)
    return {
        "interpolated": (1 - time) * _read(first, points) + time * _read(last, points),
        "advected": _read(first, points - time * moved),
    }


def _read(grid: NDArray, points: Complex) -> NDArray[np.float64]:
    """Interpolate a grid bilinearly; beyond its outer cells it is constant."""
    index = [0.5 * len(grid) * (1 + part) - 0.5 for part in (points.imag, points.real)]
    return map_coordinates(grid, index, order=1, mode="nearest")


def _vertex_error(puffs: Complex, turn: float, fall: float, points: Complex) -> float:
    """Return the relative error at half time if vertices turn, or fall from rest, and are moved linearly."""
    exact = density(puffs, points * np.exp(-0.5j * turn) - 0.25j * fall)
    moved = density(puffs, points / (0.5 + 0.5 * np.exp(1j * turn)) - 0.5j * fall)
    return rms(moved - exact) / rms(exact)


def _draw(
    puffs: Complex, points: Complex, by_grid: Mapping[str, Any], by_time: Mapping[float, Any]
) -> Figure:
    images = {"exact": density(puffs, trace_back("rotation", points, 0.5))}
    images |= estimates("rotation", puffs, SHOWN, points, 0.5)
    title = (
        "Interpolated frames show smoke twice, on any grid; advection moves it\n"
        f"thesis, Sect. 3.1.8; smoke rotating by {TURN} radians from frame to frame, {SHOWN} x {SHOWN} cells"
    )
    panels = [Panel(f"t = 1/2, {name}", 1 - image / images["exact"].max()) for name, image in images.items()]
    figure = image_grid(title, panels, 3, BELOW)
    left, right = axes_below(figure, BELOW, 2)
    for way, color in WAYS.items():
        curve(left, {t: errors[way].mean() for t, errors in by_time.items()}, Style(color, "o"), label=way)
        for flow, line in zip(FLOWS, ("-", "--"), strict=True):
            curve(right, {n: of[way].mean() for n, of in by_grid[flow].items()}, Style(color, "o", line))
    name_axes(left, "time from frame to frame", "RMS error / RMS density", legend="upper left", ncols=2)
    left.set_ylim(0, 1)
    name_axes(right, "cells along a side", "RMS error / density, t = 1/2", log="xy", ticks=GRIDS)
    for text, height, color in (
        ("interpolated, rotation and shear", 0.52, VERMILLION),
        ("advected, rotation", 0.14, BLUE),
        ("advected, shear", 0.012, BLUE),
    ):
        right.text(GRIDS[-1], height, text, color=color, ha="right", va="top")
    return figure

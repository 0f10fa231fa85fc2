"""Where single precision holds and where it breaks: points, sums and rays."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures.shared.precision import point_precision, ray_precision
from figures.shared.sheets.curves import name_axes, titled

COUNT = {"draft": (64, 2**12), "paper": (1024, 2**17)}
"""Points, pixels or indices that each error is the largest of, and rays of each case."""
TOP = {"draft": 14, "paper": 20}
"""Of the powers of 2 that are summed."""

BROKEN = 0.01
"""An error of values in [0, 1] that an image shows."""
ALLOWED = 1e-3
"""A part of the rays that an image shows."""

DOCUMENTED = 1e3, 0.03
"""Distance, in sizes of a body, and the part of the rays that may go wrong there as `nearest_hit` says."""
MESH, ALONE = (1e-8, 1e8), (1e-6, 1e2)
"""Sizes between which no ray is lost: of a mesh, seen from as far, and of a triangle, seen from 1 at most."""

LEAVING, ENTERING = "Rays that leave a body hit it again", "Rays that enter a body are lost in it"
SIZE = "Rays miss a small or huge body"

COLUMNS = 2

Curves = dict[str, dict[float, float]]


class Panel(NamedTuple):
    """What is measured, its axes, and from which error on an image shows it."""

    measure: Callable[[], Curves]
    x: str
    y: str
    limit: float | None = None


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all, and draw errors over what is stressed."""
    count, rays = COUNT[quality]
    of_points = {
        "Points": Panel(partial(point_precision.points, count), "index", "error / $2^{-24}$"),
        "Offsets in pixels": Panel(
            partial(point_precision.offsets, count), "pixels along a side", "error / $2^{-24}$ of a pixel"
        ),
        "Sums": Panel(
            partial(point_precision.sums, TOP[quality]), "samples per pixel", "error / unit in the last place"
        ),
        "Frequencies": Panel(
            partial(point_precision.frequencies, count), "frequency", "error of values in [0, 1]", BROKEN
        ),
        "Dimensions": Panel(
            partial(point_precision.dimensions, count), "dimensions", "relative error / $2^{-24}$"
        ),
    }
    part, away = "part of the rays", "distance from the origin / size of the body"
    of_rays = {
        LEAVING: Panel(partial(ray_precision.leaving, rays, 1.0), away, part, ALLOWED),
        ENTERING: Panel(partial(ray_precision.leaving, rays, -1.0), away, part, ALLOWED),
        SIZE: Panel(partial(ray_precision.sizes, rays), "size", part, ALLOWED),
        "Grazing rays at a plane": Panel(
            partial(ray_precision.grazing, rays), "slope of the rays", "relative error of distances"
        ),
        "Images with direct light": Panel(
            partial(ray_precision.pictures, rays), away, "RMS difference to float64 / mean", BROKEN
        ),
    }
    panels = of_points | of_rays
    figure = titled(
        "Single precision holds for points and sums; frequencies, and rays far from the origin, need double\n"
        "dashed: errors that an image shows; errors of 0 are drawn at the bottom",
        11,
        19,
    )
    axes = figure.subplots(len(panels) // COLUMNS, COLUMNS).ravel()
    measured: dict[str, Curves] = {}
    for done, (ax, (name, panel)) in enumerate(zip(axes, panels.items(), strict=True), start=1):
        measured[name] = panel.measure()
        _draw(ax, name, panel, measured[name])
        progress(done / len(panels))
    broken = {
        name: {label: _first(curve, panel.limit) for label, curve in measured[name].items()}
        for name, panel in panels.items()
        if panel.limit is not None
    }
    return figure, {
        "measured": {
            name: {label: {f"{at:g}": error for at, error in of.items()} for label, of in curves.items()}
            for name, curves in measured.items()
        }
        | {"an image shows errors from": broken}
        | _documented(measured),
        "note": f"{point_precision.NOTE.format(count=count)} {ray_precision.NOTE.format(count=rays)}",
    }


def _draw(axes: Axes, name: str, panel: Panel, curves: Curves) -> None:
    """Draw curves, those in double precision dotted in the colours of the same in single precision."""
    positive = [error for of in curves.values() for error in of.values() if error > 0]
    zero = 0.1 * min([*positive, panel.limit or np.inf])
    colors: dict[str, str] = {}
    for label, curve in curves.items():
        color = colors.setdefault(label.replace(", float64", ", float32"), f"C{len(colors)}")
        line = ":" if label.endswith(", float64") else "-"
        values = np.maximum(list(curve.values()), zero)
        axes.plot(list(curve), values, "o", ls=line, color=color, ms=3, label=label)
    if panel.limit is not None:
        axes.axhline(panel.limit, color="0.5", ls="--", lw=0.8, zorder=0)
    below = (0.5, -0.2)
    name_axes(axes, panel.x, panel.y, name, log="xy", legend="upper center", bbox_to_anchor=below, ncols=2)


def _documented(measured: Mapping[str, Curves]) -> dict[str, bool]:
    """Return whether rays are as safe as the documentation says."""
    far, most = DOCUMENTED
    near = [
        part
        for name in (LEAVING, ENTERING)
        for curve in measured[name].values()
        for away, part in curve.items()
        if away <= far
    ]

    def lost(body: str, sizes: tuple[float, float]) -> float:
        of = measured[SIZE]
        curves = (curve for label, curve in of.items() if label.startswith(body))
        return max(part for curve in curves for size, part in curve.items() if sizes[0] <= size <= sizes[1])

    return {
        f"at most {most:.0%} of the rays are wrong up to {far:g} sizes away": max(near) <= most,
        f"no ray misses an edge of a mesh of size {MESH[0]:g} to {MESH[1]:g}": lost("mesh", MESH) == 0,
        f"no ray misses a lone triangle of size {ALONE[0]:g} to {ALONE[1]:g}, or meets it again": (
            lost("lone triangle", ALONE) == 0
        ),
    }


def _first(curve: Mapping[float, float], limit: float) -> float | None:
    """Return the first place where errors are above a limit."""
    return next((at for at, error in curve.items() if error > limit), None)

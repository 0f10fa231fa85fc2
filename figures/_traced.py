"""Rendered scenes: images by few compiled programs, their references and errors, and sheets with crops."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from qmcjax import samplers, scenes, sequences
from qmcjax.core.pytrees import jit

DPI = 150
GAP = 10

POINTS = 2**14
"""Points in one call of a scene: its compiled program serves all samplers, counts and image sizes."""

REPLICATES = 16

DEVIATIONS = 5
"""Standard errors in the bound of a stored reference."""


class Reference(NamedTuple):
    image: NDArray[np.float64]
    error: float
    """Root mean square of its standard errors."""
    origin: str


@jit()
def _values(scene: Any, points: Array) -> Array:
    return scene(points)


def image(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    """Return what `qmcjax.render` does, by a program that knows nothing of the sampler.

    Compiling a scene takes longer than a small image of it: here once, not once for each class of samplers.
    """
    sampler.check(side, side, spp)
    together = max(1, POINTS // side**2)
    rows, columns = np.divmod(np.arange(side**2, dtype=np.uint32), np.uint32(side))
    x, y = jnp.asarray(columns)[:, None], jnp.asarray(rows)[:, None]
    total = np.zeros((side**2, 3))
    for first in range(0, spp, together):
        samples = jnp.arange(first, min(first + together, spp), dtype=jnp.uint32)
        points = np.array(sampler(x, y, samples, tuple(range(len(scene.needs)))))
        points[..., 0] = (points[..., 0] + columns[:, None]) / side
        points[..., 1] = (points[..., 1] + rows[:, None]) / side
        total += _evaluated(scene, points).sum(axis=1)
    return (total / spp).reshape(side, side, 3)


def _evaluated(scene: Any, points: NDArray) -> NDArray[np.float64]:
    """Evaluate a scene at points of any shape, in calls of one size."""
    flat = points.reshape(-1, points.shape[-1])
    calls = np.pad(flat, ((0, -len(flat) % POINTS), (0, 0)), mode="edge").reshape(-1, POINTS, flat.shape[1])
    values = np.concatenate([np.asarray(_values(scene, jnp.asarray(call)), np.float64) for call in calls])
    return values[: len(flat)].reshape(*points.shape[:-1], 3)


@cache
def reference(name: str, side: int, spp: int) -> Reference:
    """Return the stored reference of a scene of the package, or else estimate it from replicates."""
    scene = getattr(scenes, name)()
    try:
        stored, bound = scene.reference(side, side)
    except ValueError:
        images = [
            image(scene, samplers.independent(sequences.sobol(len(scene.needs)), 2**20 + k), side, spp)
            for k in range(REPLICATES)
        ]
        error = np.std(images, axis=0, ddof=1) / np.sqrt(REPLICATES)
        origin = f"estimated from {REPLICATES} Owen-scrambled Sobol' replicates of {spp} samples per pixel"
        return Reference(np.mean(images, axis=0), _rms(error), origin)
    return Reference(stored, _rms(bound) / DEVIATIONS, "stored with the package")


def rms_error(found: NDArray, exact: Reference) -> float:
    """Return the RMS error over pixels and colours, without the reference's: no less than that.

    Errors of both are independent, so their squares add.
    """
    square = np.mean(np.square(found - exact.image)) - exact.error**2
    return float(np.sqrt(max(square, exact.error**2)))


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def shown(values: NDArray) -> NDArray[np.float64]:
    """Return linear RGB as a screen wants it: cut off at 1, with the transfer curve of sRGB."""
    linear = np.clip(values, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


class Panel(NamedTuple):
    caption: str
    image: NDArray
    crop: tuple[float, float, float]
    """The left and upper edge and the side of the magnified area, in parts of the image."""


def sheet(panels: Sequence[Panel], columns: int, title: str, size: int) -> Figure:
    """Lay images out with their magnified areas on their right, both enlarged to ``size`` pixels a side."""
    rows, head, top = -(-len(panels) // columns), 44, 40
    cell = 2 * size + 3 * GAP
    width, height = columns * cell, rows * (size + head + GAP) + top
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    figure.suptitle(title, y=1 - 14 / height, fontsize=10)
    for k, panel in enumerate(panels):
        row, column = divmod(k, columns)
        y = height - top - (row + 1) * (size + head + GAP) + GAP
        side = len(panel.image)
        left, upper, part = (round(c * side) for c in panel.crop)
        for j, pixels in enumerate((panel.image, panel.image[upper : upper + part, left : left + part])):
            x = column * cell + GAP + j * (size + GAP)
            axes = figure.add_axes((x / width, y / height, size / width, size / height))
            axes.imshow(shown(pixels), interpolation="nearest")
            axes.set_axis_off()
            if j == 0:
                axes.set_title(panel.caption, fontsize=8, pad=3, loc="left")
                axes.add_patch(
                    Rectangle((left - 0.5, upper - 0.5), part, part, fill=False, color="tab:red", lw=0.8)
                )
    return figure


def fluctuation(errors: Mapping[int, float]) -> float:
    """Return how far errors are from a power law of the number of samples, root mean square of logarithms."""
    x, y = np.log(list(errors)), np.log(list(errors.values()))
    return _rms(y - np.polyval(np.polyfit(x, y, 1), x))


def slope(errors: Mapping[int, float]) -> float:
    """Return the exponent of the power law that fits errors best."""
    return float(np.polyfit(np.log(list(errors)), np.log(list(errors.values())), 1)[0])

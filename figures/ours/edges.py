"""Derivatives by samples on an edge alone: those of a disc's image with respect to its radius."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures._errors import rms
from figures.shared.image_grid import DPI, GAP, Panel, add_axes, image_grid
from qmcjax import scenes, sequences


class Size(NamedTuple):
    """How much is measured."""

    keys: int
    counts: tuple[int, ...]


SIZES = {"draft": Size(1, (2**10, 2**13)), "paper": Size(8, tuple(2**k for k in range(8, 21, 2)))}
SIDE = 64
ZOOM = 7
KINDS: dict[str, Callable[[int], sequences.Sequence]] = {
    "random": lambda key: sequences.uniform(1, key),
    "van der Corput, Owen": lambda key: sequences.owen(sequences.van_der_corput(), key),
}

NOTE = (
    "The derivative of the mean of each of {side} x {side} pixels with respect to the disc's radius, by "
    "points on its edge; RMS error over pixels and {keys} keys."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw derivatives and an error, and errors over the number of points."""
    size = SIZES[quality]
    scene = scenes.disc()
    exact = np.asarray(scene.reference_gradient(SIDE, SIDE)[0].radius, np.float64)
    largest = float(abs(exact).max())

    def estimated(sequence: sequences.Sequence, n: int) -> NDArray[np.float64]:
        return np.asarray(qj.boundary_gradient(scene, sequence, SIDE, SIDE, n).radius, np.float64)

    errors: dict[str, dict[str, float]] = {}
    for done, (kind, make_one) in enumerate(KINDS.items(), start=1):
        errors[kind] = {}
        for n in size.counts:
            images = [estimated(make_one(key), n) for key in range(size.keys)]
            errors[kind][str(n)] = rms(np.stack(images) - exact)
        progress(done / len(KINDS))
    figure = _drawn(exact, estimated, errors, size.counts, largest)
    return figure, {
        "measured": {
            "rms error": errors,
            "random over van der Corput": {
                n: errors["random"][n] / errors["van der Corput, Owen"][n] for n in errors["random"]
            },
            "largest derivative": largest,
        },
        "note": NOTE.format(side=SIDE, keys=size.keys),
    }


def _drawn(
    exact: NDArray[np.float64],
    estimated: Callable[[sequences.Sequence, int], NDArray[np.float64]],
    errors: dict[str, dict[str, float]],
    counts: tuple[int, ...],
    largest: float,
) -> Figure:
    """Draw the exact derivatives, those by each kind of points, and errors over their number."""
    n = counts[len(counts) // 2]
    panels = [Panel(f"exact\nblack 0, white {largest:.2g}", exact, (0.0, largest))]
    for kind, make_one in KINDS.items():
        caption = f"{kind}, {n} points on the edge\nRMS error {errors[kind][str(n)]:.2g}"
        panels.append(Panel(caption, estimated(make_one(0), n), (0.0, largest)))
    title = f"Derivatives of {SIDE} x {SIDE} pixels by the radius of a disc"
    figure = image_grid(title, panels, len(panels), ZOOM * SIDE, below=480)
    axes = add_axes(figure, 110, 80, figure.get_size_inches()[0] * DPI - 110 - 3 * GAP, 380)
    for (kind, of), marker, color in zip(errors.items(), ".o", ("C6", "C0"), strict=True):
        axes.loglog(counts, list(of.values()), color=color, marker=marker, ms=5, label=kind)
    axes.set(xlabel="points on the edge", ylabel="RMS error of the derivative", xticks=counts)
    axes.set_xticks(counts, [f"{count}" for count in counts])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    return figure

"""Hilbert paper Fig. 1: the Morton and the Hilbert curve, and their segments in 3x3 neighbourhoods."""

from collections.abc import Callable

import jax.numpy as jnp
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import analysis
from qmcjax import orders

CURVES = {"Morton": orders.morton, "Hilbert": orders.hilbert}
SHOWN = 16
"""Side of the pixel grid that is drawn."""

COUNTED = 512
"""Side of the pixel grid that the histogram is of."""

NOTE = (
    "A segment is a maximal run of consecutive positions among a neighbourhood's 9 pixels. Only interior "
    "pixels, whose neighbourhood lies in the image, are counted; the picture shows the clipped counts at the "
    "border too. The paper's sentence compares four curves; Moore and Peano are not in this figure."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both curves with the number of segments in every pixel, and the histogram of a larger grid."""
    del quality  # Exact, and quick at full size.
    figure = Figure(figsize=(15, 5.4), layout="constrained")
    *panels, histogram = figure.subplots(1, 3)
    measured = {}
    for (name, make_order), axes in zip(CURVES.items(), panels, strict=True):
        _draw_curve(axes, make_order(SHOWN, SHOWN), name)
        counts = analysis.segment_counts(make_order(COUNTED, COUNTED))[1:-1, 1:-1]
        values, numbers = np.unique(counts, return_counts=True)
        offset = 0.4 * list(CURVES).index(name) - 0.2
        histogram.bar(values + offset, numbers / counts.size, 0.4, label=f"{name}, mean {counts.mean():.2f}")
        measured[name] = {
            "maximum": int(counts.max()),
            "mean": float(counts.mean()),
            "histogram": {str(v): int(n) for v, n in zip(values, numbers, strict=True)},
        }
        progress(len(measured) / len(CURVES))
    histogram.set(
        xlabel="segments in the 3x3 neighbourhood",
        ylabel="part of the interior pixels",
        title=f"{COUNTED} x {COUNTED} pixels",
    )
    histogram.set_xticks(range(1, 7))
    histogram.legend()
    figure.suptitle(
        "Space-filling curves and the segments that enter a 3x3 neighbourhood (Hilbert paper, Fig. 1)"
    )
    claim = {
        "the maximum is smaller for Hilbert than for Morton": _maximum(measured, "Hilbert")
        < _maximum(measured, "Morton")
    }
    return figure, {"measured": measured, "printed": claim, "note": NOTE}


def _maximum(measured: dict, name: str) -> int:
    return measured[name]["maximum"]


def _draw_curve(axes: Axes, order: orders.Order, name: str) -> None:
    counts = analysis.segment_counts(order)
    axes.imshow(counts, cmap="Greens", vmin=0, vmax=8, alpha=0.6)
    x, y = (np.asarray(c).astype(int) for c in order.pixel(jnp.arange(order.length, dtype=jnp.uint32)))
    axes.plot(x, y, color="0.55", lw=1)
    interior = counts[1:-1, 1:-1]
    row, column = (int(c) + 1 for c in np.unravel_index(interior.argmax(), interior.shape))
    axes.add_patch(Rectangle((column - 1.5, row - 1.5), 3, 3, fill=False, color="darkgreen", lw=2))
    inside = np.flatnonzero((abs(x - column) <= 1) & (abs(y - row) <= 1))
    for k, run in enumerate(np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)):
        axes.plot(x[run], y[run], "o-", color=matplotlib.colormaps["tab10"](k), lw=3, ms=4)
    for (v, u), count in np.ndenumerate(counts):
        axes.text(u + 0.32, v + 0.36, str(count), fontsize=6, ha="center", va="center")
    axes.set(
        title=f"{name}: {counts[row, column]} segments in the marked neighbourhood", xticks=[], yticks=[]
    )

"""Point sets in the unit square, drawn with the boxes that stratify them."""

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._rc import COLUMN, PAGE
from figures.shared.sheets.panels import new_figure
from qmcjax.sequences import BinarySequence, Sequence


def panels(
    count: int, title: str, columns: int | None = None, shape: float = 1.0
) -> tuple[Figure, list[Axes]]:
    """Return a figure with a row, or rows, of panels, ``shape`` times as high as wide."""
    columns = columns or count
    rows = -(-count // columns)
    width = COLUMN if columns == 1 else PAGE
    figure = new_figure(title, (shape * width / columns + 0.3) * rows + 0.5, width)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for unused in axes[count:]:
        unused.set_axis_off()
    return figure, list(axes[:count])


def grid(axes: Axes, columns: int, rows: int, **style) -> None:
    """Draw the borders of ``columns`` times ``rows`` equal boxes."""
    style = {"color": "0.75", "lw": 0.6, "zorder": 0} | style
    for count, draw in ((columns, axes.axvline), (rows, axes.axhline)):
        for k in range(1, count):
            draw(k / count, **style)


def scatter(axes: Axes, points: NDArray, title: str = "", **style) -> None:
    """Draw points of the half-open unit square, y upward as in the thesis."""
    plot.points(points, title=title, ax=axes, **style)


def block(sequence: Sequence, n: int, start: int = 0) -> NDArray[np.float64]:
    """Return points as float64."""
    return np.asarray(sequence.points(n, start, dtype=jnp.float64))


def words(net: BinarySequence, m: int) -> NDArray[np.int64]:
    """Return the first 2**m points on the integer grid of that side."""
    return np.asarray(net.bits(jnp.arange(2**m, dtype=jnp.uint32))).astype(np.int64) >> (32 - m)


def holds_one_each(points: NDArray, m: int) -> bool:
    """Tell, by counting, whether each elementary interval of area 2**-m holds one point."""
    counts = (analysis.interval_counts(points, (i, m - i)) for i in range(m + 1))
    return all(bool((each == 1).all()) for each in counts)

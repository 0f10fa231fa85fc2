"""Z paper Fig. 2: the Morton order of 8 x 8 pixels, in binary and in base 4."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._rc import VERMILLION
from figures.shared.sheets.curve_tables import curve_of
from figures.shared.sheets.panels import new_figure
from qmcjax import orders

BITS = 3
SIDE = 2**BITS


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Write the index into each pixel, y upward, over a gradient from the first to the last."""
    index = curve_of(orders.morton(SIDE, SIDE)).positions
    binary = np.vectorize(lambda i: format(i, f"0{2 * BITS}b"))(index)
    quaternary = np.vectorize(lambda i: np.base_repr(i, 4).zfill(BITS))(index)

    figure = new_figure(
        "The Morton order interleaves the bits of row and column\nZ paper, Fig. 2; 8 x 8 pixels", 5.3
    )
    panels = figure.subplots(1, 2, width_ratios=(1.8, 1))
    write(panels[0], index, binary, r"binary: $y_2 x_2 y_1 x_1 y_0 x_0$", 1)
    write(panels[1], index, quaternary, "base 4: a digit per level of quadrants", 2)
    labels = [format(i, f"0{BITS}b") for i in range(SIDE)]
    panels[0].set(xlabel="x", ylabel="y", xticks=range(SIDE), yticks=range(SIDE))
    panels[0].set_xticklabels(labels)
    panels[0].set_yticklabels(labels)
    return figure, {
        "measured": {
            "from left to right, then bottom to top in each block of 2 x 2": index[:2, :2].ravel().tolist()
        },
        "claims": _claims(index, binary, quaternary),
    }


def write(axes: Axes, index: NDArray[np.int64], texts: NDArray, title: str, cell: int) -> None:
    """Shade pixels from black, the first, to white, the last; thick lines bound cells of so many pixels."""
    side = len(index)
    axes.imshow(index, cmap="gray", origin="lower")
    for (y, x), text in np.ndenumerate(texts):
        dark = index[y, x] < side**2 / 2
        axes.text(x, y, text, ha="center", va="center", color="white" if dark else "black")
    for edge in range(0, side + 1, cell):
        width = 2.5 if edge % (side // 2) == 0 else 1
        axes.axhline(edge - 0.5, color=VERMILLION, lw=width)
        axes.axvline(edge - 0.5, color=VERMILLION, lw=width)
    axes.set(title=title, xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _claims(index: NDArray[np.int64], binary: NDArray, quaternary: NDArray) -> dict:
    y, x = (np.vectorize(lambda i: format(i, f"0{BITS}b"))(axis) for axis in np.indices(index.shape))
    interleaved = [
        "".join(a + b for a, b in zip(*pair, strict=True)) for pair in zip(y.flat, x.flat, strict=True)
    ]
    blocks = {}
    for digits in range(1, BITS + 1):
        side = SIDE >> digits
        leading = np.vectorize(lambda text, digits=digits: int(text[:digits], 4))(quaternary)
        cells = leading.reshape(SIDE // side, side, SIDE // side, side)
        blocks[f"{digits} digit{'s' * (digits > 1)}"] = (
            bool(np.all(cells == cells[:, :1, :, :1])) and len(np.unique(leading)) == 4**digits
        )
    return {
        "the index is y2 x2 y1 x1 y0 x0": interleaved == binary.ravel().tolist(),
        "all pixels of a block share its leading base 4 digits, and no others do": blocks,
    }

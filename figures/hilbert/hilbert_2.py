"""Hilbert paper Fig. 2: differences of positions between neighbouring pixels, over radical inverses."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures._rc import BLUE, VERMILLION
from figures.making.schema import Claims
from figures.shared.sheets.curve_tables import CURVES, Curve, enumerate_pixels, square
from figures.shared.sheets.panels import new_figure
from qmcjax import sequences

SHOWN = (8, 9)
"""Sides of the pixel grids that are drawn, in base 2 and 3."""

COUNTED = (64, 81)
"""Sides of the pixel grids that are measured: those of Fig. 3."""

BASES = (2, 3, 5)

PANELS = (
    ("Morton", 2, "stripes"),
    ("Hilbert", 2, "a checkerboard"),
    ("Peano", 2, "symmetric"),
    ("Hilbert", 3, "many 3s"),
    ("Moore", 3, "many 3s"),
    ("Peano", 3, "rows of 3s"),
)
"""The curves and bases that are drawn, of all that are measured, and what there is to see."""

EVEN_COLUMNS = "phi_2 < 1/2 in even columns, >= 1/2 in odd ones"
ROW_BIT = "second bit of the position is that of the row"
CHECKERBOARD = "phi_2 < 1/2 in one colour of a checkerboard"
FREQUENT = "the most frequent differences above 1"
MIRRORED = "correlation with the image mirrored at the diagonal"
ACROSS = "correlation of phi_3 across edges"
MULTIPLES = "share of the differences above 1 that are multiples of"
LINES = "multiples of 3 on every second line, and on the others"

BOX = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}

NOTE = (
    "The numbers are differences of positions above 1; where they are multiples of the base, the radical "
    "inverses share their leading digit. Stripes are such lines as between the first and the second "
    "column, in the middle of blocks of 2 x 2 pixels, where all differences are 1 or 3. The measurements "
    "use larger grids, 64 x 64 and 81 x 81 pixels, and compare each edge with its mirror image. The "
    "symmetries are exact from left to right for Morton, Hilbert and Moore, and under a half turn for "
    "Peano. About the diagonal, Peano's shades are strongly symmetric for phi_2, whose leading bit forms "
    "a checkerboard, and weakly for phi_3 and phi_5; a quarter of its differences equal those of the "
    "mirrored edges, fewer than for Hilbert and Moore. Panels that are not drawn are measured, too."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the curves over their radical inverses, with the differences on the shared edges."""
    figure = new_figure(
        "Many neighbours on the Hilbert curve differ by 3, a base of the Halton sequence\n"
        "Hilbert paper, six of the twelve panels of Fig. 2; grey: radical inverses\n"
        "numbers: differences of positions across edges (1 is left out), orange: multiples of the base",
        5.6,
    )
    for axes, (name, base, caption) in zip(figure.subplots(2, 3).flat, PANELS, strict=True):
        _draw(axes, square(name, *SHOWN), base)
        axes.set_title(rf"{name}, $\phi_{base}$: {caption}")
    progress(0.5)
    measured = {name: _measure(square(name, *COUNTED)) for name in CURVES}
    return figure, {"measured": measured, "claims": _claims(measured), "note": NOTE}


def _draw(axes: Axes, curve: Curve, base: int) -> None:
    axes.imshow(enumerate_pixels(curve, sequences.van_der_corput(base)), cmap="gray", vmin=-0.3, vmax=1)
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    axes.plot(*curve.path(), color=BLUE, lw=1.5, alpha=0.7)
    for differences, step in zip(analysis.neighbour_differences(curve), ((0.5, 0), (0, 0.5)), strict=True):
        for v, u in np.argwhere(differences > 1):
            bold: dict[str, Any] = {"color": VERMILLION, "weight": "bold"}
            look = bold if differences[v, u] % base == 0 else {}
            text = str(differences[v, u])
            axes.text(u + step[0], v + step[1], text, fontsize=8, ha="center", va="center", bbox=BOX, **look)


def _measure(curve: Curve) -> dict:
    differences = _all_differences(curve.positions)
    others = differences[differences > 1]
    values, numbers = np.unique(others, return_counts=True)
    frequent = np.argsort(-numbers, kind="stable")[:5]
    images = {base: enumerate_pixels(curve, sequences.van_der_corput(base)) for base in BASES}
    halves = images[2] < 0.5
    y, x = np.indices(halves.shape)
    return {
        "edges": len(differences),
        "edges with a difference of 1": int(np.count_nonzero(differences == 1)),
        FREQUENT: {str(values[k]): int(numbers[k]) for k in frequent},
        MULTIPLES: {str(base): float(np.mean(others % base == 0)) for base in BASES},
        LINES: [_multiples_on_lines(curve, first) for first in (0, 1)],
        EVEN_COLUMNS: bool(np.all(halves == (x % 2 == 0))),
        ROW_BIT: bool(np.all(curve.positions >> 1 & 1 == y % 2)),
        CHECKERBOARD: bool(np.all(halves == ((x + y) % 2 != halves[0, 0]))),
        ACROSS: _correlate_across(curve, images[3]),
        MIRRORED: {
            f"phi_{base}": float(np.corrcoef(image.ravel(), image.T.ravel())[0, 1])
            for base, image in images.items()
        },
        "share of the edges whose difference stays": {
            motion: float(np.mean(differences == _all_differences(moved)))
            for motion, moved in _moved(curve.positions).items()
        },
    }


def _correlate_across(curve: Curve, image: NDArray[np.float64]) -> dict[str, float]:
    """Return the correlation of the two pixels at edges, by the differences of their positions."""
    differences = _all_differences(curve.positions)
    first, second = (
        np.concatenate([part.ravel() for part in parts])
        for parts in ((image[:, :-1], image[:-1]), (image[:, 1:], image[1:]))
    )
    multiple = differences % 3 == 0
    edges = {"3": differences == 3, "multiples of 3": multiple, "others": ~multiple & (differences > 1)}
    return {name: float(np.corrcoef(first[at], second[at])[0, 1]) for name, at in edges.items()}


def _multiples_on_lines(curve: Curve, first: int) -> float:
    """Return the share of multiples of 3 among differences above 1, on every second line between pixels."""
    across, down = analysis.neighbour_differences(curve)
    on_lines = np.concatenate([lines[first::2].ravel() for lines in (across.T, down)])
    return float(np.mean(on_lines[on_lines > 1] % 3 == 0))


def _all_differences(positions: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([d.ravel() for d in analysis.neighbour_differences(Curve(positions))])


def _moved(positions: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    return {
        "mirrored left to right": positions[:, ::-1],
        "mirrored top to bottom": positions[::-1],
        "mirrored at the diagonal": positions.T,
        "mirrored at the other diagonal": positions[::-1, ::-1].T,
        "turned by a half": positions[::-1, ::-1],
    }


def _claims(measured: dict) -> Claims:
    binary, morton = ("Hilbert", "Moore"), measured["Morton"]
    return {
        "the Morton index is either odd or even per column: phi_2 < 1/2 in even columns": morton[
            EVEN_COLUMNS
        ],
        "its second bit is on and off along the rows": morton[ROW_BIT],
        "curves in base 2 show a checkerboard": {
            name: measured[name][CHECKERBOARD] for name in ("Morton", *binary)
        },
        "symmetries along the diagonal for Peano: a correlation above 0.5 with the mirrored image": {
            name: found > 0.5 for name, found in measured["Peano"][MIRRORED].items()
        },
        "differences have symmetries: more than half stay under some motion": {
            name: max(of["share of the edges whose difference stays"].values()) > 0.5
            for name, of in measured.items()
        },
        "many neighbours differ by 3 on the Hilbert curve: no other difference above 1 is as frequent": (
            next(iter(measured["Hilbert"][FREQUENT])) == "3"
        ),
        "phi_3 correlates across multiples of 3, more than a third of the differences": {
            name: measured[name][MULTIPLES]["3"] > 1 / 3 and measured[name][ACROSS]["multiples of 3"] > 0.5
            for name in binary
        },
        "stripes: on every second line all differences above 1 are multiples of 3, elsewhere under half": {
            name: measured[name][LINES][0] == 1 and measured[name][LINES][1] < 0.5 for name in binary
        },
        "phi_3 correlates where positions differ by 3: above 0.5": measured["Hilbert"][ACROSS]["3"] > 0.5,
    }

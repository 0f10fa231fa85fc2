"""Thesis Fig. 5.6 to 5.8: matrices that generate (0,2)-sequences, and their points."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures.shared.sheets import point_plots
from figures.shared.sheets.curves import titled
from qmcjax import sequences

ORDER, M = 16, 7
TARGET, SEED, STEPS = 97, 0, 5000
SQUARED = "squared distance on the integer grid"
NETS = {
    "Larcher-Pillichshammer": sequences.larcher_pillichshammer_net,
    "Hammersley": sequences.hammersley_net,
    "permutation": sequences.permutation_net,
    "optimized": sequences.optimized_net,
    "rank-1 lattice": lambda m: sequences.rank1_lattice(2**m, 2),
}
NOTE = (
    "Each (0,2)-sequence in base 2 has C_1 = L_1 U and C_2 = L_2 P U, P Pascal's triangle modulo 2, L lower "
    "and U upper triangular. The last come from a search. In print they are pictures: these are others."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the matrices, dark where they are zero, above the first 2**7 points."""
    m = 12 if quality == "paper" else 8
    star = {name: analysis.star_discrepancy(point_plots.block(net(m), 2**m)) for name, net in NETS.items()}
    index = np.arange(ORDER)
    pascal = (index[:, None] & index == index[:, None]).astype(int)
    ones = np.triu(np.ones((ORDER, ORDER), int))
    pairs = {
        "I,  P  (Sobol')": (np.eye(ORDER, dtype=int), pascal),
        "U,  P U  (modified, C'1, C'2)": (ones, pascal @ ones % 2),
        "I,  P$^T$ P": (np.eye(ORDER, dtype=int), pascal.T @ pascal % 2),
        "U,  U$^T$ P U": (ones, ones.T @ pascal @ ones % 2),
        "P$^T$ U,  U$^T$ P U": (pascal.T @ ones % 2, ones.T @ pascal @ ones % 2),
    }
    progress(0.1)
    found = analysis.search_matrices({M: TARGET}, dims=2, seed=SEED, steps=STEPS)
    pairs["searched, order 7 (Fig. 5.6)"] = (found.matrices[0].astype(int), found.matrices[1].astype(int))

    figure = titled(
        "Matrices of (0,2)-sequences, zeros dark, U all ones, and 128 points (thesis Fig. 5.6 to 5.8)",
        16,
        8.6,
    )
    axes = figure.subplots(3, len(pairs))
    measured: dict[str, dict] = {}
    is_net: dict[str, bool] = {}
    for column, (name, pair) in zip(axes.T, pairs.items(), strict=True):
        for axis, matrix, label in zip(column, pair, ("$C_1$", "$C_2$"), strict=False):
            draw_matrix(axis, matrix, label)
        points = _first_points(pair)
        squared = analysis.squared_min_distance(points, side=2**M)
        column[0].set_title(name, fontsize=10)
        point_plots.scatter(column[2], points / 2**M, f"squared distance {squared} / $2^{{{2 * M}}}$")
        measured[name.replace("$", "")] = {SQUARED: squared}
        is_net[name.replace("$", "")] = point_plots.holds_one_each(points / 2**M, M)
    return figure, {
        "measured": {f"the first 2**{M} points": measured, "star discrepancy": {"points": 2**m, **star}},
        "claims": {
            "the matrices generate (0,2)-sequences: the first 2**7 points are a net": is_net,
            "the Larcher-Pillichshammer net has less star discrepancy than other nets and lattices": {
                name: star["Larcher-Pillichshammer"] < other for name, other in list(star.items())[1:]
            },
            "a search finds matrices of a larger distance than those with a pattern": found.reached
            and max(of[SQUARED] for of in list(measured.values())[:-1]) < TARGET,
        },
        "note": NOTE,
    }


def draw_matrix(axes: Axes, matrix: NDArray, label: str) -> None:
    """Draw a matrix over F2, its first row on top, zeros dark."""
    axes.imshow(matrix, cmap="gray", vmin=-0.3, vmax=1, interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(True)
    axes.set_ylabel(label, rotation=0, ha="right", va="center")


def _first_points(matrices: tuple[NDArray, NDArray]) -> NDArray[np.int64]:
    """Return the first 2**M points, cut off after M digits, as integers."""
    digits = (np.arange(2**M) >> np.arange(M)[:, None]) & 1
    weights = 2 ** np.arange(M - 1, -1, -1)
    return np.stack([weights @ (matrix[:M, :M] @ digits % 2) for matrix in matrices], axis=1)

"""Generator matrices of (0,2)-sequences, and distances of (0,m,3)-nets of them (Fig. 5.5 to 5.9)."""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._errors import residual
from figures.shared.sheets import point_plots
from figures.shared.sheets.panels import curve, name_axes, new_figure
from qmcjax import sequences

NETS_5_5 = {"Sobol'": sequences.sobol_net_3d, "modified (C'1, C'2)": sequences.larcher_pillichshammer_net_3d}
STYLES = dict(zip(NETS_5_5, map(plot.style, ("Sobol' net", "modified Sobol' net")), strict=True))
PRINTED = {"Sobol'": 0.00358812, "modified (C'1, C'2)": 0.00926449}  # m = 13, caption of Fig. 5.9


def thesis_5_5(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Plot the toroidal distances over m."""
    sizes = range(1, 24 if quality == "paper" else 17)
    squared: dict[str, list[int]] = {name: [] for name in NETS_5_5}
    for m in sizes:
        for name, net in NETS_5_5.items():
            points = point_plots.words(net(m), m)
            squared[name].append(analysis.squared_min_distance(points, side=2**m))
        progress(2.0 ** (m - sizes[-1]))
    distances = {name: np.sqrt(values) / 2.0 ** np.array(sizes) for name, values in squared.items()}

    title = (
        "The modified net's minimum distance shrinks more smoothly than the Sobol' net's\n"
        "thesis, Fig. 5.5; (0,m,3)-nets"
    )
    figure = new_figure(title, 4.0)
    draw_distances(figure.subplots(), sizes, distances, STYLES)
    not_ahead = [m for m, a, b in zip(sizes, *squared.values(), strict=True) if b <= a]
    roughness = {name: residual(np.log(values)) for name, values in distances.items()}
    plain, modified = roughness.values()
    numbers = {
        "measured": {
            "squared distance on the integer grid": {
                name: dict(zip(map(str, sizes), values, strict=True)) for name, values in squared.items()
            },
            "distance at m = 13": {name: float(values[12]) for name, values in distances.items()},
            "modified is not ahead at m": not_ahead,
            "distance of logarithms from a straight line, root mean square": roughness,
        },
        "printed": {"distance at m = 13": PRINTED, "modified is not ahead at m": [5, 6]},
        "claims": {
            "the modified net is ahead, except for m = 5 and 6": {
                f"m = {m}": (m in not_ahead) == (m in (5, 6)) for m in sizes
            },
            "the distances at m = 13 are those printed": {
                name: abs(float(distances[name][12]) - value) < 0.6e-8 for name, value in PRINTED.items()
            },
            "the modified net's distance decreases smoothly, unlike that of the Sobol' net": (
                modified < 0.5 * plain
            ),
        },
        "note": "At m = 1 and 2 both nets have the same distance. The thesis goes up to m = 23, "
        "and so does paper quality; a draft goes to 16.",
    }
    return figure, numbers


def draw_distances(
    axes: Axes, sizes: range, distances: Mapping[str, NDArray], styles: Mapping[str, plot.Style]
) -> None:
    """Draw the distances of nets of 2**m points over m."""
    for name, values in distances.items():
        curve(axes, dict(zip(sizes, values, strict=True)), styles[name], ls="-", lw=1.2, label=name)
    x, y = "m (the net has $2^m$ points)", "toroidal minimum distance in the unit cube"
    name_axes(axes, x, y, log="y", ticks=sizes, legend="best")


ORDER, M_5_7 = 16, 7
TARGET, SEED, STEPS = 97, 0, 5000
SQUARED = "squared distance on the integer grid"
NETS_5_7 = {
    "Larcher-Pillichshammer": sequences.larcher_pillichshammer_net,
    "Hammersley": sequences.hammersley_net,
    "permutation": sequences.permutation_net,
    "optimized": sequences.optimized_net,
    "rank-1 lattice": lambda m: sequences.rank1_lattice(2**m, 2),
}
NOTE_5_7 = (
    "Each (0,2)-sequence in base 2 has C_1 = L_1 U and C_2 = L_2 P U, P Pascal's triangle modulo 2, L "
    "lower and U upper triangular. The last pair is from our search, not that of the thesis, which is "
    "only printed as a picture."
)


def thesis_5_7(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the matrices, dark where they are zero, above the first 2**7 points."""
    m = 12 if quality == "paper" else 8
    star = {
        name: analysis.star_discrepancy(point_plots.block(net(m), 2**m)) for name, net in NETS_5_7.items()
    }
    index = np.arange(ORDER)
    pascal = (index[:, None] & index == index[:, None]).astype(int)
    ones = np.triu(np.ones((ORDER, ORDER), int))
    pairs = {
        "I, P\n(Sobol')": (np.eye(ORDER, dtype=int), pascal),
        "U, P U\n(modified)": (ones, pascal @ ones % 2),
        "I,\nP$^T$ P": (np.eye(ORDER, dtype=int), pascal.T @ pascal % 2),
        "U,\nU$^T$ P U": (ones, ones.T @ pascal @ ones % 2),
        "P$^T$ U,\nU$^T$ P U": (pascal.T @ ones % 2, ones.T @ pascal @ ones % 2),
    }
    progress(0.1)
    found = analysis.search_matrices({M_5_7: TARGET}, dims=2, seed=SEED, steps=STEPS)
    pairs["searched,\n7 x 7"] = (found.matrices[0].astype(int), found.matrices[1].astype(int))

    figure = new_figure(
        "A search finds matrices of larger distance than those with a pattern\n"
        "thesis, Fig. 5.6 to 5.8; matrices of (0,2)-sequences, zeros dark; P: Pascal's triangle, U: ones\n"
        f"below: their first {2**M_5_7} points, and squared minimum distances times $2^{{{2 * M_5_7}}}$",
        4.6,
    )
    axes = figure.subplots(3, len(pairs))
    measured: dict[str, dict] = {}
    is_net: dict[str, bool] = {}
    for column, (name, pair) in zip(axes.T, pairs.items(), strict=True):
        for axis, matrix, label in zip(column, pair, ("$C_1$", "$C_2$"), strict=False):
            draw_matrix(axis, matrix, label if name == next(iter(pairs)) else "")
        points = _first_points(pair)
        squared = analysis.squared_min_distance(points, side=2**M_5_7)
        column[0].set_title(name)
        point_plots.scatter(column[2], points / 2**M_5_7, f"distance² {squared}", ms=2)
        name = name.replace("$", "").replace("\n", " ")
        measured[name] = {SQUARED: squared}
        is_net[name] = point_plots.holds_one_each(points / 2**M_5_7, M_5_7)
    return figure, {
        "measured": {f"the first 2**{M_5_7} points": measured, "star discrepancy": {"points": 2**m, **star}},
        "claims": {
            "the matrices generate (0,2)-sequences: the first 2**7 points are a net": is_net,
            "the Larcher-Pillichshammer net has less star discrepancy than other nets and lattices": {
                name: star["Larcher-Pillichshammer"] < other for name, other in list(star.items())[1:]
            },
            "a search finds matrices of a larger distance than those with a pattern": found.reached
            and max(of[SQUARED] for of in list(measured.values())[:-1]) < TARGET,
        },
        "note": NOTE_5_7,
    }


def draw_matrix(axes: Axes, matrix: NDArray, label: str) -> None:
    """Draw a matrix over F2, its first row on top, zeros dark."""
    axes.imshow(matrix, cmap="gray", vmin=-0.3, vmax=1, interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(True)
    axes.set_ylabel(label, rotation=0, ha="right", va="center")


def _first_points(matrices: tuple[NDArray, NDArray]) -> NDArray[np.int64]:
    """Return the first 2**M points, cut off after M digits, as integers."""
    digits = (np.arange(2**M_5_7) >> np.arange(M_5_7)[:, None]) & 1
    weights = 2 ** np.arange(M_5_7 - 1, -1, -1)
    return np.stack([weights @ (matrix[:M_5_7, :M_5_7] @ digits % 2) for matrix in matrices], axis=1)


M_5_9 = 13
THESIS = 0.01342385
SEQUENCES = {
    "Sobol'": sequences.sobol,
    "modified (C'1, C'2)": sequences.larcher_pillichshammer,
    "searched sequence": sequences.optimized_sequence,
}
NOTE_5_9 = (
    "The searched nets have a pair of matrices for each m; the searched sequence has one pair for all. "
    "Distances are those that analysis.search_matrices reached, not known maxima. The dashed curve "
    "decides the claim about small m: the matrices searched for m = 13, with fewer points."
)


def thesis_5_9(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the matrices for m = 13 beside the toroidal distances over m."""
    sizes = range(2, 17 if quality == "paper" else 15)
    words = {name: _words(make(), 2 ** sizes[-1]) for name, make in SEQUENCES.items()}
    squared: dict[str, list[int]] = {name: [] for name in (*SEQUENCES, "searched nets")}
    for m in sizes:
        nets = {name: _net(points, m) for name, points in words.items()}
        nets["searched nets"] = _words(sequences.optimized_net_3d(m), 2**m) >> np.uint32(32 - m)
        for name, points in nets.items():
            squared[name].append(analysis.squared_min_distance(points, side=2**m))
        progress(2.0 ** (m - sizes[-1]))
    distances = {name: np.sqrt(values) / 2.0 ** np.array(sizes) for name, values in squared.items()}

    figure = new_figure(
        "Matrices searched for m = 13 have larger distances there, smaller ones at m = 4 to 11\n"
        "thesis, Fig. 5.9; (0,m,3)-nets, and the matrices of ours for m = 13 (zeros dark)",
        4.2,
    )
    layout = figure.subplot_mosaic("addd;bddd")
    matrices = _matrices(sequences.optimized_net_3d(M_5_9))
    for matrix, panel, label in zip(matrices, "ab", ("$C_1$", "$C_2$"), strict=True):
        draw_matrix(layout[panel], matrix, label)
    axes = layout["d"]
    searched = {"searched sequence": plot.Style("C3", "s"), "searched nets": plot.style("optimised matrices")}
    labels = {"searched sequence": "searched, for all m", "searched nets": "searched, for each m"}
    draw_distances(
        axes,
        sizes,
        {labels.get(name, name): of for name, of in distances.items()},
        STYLES | {labels[name]: drawn for name, drawn in searched.items()},
    )
    axes.semilogy([M_5_9], [THESIS], "k*", ms=9, ls="", label="thesis, searched for m = 13")
    last_two = _words(sequences.optimized_net_3d(M_5_9), 2**M_5_9)[:, 1:]
    of_pair = {
        str(m): analysis.squared_min_distance(_net(last_two, m), side=2**m)
        for m in range(sizes[0], M_5_9 + 1)
    }
    first = {m: np.sqrt(square) / 2 ** int(m) for m, square in of_pair.items()}
    curve(axes, first, plot.Style("C1", "x", "--"), lw=1.2, label=f"ours, searched for m = {M_5_9}")
    axes.legend(frameon=False)
    behind = [
        m
        for m in range(sizes[0], M_5_9)
        if of_pair[str(m)] < max(squared[name][m - sizes[0]] for name in PRINTED)
    ]
    at_13 = {name: float(values[M_5_9 - sizes[0]]) for name, values in distances.items()}
    return figure, {
        "measured": {
            "squared distance on the integer grid": {
                name: dict(zip(map(str, sizes), values, strict=True)) for name, values in squared.items()
            },
            "distance at m = 13": at_13,
            "squared distance of the first points of the searched net of m = 13": of_pair,
            "they are behind at m": behind,
        },
        "printed": {"distance at m = 13": PRINTED | {"searched": THESIS}},
        "claims": {
            "searched matrices reach a distance at m = 13 of 0.01342385, above those of both others": (
                at_13["searched nets"] >= THESIS > max(PRINTED.values())
            ),
            "matrices searched for m = 13 are behind the others at most smaller m": (
                len(behind) > (M_5_9 - sizes[0]) / 2
            ),
        },
        "note": NOTE_5_9,
    }


@jax.jit
def _bits(points: sequences.BinarySequence, index: jax.Array) -> jax.Array:
    return points.bits(index)


def _words(points: sequences.BinarySequence, n: int) -> NDArray[np.uint32]:
    return np.asarray(_bits(points, jnp.arange(n, dtype=jnp.uint32)))


def _net(words: NDArray[np.uint32], m: int) -> NDArray[np.uint32]:
    """Put i / 2**m before the first 2**m points of a sequence, all on the integer grid."""
    index = np.arange(2**m, dtype=np.uint32)
    return np.concatenate([index[:, None], words[: 2**m] >> np.uint32(32 - m)], axis=1)


def _matrices(points: sequences.BinarySequence) -> list[NDArray]:
    """Return C_1 and C_2 from the last two coordinates: column k is the point with index 2**k."""
    words = np.asarray(_bits(points, 2 ** jnp.arange(M_5_9, dtype=jnp.uint32)))
    rows = np.arange(31, 31 - M_5_9, -1, dtype=np.uint32)
    return [(columns >> rows[:, None]) & 1 for columns in words.T[-2:]]

"""All measures of points, of all sequences, in one table."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

KEY = 1

POINT_SETS = {
    "uniform": lambda m: sequences.uniform(2, KEY),
    "jittered": lambda m: sequences.jittered(2 ** (m // 2), 2, KEY),
    "Latin hypercube": lambda m: sequences.latin_hypercube(2**m, 2, KEY),
    "Lloyd": lambda m: sequences.lloyd(2**m, 2, KEY),
    "Halton": lambda m: sequences.halton(2),
    "Halton, Owen": lambda m: sequences.owen(sequences.halton(2), KEY),
    "Sobol'": lambda m: sequences.sobol(2),
    "Sobol', Owen": lambda m: sequences.owen(sequences.sobol(2), KEY),
    "Sobol', ART-Owen": lambda m: sequences.art_owen(sequences.sobol(2), KEY),
    "Sobol', net by net": lambda m: sequences.net_by_net(sequences.sobol(2), 2**m, KEY),
    "pmj02": lambda m: sequences.pmj02(2**m, KEY),
    "pmj02, best of 100": lambda m: sequences.pmj02(2**m, KEY, candidates=100),
    "Sobol', xor": lambda m: sequences.digital_shift(sequences.sobol(2), KEY),
    "Larcher-Pillichshammer": lambda m: sequences.larcher_pillichshammer(),
    "Faure, base 3": lambda m: sequences.faure(2, 3),
    "base 3, quad-optimized": lambda m: sequences.quad_optimized(2),
    "optimized sequence": lambda m: sequences.optimized_sequence(),
    "OneTwo, second pair": lambda m: sequences.components(sequences.one_two(4), (2, 3)),
    "SZ, last two of four": lambda m: sequences.components(sequences.sz(4), (2, 3)),
    "lattice sequence": lambda m: sequences.lattice(2),
    "R2": lambda m: sequences.roberts(),
    "Hammersley net": sequences.hammersley_net,
    "Larcher-Pillichshammer net": sequences.larcher_pillichshammer_net,
    "cascaded net, second pair": lambda m: sequences.components(sequences.cascaded_net(m, 3), (1, 2)),
    "permutation net": sequences.permutation_net,
    "optimized net": sequences.optimized_net,
    "rank-1 lattice": lambda m: sequences.rank1_lattice(2**m, 2),
}

LARGER_IS_BETTER = ("min distance", "Clark-Evans")
UNITS = {
    "min distance": "/ densest packing",
    "Clark-Evans": "random: 1",
    "dispersion": "times sqrt(n)",
    "t": "base 2",
}
"""Columns that are no discrepancies."""


def measures(points: NDArray[np.float64], m: int) -> dict[str, float | None]:
    """Return the measures of 2^m points of the unit square, distances relative to the densest packing."""
    nearest = analysis.nearest_statistics(points)
    return {
        "star": analysis.star_discrepancy(points),
        "L2 star": float(analysis.l2_star_discrepancy(points)),
        "centred": float(analysis.centered_discrepancy(points)),
        "wrap-around": float(analysis.wraparound_discrepancy(points)),
        "periodic": float(analysis.periodic_discrepancy(points)),
        "symmetric": float(analysis.symmetric_discrepancy(points)),
        "mixture": float(analysis.mixture_discrepancy(points)),
        "min distance": nearest.relative_minimum,
        "Clark-Evans": nearest.clark_evans,
        "dispersion": analysis.dispersion(points) * 2 ** (m / 2),
        "t": _t(points, m),
    }


def _t(points: NDArray[np.float64], m: int) -> float | None:
    """Return t as a net in base 2, or None where it is m: no box of more than all points is known."""
    t = analysis.t_value(points)
    return None if t == m else float(t)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all point sets, and draw a table shaded from the best to the worst of each column."""
    m = 12 if quality == "paper" else 8
    table = {}
    for done, (name, sequence) in enumerate(POINT_SETS.items(), start=1):
        table[name] = measures(point_plots.block(sequence(m), 2**m), m)
        progress(done / len(POINT_SETS))
    pair = (point_plots.block(POINT_SETS[name](m), 2**m) for name in ("Sobol'", "Larcher-Pillichshammer"))
    one, other = (points[np.lexsort(points.T)] for points in pair)
    return _draw(table, m), {
        "measured": {
            "points": 2**m,
            **table,
            "the first points of Sobol' and Larcher-Pillichshammer are one set": np.array_equal(one, other),
        },
        "claims": {
            "the Larcher-Pillichshammer net has less star discrepancy than other nets and lattices": {
                name: table["Larcher-Pillichshammer net"]["star"] < table[name]["star"]
                for name in ("Hammersley net", "permutation net", "optimized net", "rank-1 lattice")
            },
        },
        "note": "The first 2^m points of sequences and all of nets, in the unit square; random ones with one "
        "key. Distances are on the torus. The minimum distance is relative to that of the densest packing, "
        "Clark-Evans the mean distance to the nearest neighbour over that of random points, dispersion "
        "the radius of the largest empty disc times sqrt(n). t is that of a net in base 2, left out where it "
        "is m. Poisson disks do not tile and have no set number: they are not in the table. The sequences of "
        "Sobol' and of Larcher and Pillichshammer have the same measures: I, P of the one and U, P U of the "
        "other differ by an upper triangular matrix U, which permutes the first 2^m indices, so the first "
        "2^m points are one set in two orders. In nets, where i / n is a coordinate, the order counts: the "
        "first component of Sobol's makes the Hammersley net, theirs the Larcher-Pillichshammer net. The "
        "wrap-around and the periodic discrepancy do not tell the digital nets apart.",
    }


def _draw(table: dict[str, dict[str, float | None]], m: int) -> Figure:
    columns = list(next(iter(table.values())))
    values = np.array([[np.nan if row[c] is None else row[c] for c in columns] for row in table.values()])
    shades = np.empty_like(values)
    for j, column in enumerate(columns):
        sign = -1 if column in LARGER_IS_BETTER else 1
        key = sign * values[:, j]
        shades[:, j] = [np.nan if np.isnan(k) else np.mean(key[~np.isnan(key)] < k) for k in key]

    figure = Figure(figsize=(1.6 + 1.05 * len(columns), 1.2 + 0.32 * len(table)), layout="constrained")
    figure.suptitle(
        f"No sequence is best by all measures: {2**m} points in the unit square\n"
        "dark is the best of a column (arrows: up if larger is better)"
    )
    axes = figure.subplots()
    axes.imshow(shades, cmap="Blues_r", vmin=-0.2, vmax=1.4, aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        text = "" if np.isnan(value) else f"{value:.4g}"
        color = "white" if shades[i, j] < 0.35 else "black"
        axes.text(j, i, text, ha="center", va="center", fontsize=8, color=color)
    arrows = {column: "\u2191" if column in LARGER_IS_BETTER else "\u2193" for column in columns}
    heads = [f"{arrows[column]} {column}\n{UNITS.get(column, 'discrepancy')}" for column in columns]
    axes.set_xticks(range(len(columns)), heads)
    axes.set_yticks(range(len(table)), list(table))
    axes.spines[:].set_visible(False)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    return figure

"""Generators of points in eight dimensions beside each other: t, projections, discrepancy, convergence."""

from collections.abc import Callable
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import jax
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._errors import rms
from figures._rc import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION
from figures.shared.sheets import marks, point_plots, text_tables
from qmcjax import sequences

DIMS = 8


class Generator(NamedTuple):
    """How points are made, and drawn."""

    make: Callable[[int], sequences.Sequence]
    """From m to a sequence of at least 2**m points."""
    color: str
    marker: str


GENERATORS = {
    "random": Generator(lambda m: sequences.uniform(DIMS, 1), BLACK, "."),
    "Halton": Generator(lambda m: sequences.halton(DIMS), GREY, "s"),
    "Faure, base 11": Generator(lambda m: sequences.faure(DIMS), GREY, "x"),
    "quad-optimized": Generator(lambda m: sequences.quad_optimized(DIMS), GREEN, "d"),
    "lattice sequence": Generator(lambda m: sequences.lattice(DIMS), PURPLE, "v"),
    "Roberts' R8": Generator(lambda m: sequences.roberts(DIMS), PURPLE, "P"),
    "Sobol'": Generator(lambda m: sequences.sobol(DIMS), SKY, "o"),
    "cascaded Sobol'": Generator(lambda m: sequences.cascaded_net(m, DIMS), ORANGE, "D"),
    "OneTwo": Generator(lambda m: sequences.one_two(DIMS), BLUE, "^"),
    "SZ": Generator(lambda m: sequences.sz(DIMS), VERMILLION, "*"),
}
"""Old ones first."""


class Size(NamedTuple):
    """How much is measured."""

    m: int
    """The table is of 2**m points."""
    shown: int
    most: int
    step: int
    """Convergence goes up to 2**most points, by factors of 2**step."""
    keys: int


SIZES = {"draft": Size(6, 64, 4, 2, 2), "paper": Size(12, 256, 14, 1, 32)}
FIRST = 2
"""Convergence begins at 2**2 points."""

COLUMNS = (
    "t of pairs\n(2k, 2k+1)",
    "t of neigh-\nbours, worst",
    "t of pairs,\nmean",
    "t of pairs,\nworst",
    "t of quadruples\n(4k, ..., 4k+3)",
    "the same\nin base 4",
    "star, pairs\nmean",
    "star, pairs\nworst",
    "centred,\n8-D",
)


def measured(points: NDArray[np.float64], m: int) -> dict[str, Any]:
    """Return the measures of 2**m points, m even: t is None where it says nothing."""
    pairs = {pair: points[:, pair] for pair in combinations(range(DIMS), 2)}
    t = {pair: analysis.t_value(projected) for pair, projected in pairs.items()}
    star = {pair: analysis.star_discrepancy(projected) for pair, projected in pairs.items()}
    quadruples = [points[:, k : k + 4] for k in range(0, DIMS, 4)]
    worst = max(t.values())
    in_base_4 = max(analysis.t_value(quadruple, base=4) for quadruple in quadruples)
    values = (
        _below(max(t[k, k + 1] for k in range(0, DIMS, 2)), m),
        _below(max(t[pair] for pair in pairwise(range(DIMS))), m),
        None if worst == m else float(np.mean(list(t.values()))),
        _below(worst, m),
        _below(max(analysis.t_value(quadruple) for quadruple in quadruples), m),
        _below(in_base_4, m // 2),
        float(np.mean(list(star.values()))),
        max(star.values()),
        float(analysis.centered_discrepancy(points)),
    )
    names = (column.replace("-\n", "").replace("\n", " ") for column in COLUMNS)
    return dict(zip(names, values, strict=True)) | {"worst pair": list(max(star, key=lambda p: star[p]))}


def _below(t: int, m: int) -> int | None:
    return None if t == m else t


def pairs_of_discs(points: NDArray[np.float64]) -> float:
    """Return the error of the mean number of pairs (2k, 2k+1) that are in a quarter of the unit disc."""
    inside = points[:, ::2] ** 2 + points[:, 1::2] ** 2 < 1
    return float(inside.mean() - np.pi / 4)


def half_spaces(points: NDArray[np.float64]) -> float:
    """Return the error of the share of quadruples (4k, ..., 4k+3) whose coordinates sum up to less than 2."""
    return float((points.reshape(-1, DIMS // 4, 4).sum(axis=2) < 2).mean() - 0.5)


def smooth(points: NDArray[np.float64]) -> float:
    """Return the error of the mean of the product of 1 + (e^x - e + 1) / (2 j) over coordinates j."""
    weights = 0.5 / np.arange(1, DIMS + 1)
    return float(np.prod(1 + weights * (np.exp(points) - np.e + 1), axis=1).mean() - 1)


INTEGRANDS = {
    "discs in pairs (2k, 2k+1)": pairs_of_discs,
    "half spaces in quadruples (4k, ..., 4k+3)": half_spaces,
    "a smooth product of all eight": smooth,
}


def randomized(name: str, m: int, key: jax.Array) -> sequences.Sequence:
    """Return a generator with random digits, or rotated if it has none, or new random points."""
    if name == "random":
        return sequences.uniform(DIMS, key)
    sequence: Any = GENERATORS[name].make(m)
    if name in ("lattice sequence", "Roberts' R8"):
        return sequences.rotate(sequence, key)
    return sequences.owen(sequence, key)


def errors(name: str, size: Size) -> dict[str, dict[str, float]]:
    """Return RMS errors over keys, of each integrand, by the number of points."""
    counts = range(FIRST, size.most + 1, size.step)
    found: dict[str, dict[str, list[float]]] = {f: {str(2**m): [] for m in counts} for f in INTEGRANDS}
    net = GENERATORS[name].make(size.most).size is not None
    for key in jax.random.split(jax.random.key(2), size.keys):
        # A net is another one for each m; of a sequence, all are the first points of one set.
        most = None if net else point_plots.block(randomized(name, size.most, key), 2**size.most)
        for m in counts:
            points = point_plots.block(randomized(name, m, key), 2**m) if most is None else most[: 2**m]
            for integrand, error in INTEGRANDS.items():
                found[integrand][str(2**m)].append(error(points))
    return {integrand: {n: rms(e) for n, e in row.items()} for integrand, row in found.items()}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all generators, and draw a table, their worst pairs, and errors over points."""
    size = SIZES[quality]
    table, convergence = {}, {}
    for done, (name, generator) in enumerate(GENERATORS.items(), start=1):
        table[name] = measured(point_plots.block(generator.make(size.m), 2**size.m), size.m)
        convergence[name] = errors(name, size)
        progress(done / len(GENERATORS))
    return _draw(size, table, convergence), {
        "measured": {"points": 2**size.m, "table": table, "rms error": convergence},
        "note": _note(size, convergence),
    }


def _note(size: Size, convergence: dict[str, dict[str, dict[str, float]]]) -> str:
    most = str(2**size.most)
    best = {f: min(convergence, key=lambda name: convergence[name][f][most]) for f in INTEGRANDS}
    found = "; ".join(f"{integrand}: {name}" for integrand, name in best.items())
    return (
        f"The table is of the first {2**size.m} points, not scrambled, the worst pair that of the largest "
        f"star discrepancy. Errors are root mean squares over {size.keys} keys: Owen scramblings, "
        "Cranley-Patterson rotations of the lattice and of R8. t is counted in base 2, in which Halton's, "
        "Faure's, quad-optimized and R8's points are no nets: Faure's have t = 0 in base 11, for powers of "
        "11, and quad-optimized ones small t of pairs and quadruples in base 3, for powers of 3. Cascaded "
        "Sobol' points are another net for each number of points, all others are sequences. SZ's are "
        f"made for powers of 4 and 16. Least error at {most} points: {found}."
    )


def _cell(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:d}" if isinstance(value, int) else f"{value:.4f}"


def _draw(size: Size, table: dict, convergence: dict) -> Figure:
    figure = Figure(figsize=(13, 11), layout="constrained")
    figure.suptitle(
        f"Generators in {DIMS} dimensions: {2**size.m} points, projections of largest star discrepancy, "
        "and errors"
    )
    parts: Any = figure.subfigures(3, 1, height_ratios=[3.4, 2.4, 4.4])
    top, middle, bottom = parts
    rows = [[name, *map(_cell, list(row.values())[:-1])] for name, row in table.items()]
    axes = top.subplots()
    text_tables.draw(axes, ["", *COLUMNS], rows, widths=[1.5] + [1.15] * len(COLUMNS))
    for panel, (name, generator) in zip(middle.subplots(1, len(table)), GENERATORS.items(), strict=True):
        pair = table[name]["worst pair"]
        points = point_plots.block(generator.make(size.shown.bit_length() - 1), size.shown)[:, pair]
        plot.points(points, title=f"{name}\n{tuple(pair)}, n = {size.shown}", ax=panel, ms=1.5)
    panels = bottom.subplots(1, len(INTEGRANDS))
    for panel, integrand in zip(panels, INTEGRANDS, strict=True):
        for name, generator in GENERATORS.items():
            look = plot.Style(generator.color, generator.marker)
            marks.curve(panel, convergence[name][integrand], look, ms=5, label=name)
        panel.set(title=integrand, xlabel="points", ylabel="RMS error", yscale="log")
        panel.set_xscale("log", base=2)
        panel.xaxis.set_minor_locator(NullLocator())
        panel.grid(True)
    bottom.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(GENERATORS))
    return figure

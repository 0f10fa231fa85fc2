"""Sequences in four dimensions: which can exist in base 2, and their errors beside those of Sobol's."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.tables.search_columns import QUESTIONS, SIZE, Found, search
from figures._rc import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILLION
from figures.plot import Style
from figures.shared import judged
from figures.shared.integrands import integrands_of_dims
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from figures.shared.judged import Ratio
from figures.shared.sheets import marks
from qmcjax import sequences

DIMS = 4
PROJECTIONS = (*combinations(range(DIMS), 2), tuple(range(DIMS)))
"""The coordinates of integrands: pairs, and all four."""

AT_ONCE = 64
"""Keys of one call."""

PARTS = 8
"""Sets of keys whose ratios are compared for an interval."""

REFERENCE = "Sobol'"

SEQUENCES = {
    "Niederreiter-Xing": (sequences.niederreiter_xing, Style(BLUE, "o")),
    "SZ": (sequences.sz, Style(VERMILLION, "s")),
    "quad-optimized, base 3": (sequences.quad_optimized, Style(GREEN, "D")),
}

KEYS = {"draft": 128, "paper": 1024}
FIRST, LAST = 6, {"draft": 7, "paper": 14}
"""Binary logarithms of the numbers of points."""

DISCONTINUOUS, SMOOTH = slice(0, 2), slice(2, 4)
"""Of the classes: half-spaces and balls; bumps and products."""

GOALS = 0.95, 1.3
"""What a sequence should reach for every pair, and in four dimensions."""

TITLE = (
    "In base 2, t <= 1 in four dimensions leaves no coordinate with t = 0 beyond 2^{order} points:\n"
    "Sobol's errors are {four:.2f} times Niederreiter-Xing's in all four, {pair:.2f} times in the first pair"
)

NOTE = (
    "Left: exhaustive searches for generator matrices, column by column (python -m "
    "analysis.tables.search_columns): bars end at the last m for which the first 2^m points can have all "
    f"that is asked, and an arrow says that not all matrices were tried, up to m = {SIZE}. Niederreiter-Xing "
    "sequences have t = 1 in four dimensions for all m. Middle and right: how many times smaller RMS errors "
    f"are than those of Sobol's sequence, both Owen-scrambled, over {{keys}} keys and {COUNT} random "
    f"integrands of a class, geometric means over 2^{FIRST} to 2^{{last}} points and the classes "
    f"({', '.join(CLASSES)}), with intervals of 95 % from {PARTS} sets of keys. "
    f"Quad-optimized points are made for powers of 3. The goal was {GOALS[0]} for every pair and {GOALS[1]} "
    "in four dimensions: {verdict}. There, Niederreiter-Xing's errors are {discontinuous:.2f} times smaller "
    "for half-spaces and balls and {smooth:.2f} times for bumps and products. The discontinuous ones depend "
    "on intervals that are finer than 2^-m, whose counts t does not bound."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Search, measure, and draw both."""
    found = {question.asked: search(question.bounds, question.limit, question.seed) for question in QUESTIONS}
    progress(0.2)
    last, keys = LAST[quality], KEYS[quality]
    reference = estimates(sequences.sobol(DIMS), FIRST, last, keys)
    projections, sizes, kinds = {}, {}, {}
    for done, (name, (maker, _)) in enumerate(SEQUENCES.items(), start=1):
        ours = estimates(maker(DIMS), FIRST, last, keys)
        projections[name] = {axes: ratio(reference[:, k], ours[:, k]) for k, axes in enumerate(PROJECTIONS)}
        sizes[name] = {
            2**m: ratio(reference[:, -1, m - FIRST], ours[:, -1, m - FIRST]) for m in range(FIRST, last + 1)
        }
        kinds[name] = [
            ratio(reference[:, -1, :, part], ours[:, -1, :, part]) for part in (DISCONTINUOUS, SMOOTH)
        ]
        progress(0.2 + 0.8 * done / len(SEQUENCES))
    reached = [name for name, of in projections.items() if _reaches(of)]
    discontinuous, smooth = kinds["Niederreiter-Xing"]
    return _draw(found, projections, sizes), {
        "measured": {
            name: {
                **{", ".join(map(str, axes)): of._asdict() for axes, of in rows.items()},
                **{str(n): of._asdict() for n, of in sizes[name].items()},
                "half-spaces and balls": kinds[name][0]._asdict(),
                "bumps and products": kinds[name][1]._asdict(),
            }
            for name, rows in projections.items()
        },
        "table": [
            {"asked": asked, "largest m": of.order, "complete": of.complete, "systems": of.nodes}
            for asked, of in found.items()
        ],
        "note": NOTE.format(
            keys=keys,
            last=last,
            verdict=f"reached by {', '.join(reached)}" if reached else "none of them reaches both",
            discontinuous=discontinuous.middle,
            smooth=smooth.middle,
        ),
    }


def estimates(sequence: Any, first: int, last: int, keys: int, seed: int = 5) -> NDArray:
    """Return means over the first 2**first to 2**last points of Owen scramblings, up to constants.

    ``sequence``: of four dimensions, one that :func:`qmcjax.sequences.owen` takes.

    Returns float64 array, shape (keys, PROJECTIONS, last - first + 1, CLASSES, COUNT).
    """
    drawn = jax.random.split(jax.random.key(seed), keys)
    known = [integrands_of_dims.moments(len(axes))[0].astype(np.float32) for axes in PROJECTIONS]

    @jax.jit
    def estimated(sequence: Any, keys: Array) -> Array:
        return jax.lax.map(lambda key: of_key(sequence, key), keys)

    def of_key(sequence: Any, key: Array) -> Array:
        points = sequences.owen(sequence, key).points(2**last)
        found = []
        for axes, mean in zip(PROJECTIONS, known, strict=True):
            # Near 0, float32 sums have errors far below those of the integrals.
            values = integrands_of_dims.values(points[None][..., list(axes)])[0] - mean
            ends = [values[: 2**first].sum(axis=0)]
            ends += [values[2**m : 2 ** (m + 1)].sum(axis=0) for m in range(first, last)]
            sums = jnp.cumsum(jnp.stack(ends), axis=0)
            found.append(sums / np.float32(2) ** np.arange(first, last + 1, dtype=np.float32)[:, None])
        return jnp.stack(found)

    parts = np.split(np.arange(keys), range(AT_ONCE, keys, AT_ONCE))
    found = np.concatenate([np.asarray(estimated(sequence, drawn[part]), np.float64) for part in parts])
    return found.reshape(*found.shape[:-1], len(CLASSES), COUNT)


def ratio(reference: NDArray, estimates: NDArray) -> Ratio:
    """Return by how much errors are smaller than those of a reference.

    Both are arrays of the same shape: keys along the first axis, integrands of a class along the last one.
    Errors are root mean squares over both, and the ratio is the geometric mean over all other axes.
    """
    parts = (np.array_split(errors, PARTS) for errors in (reference, estimates))
    logs = [
        0.5 * np.mean(np.log(theirs.var(axis=0).mean(axis=-1) / ours.var(axis=0).mean(axis=-1)))
        for theirs, ours in zip(*parts, strict=True)
    ]
    return judged.of_logarithms(logs)


def _reaches(projections: dict[tuple[int, ...], Ratio]) -> bool:
    *pairs, four = projections.values()
    return min(of.middle for of in pairs) >= GOALS[0] and four.middle >= GOALS[1]


def _draw(
    found: dict[str, Found],
    projections: dict[str, dict[tuple[int, ...], Ratio]],
    sizes: dict[str, dict[int, Ratio]],
) -> Figure:
    figure = Figure(figsize=(14, 5), layout="constrained")
    four, pair = (projections["Niederreiter-Xing"][axes].middle for axes in (PROJECTIONS[-1], PROJECTIONS[0]))
    order = max(of.order for asked, of in found.items() if asked.startswith("all: t <= 1"))
    figure.suptitle(TITLE.format(order=order, four=four, pair=pair))
    left, middle, right = figure.subplots(1, 3, width_ratios=(1, 1.2, 1))
    _searches(left, found)
    of_projections = {
        name: {", ".join(map(str, axes)): of for axes, of in rows.items()}
        for name, rows in projections.items()
    }
    of_sizes = {
        name: {f"$2^{{{n.bit_length() - 1}}}$": of for n, of in rows.items()} for name, rows in sizes.items()
    }
    for axes, rows, label in (
        (middle, of_projections, "coordinates of the integrand"),
        (right, of_sizes, "points; integrands of all four coordinates"),
    ):
        _ratios(axes, rows)
        axes.set(xlabel=label)
    middle.set(ylabel=f"RMS error of {REFERENCE} / RMS error")
    middle.legend(frameon=False)
    return figure


def _searches(axes: Axes, found: dict[str, Found]) -> None:
    for place, of in enumerate(found.values()):
        axes.barh(place, of.order, color=ORANGE if of.complete else GREY, height=0.6)
        if not of.complete:
            arrow = {"arrowstyle": "->", "color": GREY}
            axes.annotate("", (of.order + 1.4, place), (of.order, place), arrowprops=arrow)
        axes.text(of.order - 0.3, place, str(of.order), ha="right", va="center")
    axes.set(
        xlabel="largest m", xlim=(0, SIZE + 2), yticks=range(len(found)), title="what 2^m points can have"
    )
    axes.set_yticklabels(list(found))
    axes.set_xticks(range(0, SIZE + 1, 4))
    axes.invert_yaxis()


def _ratios(axes: Axes, rows: dict[str, dict[str, Ratio]]) -> None:
    for shift, (name, row) in zip((-0.2, 0, 0.2), rows.items(), strict=True):
        marks.ratios(axes, np.arange(len(row)) + shift, row.values(), SEQUENCES[name][1], label=name)
    axes.axhline(1, color=BLACK, lw=0.8)
    labels = list(next(iter(rows.values())))
    axes.set(yscale="log", xticks=range(len(labels)), xticklabels=labels)
    marks.plain_numbers(axes)
    axes.grid(axis="y", which="both")

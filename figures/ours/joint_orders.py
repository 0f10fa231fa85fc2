"""Orders searched for all of four and eight coordinates together, beside other samplers: filtered errors."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._rc import BLACK
from figures.shared import judged
from figures.shared.integrands import integrands_of_dims
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from figures.shared.sheets import marks
from qmcjax import orders, samplers, sequences
from qmcjax.choosing import CANDIDATES

OURS = "optimised, joint"
TILES = "designed tiles"
SIDE = {"draft": 32, "paper": 128}
KEYS = {"draft": 4, "paper": 16}
COUNTS = {"draft": {4: (4,), 8: (1,)}, "paper": {4: (1, 4, 16, 64), 8: (1, 4, 16)}}
"""Samples per pixel, by dimensions."""

OTHERS = ("Hilbert, Owen-Sobol'", "Z, joint", "ranked keys", TILES)
"""Of the candidates."""

MOST_DIMS, MOST_SPP = 4, 16
"""Of designed tiles."""

GOALS = {4: {4: 0.90, 16: 0.92, 64: 0.95}, 8: {1: 0.93, 4: 0.93, 16: 0.93}}

Maker = Callable[[int], samplers.Sampler]
"""From a key."""

NOTE = (
    "{side} x {side} pixels, {keys} keys. Integrands of all coordinates, the same in all pixels, "
    f"{COUNT} of each class ({', '.join(CLASSES)}); none was searched with. Filtered errors are after a "
    "Gaussian of 1.5 pixels. Points are ratios of errors of the optimised order to those of others, "
    "geometric means over the classes, with intervals of 95 % over keys: below 1, ours are smaller. Over the "
    "best without a tile they are {best}. Plain errors, over those of the same sampler, are {plain}. Goals "
    "for filtered errors: {goals}."
)


def makers(dims: int, side: int, spp: int) -> dict[str, Maker]:
    """Return the samplers of a number of coordinates."""
    curve = orders.hilbert(side, side)

    def candidate(name: str) -> Maker:
        return lambda key: CANDIDATES[name].make(dims, side, side, spp, key)

    def niederreiter_xing(key: int) -> samplers.Sampler:
        return samplers.contiguous(curve, sequences.owen(sequences.niederreiter_xing(dims), key), spp)

    others = [name for name in OTHERS if CANDIDATES[name].takes(dims, spp)]
    if dims > MOST_DIMS or spp > MOST_SPP:
        others.remove(TILES)
    return {
        OURS: candidate("optimised orders"),
        "Hilbert, Owen-Niederreiter-Xing": niederreiter_xing,
        **{name: candidate(name) for name in others},
    }


def measured(maker: Maker, dims: int, side: int, spp: int, keys: int) -> NDArray[np.float64]:
    """Return mean logarithms over the classes of filtered and plain errors, shape (keys, 2)."""
    rows = []
    for key in range(1, keys + 1):
        error = integrands_of_dims.errors(maker(key), side, spp, dims)
        exact = np.zeros_like(error[..., :1])
        filtered = [analysis.filtered_error(error[..., k : k + 1], exact) for k in range(error.shape[2])]
        plain = np.sqrt(np.mean(error**2, axis=(0, 1)))
        squares = np.square([filtered, plain]).reshape(2, len(CLASSES), COUNT).mean(axis=2)
        rows.append(np.log(squares).mean(axis=1) / 2)
    return np.array(rows)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all samplers, and draw ratios by numbers of samples, a panel for each number of dimensions."""
    side, keys, counts = SIDE[quality], KEYS[quality], COUNTS[quality]
    ratios: dict[int, dict[int, dict[str, list[list[float]]]]] = {}
    best: dict[str, str] = {}
    over: dict[str, float] = {}
    plain: dict[str, float] = {}
    cells = [(dims, spp) for dims in counts for spp in counts[dims]]
    for done, (dims, spp) in enumerate(cells, start=1):
        logs = {name: measured(of, dims, side, spp, keys) for name, of in makers(dims, side, spp).items()}
        ratios.setdefault(dims, {})[spp] = {
            name: [list(judged.of_logarithms((logs[OURS] - of)[:, kind])) for kind in (0, 1)]
            for name, of in logs.items()
            if name != OURS
        }
        others = {name: of.mean(axis=0)[0] for name, of in logs.items() if name not in (OURS, TILES)}
        least = min(others, key=lambda name: others[name])
        (middle, low, high), (of_plain, _, _) = ratios[dims][spp][least]
        where = f"{dims}-D, {spp} spp"
        over[where] = middle
        best[where] = f"{middle:.2f} [{low:.2f}, {high:.2f}] ({where}, {least})"
        plain[where] = of_plain
        progress(done / len(cells))
    figure = _draw(ratios)
    figure.suptitle(
        f"Orders searched for all coordinates: {min(over.values()):.2f} to {max(over.values()):.2f} times "
        f"the filtered error of the best other order\n{side} x {side} pixels, {keys} keys",
        fontsize=11,
    )
    return figure, {
        "measured": {f"{dims}-D, {spp} spp": of for dims, rows in ratios.items() for spp, of in rows.items()},
        "note": NOTE.format(
            side=side,
            keys=keys,
            best=", ".join(best.values()),
            plain=", ".join(f"{value:.2f}" for value in plain.values()),
            goals=", ".join(
                f"{goal:.2f} ({dims}-D, {n} spp)" for dims in counts for n, goal in GOALS[dims].items()
            ),
        ),
    }


def _draw(ratios: dict[int, dict[int, dict[str, list[list[float]]]]]) -> Figure:
    figure = Figure(figsize=(5.4 * len(ratios) + 2.4, 4), layout="constrained")
    panels = figure.subplots(1, len(ratios), squeeze=False)[0]
    names = list(next(iter(next(iter(ratios.values())).values())))
    for axes, (dims, rows) in zip(panels, ratios.items(), strict=True):
        _panel(axes, dims, rows, names)
    panels[0].set_ylabel("filtered error, optimised order / other")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center", frameon=False)
    return figure


def _panel(axes: Axes, dims: int, rows: dict[int, dict[str, list[list[float]]]], names: list[str]) -> None:
    for place, name in enumerate(names):
        found = [(k, of[name][0]) for k, of in enumerate(rows.values()) if name in of]
        if not found:
            continue
        places = np.array([k for k, _ in found]) + 0.12 * (place - (len(names) - 1) / 2)
        look = plot.Style(plot.style(name, names).color, "o")
        marks.ratios(axes, places, [ratio for _, ratio in found], look, label=name)
    for k, spp in enumerate(rows):
        if spp in GOALS[dims]:
            axes.plot([k - 0.4, k + 0.4], [GOALS[dims][spp]] * 2, color="0.5", lw=1, ls="--")
    axes.axhline(1, color=BLACK, lw=0.8)
    axes.set(title=f"{dims} coordinates; dashed: goals", xlabel="samples per pixel", xticks=range(len(rows)))
    axes.set_xticklabels([str(spp) for spp in rows])
    axes.grid(axis="y")

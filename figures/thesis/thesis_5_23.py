"""Thesis Fig. 5.23: four Owen scramblings of one permutation net, beside the net itself and rotations."""

from collections.abc import Callable

import jax
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.shared.sheets import point_plots
from qmcjax import sequences

M, KEYS = 6, 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Scramble the (0,6,2)-permutation net with four keys."""
    net = sequences.permutation_net(M)
    unscrambled = point_plots.block(net, 2**M)
    scrambled = {f"key {key}": point_plots.block(sequences.owen_exact(net, key), 2**M) for key in range(KEYS)}
    rotated = {
        f"key {key}": point_plots.block(sequences.rotate(net, jax.random.key(key)), 2**M)
        for key in range(KEYS)
    }
    plain, sheared = (analysis.min_distance(unscrambled, shear=shear) for shear in (0.0, 0.25))
    distances = {
        way: {key: analysis.min_distance(points) for key, points in sets.items()}
        for way, sets in (("scrambled", scrambled), ("rotated", rotated))
    }
    is_net = {key: point_plots.holds_one_each(points, M) for key, points in scrambled.items()}
    figure = _drawn({"not scrambled": unscrambled, **_named("Owen", scrambled), **_named("rotated", rotated)})
    return figure, {
        "measured": {
            **{key: {"minimum distance": distance} for key, distance in distances["scrambled"].items()},
            "unscrambled": {"minimum distance": plain, "minimum distance, sheared tiling": sheared},
            "rotated": distances["rotated"],
        },
        "claims": {
            "scrambled points are stratified as a (0,6,2)-net": is_net,
            "the minimum distance does not hold any more": {
                key: distance < plain for key, distance in distances["scrambled"].items()
            },
            "a rotation keeps the toroidal minimum distance": {
                key: bool(np.isclose(distance, plain, rtol=1e-9))
                for key, distance in distances["rotated"].items()
            },
            "a rotation violates the net property": {
                key: not point_plots.holds_one_each(points, M) for key, points in rotated.items()
            },
        },
        "note": "Distances are toroidal, but for that of the sheared tiling. Rotations are Cranley "
        "and Patterson's; 'intervals' are the elementary ones of area 1/64, of all shapes.",
    }


def _named(way: str, sets: dict[str, NDArray]) -> dict[str, NDArray]:
    """Return the sets that are drawn: the thesis draws four scramblings, and no rotation."""
    shown = KEYS if way == "Owen" else KEYS - 1
    return {f"{way}, {key}": points for key, points in list(sets.items())[:shown]}


def _drawn(sets: dict[str, NDArray]) -> Figure:
    title = "The (0,6,2)-permutation net, scrambled by Owen's method and rotated (thesis Fig. 5.23)"
    figure, axes = point_plots.panels(len(sets), title, columns=4)
    for panel, (name, points) in zip(axes, sets.items(), strict=True):
        distance = analysis.min_distance(points)
        text = f"{name}\ndistance {distance:.4f}, one in {_occupied(points):.0%} of intervals"
        point_plots.grid(panel, 2 ** (M // 2), 2 ** (M // 2))
        point_plots.scatter(panel, points, text, color=plot.style("permutation").color)
    return figure


def _occupied(points: NDArray[np.float64]) -> float:
    """Return the part of the elementary intervals of area 2**-M that hold one point."""
    return float(np.mean([(analysis.interval_counts(points, (i, M - i)) == 1).mean() for i in range(M + 1)]))

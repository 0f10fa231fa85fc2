"""Thesis Fig. 5.23: four Owen scramblings of one permutation net."""

from collections.abc import Callable

from matplotlib.figure import Figure

import analysis
from figures import _points
from qmcjax import sequences

M, KEYS = 6, 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Scramble the (0,6,2)-permutation net with four keys."""
    del quality, progress
    net = sequences.permutation_net(M)
    figure, axes = _points.panels(KEYS, "Owen scramblings of the (0,6,2)-permutation net (thesis Fig. 5.23)")
    measured = {}
    for key, panel in enumerate(axes):
        points = _points.block(sequences.owen_exact(net, key), 2**M)
        distance = analysis.min_distance(points)
        measured[f"key {key}"] = {
            "is a (0,6,2)-net": _points.holds_one_each(points, M),
            "minimum distance": distance,
        }
        _points.grid(panel, 2 ** (M // 2), 2 ** (M // 2))
        _points.scatter(panel, points, f"key {key}, distance {distance:.4f}")
    measured["unscrambled, sheared tiling"] = {
        "minimum distance": analysis.min_distance(_points.block(net, 2**M), shear=0.25)
    }
    return figure, {
        "measured": measured,
        "printed": "still stratified as a (0,6,2)-net; the minimum distance does not hold anymore",
    }

"""Thesis Fig. 5.23: four Owen scramblings of one permutation net."""

from collections.abc import Callable

import jax
import numpy as np
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
    measured: dict[str, dict] = {}
    is_net = {}
    for key, panel in enumerate(axes):
        points = _points.block(sequences.owen_exact(net, key), 2**M)
        distance = analysis.min_distance(points)
        is_net[f"key {key}"] = _points.holds_one_each(points, M)
        measured[f"key {key}"] = {"minimum distance": distance}
        _points.grid(panel, 2 ** (M // 2), 2 ** (M // 2))
        _points.scatter(panel, points, f"key {key}, distance {distance:.4f}")
    unscrambled = _points.block(net, 2**M)
    rotated = {
        f"key {key}": _points.block(sequences.rotate(net, jax.random.key(key)), 2**M) for key in range(KEYS)
    }
    distances = {key: analysis.min_distance(points) for key, points in rotated.items()}
    plain, sheared = (analysis.min_distance(unscrambled, shear=shear) for shear in (0.0, 0.25))
    return figure, {
        "measured": measured
        | {
            "unscrambled": {"minimum distance": plain, "minimum distance, sheared tiling": sheared},
            "rotated": distances,
        },
        "claims": {
            "scrambled points are stratified as a (0,6,2)-net": is_net,
            "the minimum distance does not hold any more": {
                key: measured[key]["minimum distance"] < plain for key in is_net
            },
            "a rotation keeps the toroidal minimum distance": {
                key: bool(np.isclose(distance, plain, rtol=1e-9)) for key, distance in distances.items()
            },
            "a rotation violates the net property": {
                key: not _points.holds_one_each(points, M) for key, points in rotated.items()
            },
        },
        "note": "Distances are toroidal, but for that of the sheared tiling.",
    }

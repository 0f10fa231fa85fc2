"""Search for points of small star discrepancy in any dimension, by descents from many starts."""

import time

import numpy as np
from numpy.typing import NDArray

from analysis._searches.box_descent import descend
from analysis._searches.worst_boxes import WorstBoxes

_FRESH = 0.35
"""Part of the time for descents from new starts; later ones start near the best points."""

_ROUNDS = 60
"""Maximum number of rounds of a descent."""

_BOXES = {True: 4000, False: 8000}
"""Boxes that are lowered together, for few coordinates and for many."""

_STARTS = {True: 24, False: 8}
"""Starts of which the best is taken, for few coordinates and for many."""

_FEW = 600
"""Few coordinates are up to this number."""

Floats = NDArray[np.float64]


def search_boxes(
    n: int, dims: int, seconds: float, rng: np.random.Generator, start: Floats | None = None
) -> Floats:
    """Return n points of small star discrepancy, in 32-bit fractions; no worse than ``start``, if given.

    Seconds are of processor time. Starts are Kronecker sets with random shifts and steps. When these have had
    their time, the best points are perturbed: neighbouring ranks are swapped, all points moved a little, or a
    few moved anywhere.
    """
    began = time.process_time()
    best, least = start, np.inf if start is None else _star(start)
    few = n * dims <= _FEW
    while best is None or time.process_time() - began < seconds:
        spent = time.process_time() - began
        if best is None or spent < _FRESH * seconds:
            points = min((_kronecker(n, dims, rng) for _ in range(_STARTS[few])), key=_star)
        else:
            points = _perturbed(best, rng)
        moved, level = descend(points, _ROUNDS, _BOXES[few])
        if level < least:
            moved = np.floor(moved * 2.0**32) * 2.0**-32
            if (found := _star(moved)) < least:
                best, least = moved, found
    return best


def _star(points: Floats) -> float:
    return WorstBoxes(points, 1 - 2.0**-24, 64).largest


def _kronecker(n: int, dims: int, rng: np.random.Generator) -> Floats:
    i = np.arange(n)[:, None] + 0.5
    return np.hstack([i / n, (i * rng.random(dims - 1) + rng.random(dims - 1)) % 1])


def _perturbed(points: Floats, rng: np.random.Generator) -> Floats:
    moved, (n, dims) = points.copy(), points.shape
    kind = rng.random()
    if kind < 0.4:
        for _ in range(max(1, int(n * dims * 10 ** rng.uniform(-2.2, -0.8)))):
            axis, rank = rng.integers(dims), rng.integers(n - 1)
            pair = np.argsort(moved[:, axis])[rank : rank + 2]
            moved[pair, axis] = moved[pair[::-1], axis]
    elif kind < 0.8:
        moved += rng.normal(size=moved.shape) * 10 ** rng.uniform(-1.3, 0.2) / n
    else:
        moved[rng.integers(n, size=rng.integers(1, 3))] = rng.random(dims)
    return np.clip(moved, 0, 1 - 2.0**-30)

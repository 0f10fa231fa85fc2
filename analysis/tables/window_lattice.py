"""Steps of lattices in x, y and time that are uniform in small windows, for `samplers.window_lattice`."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis._structure.windows import WINDOWS

ROUNDS, TOGETHER = 800, 50_000
"""Random triples of steps."""

MOST = 2.5
"""Times the least discrepancy, in each window."""

COUNT = 16
"""Coordinates."""

HARMONICS, RESONANCE = 8, 0.02


def table() -> Iterator[str]:
    """Yield a line of words for each coordinate: the steps in x, y and time."""
    grids = [np.indices(shape).reshape(3, -1)[::-1] for shape in WINDOWS]
    steps = np.concatenate([found for found in _candidates(grids)])
    chosen = _far_apart(steps, grids)
    lines = [" ".join(f"{word:08x}" for word in each) for each in (steps[chosen] * 2.0**32).astype(np.uint64)]
    yield "\n".join(
        [
            "# Steps of each coordinate in x, y and time, fractions of 32 bits, hexadecimal",
            "# Made by python -m analysis.tables window_lattice.txt",
            *lines,
            "",
        ]
    )


def _candidates(grids: list[NDArray[np.int64]]) -> Iterator[NDArray[np.float64]]:
    """Yield random steps that keep each window below `MOST`, fractions of 32 bits."""
    rng = np.random.default_rng(7)
    for _ in range(ROUNDS):
        steps = rng.integers(2**32, size=(TOGETHER, 3)) / 2.0**32
        for grid in sorted(grids, key=lambda grid: grid.shape[1]):
            values = np.sort(steps @ grid % 1, axis=1)
            n = values.shape[1]
            ahead = np.arange(n) / n - values
            steps = steps[1 + n * (ahead.max(axis=1) - ahead.min(axis=1)) < MOST]
        yield steps


def _far_apart(steps: NDArray[np.float64], grids: list[NDArray[np.int64]]) -> list[int]:
    """Return coordinates, one by one, whose worst pair is best, by the sum of two penalties.

    The first is the mean squared periodic discrepancy in a window, over that of random points. The other is
    `RESONANCE` over the least ``|k l|`` times the frequency in x and y of ``k u + l v`` modulo 1, for
    integers up to `HARMONICS`: where it is low, wide parts of an image have dependent values u and v.
    """
    cost = np.zeros((len(steps),) * 2, np.float32)
    for grid in grids:
        values = (steps @ grid % 1).astype(np.float32)
        distance = abs(values[:, :, None] - values[:, None])
        kernel = (1.5 - distance * (1 - distance)).reshape(len(steps), -1)
        n = grid.shape[1]
        squared = (kernel @ kernel.T / n**2 - (4 / 3) ** 2) / ((1.5**2 - (4 / 3) ** 2) / n)
        np.maximum(cost, squared, out=cost)
    cost += RESONANCE / _least_frequency(steps[:, :2].astype(np.float32))
    np.fill_diagonal(cost, np.inf)
    chosen = list(map(int, np.unravel_index(np.argmin(cost), cost.shape)))
    while len(chosen) < COUNT:
        chosen.append(int(np.argmin(cost[chosen].max(axis=0))))
    return chosen


def _least_frequency(steps: NDArray[np.float32]) -> NDArray[np.float32]:
    least = np.full((len(steps),) * 2, np.inf, np.float32)
    for k in range(1, HARMONICS + 1):
        for m in (*range(1, HARMONICS + 1), *range(-HARMONICS, 0)):
            squared = np.zeros_like(least)
            for step in steps.T:
                sums = k * step[:, None] + m * step
                squared += np.square(sums - np.round(sums))
            np.minimum(least, k * abs(m) * np.sqrt(squared), out=least)
    return np.maximum(least, 1e-3)

"""Search for generator matrices of (0,m,2)-nets with large minimum distance by simulated annealing.

Run once (half a minute): ``python -m analysis.tables.make_optimized_nets``.

Together with i / 2**m, a matrix C gives a (0,m,2)-net if and only if all its leading minors are 1. The
annealing flips entries and rejects matrices without this property. Its energy is the number of pairs of
points closer than a target: zero if that is reached. Matrices of order 7 and 9 that reach theirs have smaller
such matrices in their middle, which are kept.

Larger nets come from two of the matrices, of order 6 and 9, as diag(1, C, 1), repeatedly: see
:func:`qmcjax.sequences.optimized_net`. There a pair that crosses a side border may in the end come
closer by a unit in y, and one that crosses the upper border by a unit in x. These two matrices are searched
until one reaches its target in spite of this loss.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis import squared_min_distance
from analysis.tables import SEQUENCES

TARGETS = {1: 2, 2: 2, 3: 8, 4: 13, 5: 29, 6: 52, 7: 100, 9: 425}
"""Squared distances: those of Table 5.1 in the thesis, but 425 instead of 400 for m = 9."""

CORE = {7: 3, 9: 5}
"""The order of the smaller matrix that is kept in the middle."""

EXTENSIBLE = (6, 9)

CHAINS, STEPS = 128, 20000

HOT, COLD = 0.45, 0.02
"""Mean logarithm of the factor by which the energy may grow, at the start and at the end of a chain."""


def is_net(matrices: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which matrices, shape (chains, m, m), have leading minors 1, by elimination without pivots."""
    rest, m = matrices.copy(), matrices.shape[-1]
    for k in range(m):
        rest[:, k + 1 :] ^= rest[:, k + 1 :, k, None] & rest[:, k, None]
    return np.all(np.diagonal(rest, axis1=1, axis2=2) == 1, axis=1)


def second_coordinates(matrices: NDArray[np.uint8]) -> NDArray[np.int16]:
    """Return C times the bits of i = 0, 1, ..., 2**m - 1 as integers, shape (..., 2**m)."""
    m = matrices.shape[-1]
    columns = np.einsum("...qp,q->...p", matrices, 2 ** np.arange(m - 1, -1, -1, dtype=np.int16))
    y = np.zeros((*matrices.shape[:-2], 1), np.int16)
    for p in range(m):
        y = np.concatenate([y, y ^ columns[..., p : p + 1]], axis=-1)
    return y


def energies(y: NDArray[np.int16], target: int, limits: NDArray[np.float64]) -> NDArray[np.int64]:
    """Count the pairs of points (i, y_i) on the torus that are too close, as far as the count matters.

    ``y``: int16 array, shape (chains, 2**m). ``target``: pairs with a smaller squared distance are counted.
    ``limits``: float array, shape (chains,): a chain is skipped once its count exceeds the limit. Returns
    int64 array, shape (chains,): exact where it does not exceed the limit.
    """
    n = y.shape[1]
    counts, alive = np.zeros(len(y), np.int64), np.arange(len(y))
    for dx in range(1, min(math.isqrt(target - 1) + 1, n)):
        dy = np.abs(np.roll(y, -dx, axis=1) - y)
        counts[alive] += np.count_nonzero(np.minimum(dy, n - dy) <= math.isqrt(target - 1 - dx * dx), axis=1)
        within = counts[alive] <= limits[alive]
        alive, y = alive[within], y[within]
    return counts


def is_extensible(y: NDArray[np.int16], target: int) -> bool:
    """Return whether no pair of points is too close once those across a border have lost their unit."""
    n, i = len(y), np.arange(len(y))
    for dx in range(1, math.isqrt(target - 1) + 2):
        dy = np.abs(np.roll(y, -dx).astype(np.int64) - y)
        lost_dy = np.minimum(dy, n - dy) - (i + dx >= n)
        lost_dx = dx - (2 * dy > n)
        if np.any(lost_dx**2 + lost_dy**2 < target):
            return False
    return True


def anneal(m: int, core: NDArray[np.uint8] | None, rng: np.random.Generator) -> NDArray[np.uint8] | None:
    """Run all chains once; return a matrix that reaches its target and has the core in its middle, if any."""
    start, free = np.eye(m, dtype=np.uint8), np.ones((m, m), bool)
    if core is not None:
        width = (m - len(core)) // 2
        start[width:-width, width:-width] = core
        free[width:-width, width:-width] = False
    rows, columns = np.nonzero(free)
    matrices, energy = np.tile(start, (CHAINS, 1, 1)), np.full(CHAINS, np.inf)
    for step in range(STEPS):
        trial = matrices.copy()
        for flipped in (True, rng.random(CHAINS) < 0.6, rng.random(CHAINS) < 0.3):
            entry = rng.integers(len(rows), size=CHAINS)
            trial[np.arange(CHAINS), rows[entry], columns[entry]] ^= flipped
        temperature = HOT + (COLD - HOT) * step / STEPS
        limits = (energy + 0.5) * np.exp(temperature * rng.exponential(size=CHAINS))
        # A matrix that reaches the target but cannot be extended stays where it is.
        limits[(energy == 0) | ~is_net(trial)] = -1
        y = second_coordinates(trial)
        found = energies(y, TARGETS[m], limits)
        accepted = found <= limits
        matrices[accepted], energy[accepted] = trial[accepted], found[accepted]
        for chain in np.flatnonzero(accepted & (found == 0)):
            if m not in EXTENSIBLE or is_extensible(y[chain], TARGETS[m]):
                return matrices[chain]
    return None


def search(m: int, core: NDArray[np.uint8] | None, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return a matrix of order m that reaches its target."""
    found = None
    while found is None:
        found = anneal(m, core, rng)
    return found


def main(folder: Path = SEQUENCES) -> None:
    """Write optimized_nets.txt into a folder."""
    rng, matrices = np.random.default_rng(0), {}
    lines = ["# m, squared minimum distance on the integer grid, rows of the matrix from the first digit on"]
    for m in TARGETS:
        matrix = matrices[m] = search(m, matrices.get(CORE.get(m)), rng)
        points = np.stack([np.arange(2**m), second_coordinates(matrix)], axis=1)
        distance = squared_min_distance(points, 2**m)
        lines.append(f"{m} {distance} " + " ".join("".join(map(str, row)) for row in matrix))
        print(lines[-1])
    (folder / "optimized_nets.txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

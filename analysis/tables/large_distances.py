"""Nets and lattices of large minimum distance: in the plane by annealing, in space by other searches.

**In the plane.** Together with i / 2**m, a matrix C gives a (0,m,2)-net if and only if all its leading minors
are 1. The annealing flips entries and rejects matrices without this property. Its energy is the number of
pairs of points closer than a target: zero if the target is reached. Matrices of order 7 and 9 that reach
their targets have smaller such matrices in their middle, which are kept.

Larger nets come from two of the matrices, of order 6 and 9, as diag(1, C, 1), repeatedly: see
:func:`qmcjax.sequences.optimized_net`. There a pair across a side border may come closer by a unit in y, and
a pair across the upper border by a unit in x. These two matrices are searched until one reaches its target in
spite of this loss.

**In space.** The (0,m,3)-nets and the (0,2)-sequence are results of :func:`analysis.search_matrices`. Longer
searches with the same method showed that the targets can be reached in short time. They may not be the
largest distances. For rank-1 lattices all pairs of components are compared.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis import MatrixSearch, search_matrices, squared_min_distance
from qmcjax.core.number_theory import best_spatial

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


def plane_nets() -> Iterator[str]:
    """Yield the matrices of optimized_net, order after order."""
    rng, matrices = np.random.default_rng(0), {}
    yield "# m, squared minimum distance on the integer grid, rows of the matrix from the first digit on\n"
    for m in TARGETS:
        matrix = None
        while matrix is None:
            matrix = anneal(m, matrices.get(CORE.get(m)), rng)
        matrices[m] = matrix
        points = np.stack([np.arange(2**m), second_coordinates(matrix)], axis=1)
        yield f"{m} {squared_min_distance(points, 2**m)} {_digits(matrix[None])}\n"


# fmt: off
NETS = {
    2: 6, 3: 12, 4: 30, 5: 82, 6: 166, 7: 458, 8: 893, 9: 1984, 10: 4375, 11: 10277, 12: 24078, 13: 58446,
    14: 136368, 15: 304387, 16: 689191,
}
"""Squared distances for the nets, each searched for itself."""

SEQUENCE = {
    2: 6, 3: 9, 4: 17, 5: 37, 6: 73, 7: 150, 8: 365, 9: 850, 10: 2080, 11: 4900, 12: 12000, 13: 30000,
    14: 72000, 15: 176000, 16: 430000,
}
"""Squared distances for the nets of one sequence."""
# fmt: on

SEEDS = {4: 3, 6: 3}
"""The seeds of the nets that are slow to find with seed 0."""


LATTICES = """\
# Rank-1 lattices of n points, generating vector (1, a, b), of the largest toroidal minimum distance:
# all a and b were compared.
# Made by python -m analysis.tables rank1_lattices.txt
# n a b squared minimum distance times n**2
"""


def space_nets() -> Iterator[str]:
    """Yield the matrices of optimized_net_3d, order after order."""
    yield "# m, squared minimum distance on the integer grid, rows of C_1, rows of C_2, first digits first\n"
    for m, target in NETS.items():
        found = reach({m: target}, SEEDS.get(m, 0))
        yield f"{m} {found.squared[m]} {_digits(found.matrices)}\n"


def sequence() -> Iterator[str]:
    """Yield the matrices of optimized_sequence."""
    found = reach(SEQUENCE, 0)
    squared = " ".join(map(str, found.squared.values()))
    yield (
        f"# squared minimum distances of the nets of m = 2, ..., 16: {squared}\n"
        "# order, rows of C_1, rows of C_2, first digits first\n"
        f"16 {_digits(found.matrices)}\n"
    )


def reach(targets: dict[int, int], seed: int) -> MatrixSearch:
    """Return matrices that reach the targets."""
    found = search_matrices(targets, seed=seed)
    if not found.reached:
        raise RuntimeError(f"{targets} not reached with seed {seed} in {found.steps} steps")
    return found


def _digits(matrices: NDArray[np.uint8]) -> str:
    """Return the rows of matrices as strings of digits."""
    return " ".join("".join(map(str, row)) for matrix in matrices for row in matrix)


def lattices() -> Iterator[str]:
    """Yield the best rank-1 lattices in space of 2**1 to 2**16 points."""
    rows = [(2**m, *best_spatial(2**m)) for m in range(1, 17)]
    yield LATTICES + "".join(" ".join(map(str, row)) + "\n" for row in rows)

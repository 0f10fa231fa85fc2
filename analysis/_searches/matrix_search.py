"""Search for generator matrices of (0,2)-sequences whose nets have large minimum distances.

C_1 and C_2 generate a (0,2)-sequence in base 2 if and only if C_1 = L_1 U and C_2 = L_2 P U, where P is
Pascal's triangle modulo 2, the L are lower and U is upper triangular, all with ones on the diagonal (Hofer
and Suzuki). In short: the leading minors of C_1 are 1, hence C_1 = L_1 U, and likewise C_2 U^-1 = L_2 V with
an upper triangular V. Then I and V generate a (0,2)-sequence, too, so the minors of V with the first j
rows and any j adjacent columns are 1. These determine V, entry by entry, and P satisfies them.

So annealing may flip any entries off the diagonals and visits (0,2)-sequences only. Elementary intervals that
are as close to cubes as possible contain one point of a net each, in a grid: close pairs are in neighbouring
cells, found by array look-ups.
"""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis import _arguments
from analysis._distances.distance import squared_min_distance
from analysis._host import Budget
from qmcjax.core import checks

LARGEST = 16
"""Bits of the words of coordinates; their differences wrap as on the torus."""

CHAIN = 40000
"""Steps per random start."""

HOT, COLD = 0.15, 0.03
"""Mean logarithm of the factor by which the energy may grow, at the start and at the end of a chain."""

CHUNK = 2**16
"""Pairs of points that are measured at once, before the energy is compared with its limit."""


class MatrixSearch(NamedTuple):
    """The result of :func:`search_matrices`."""

    matrices: NDArray[np.uint8]
    """The upper left parts of C_1 and C_2, shape (2, M, M) for the largest target's M."""
    squared: dict[int, int]
    """The squared minimum distance of each net with a target."""
    reached: bool
    """Whether all of them reach their targets."""
    steps: int
    """Number of matrices tried."""


class _Net:
    """The pairs of neighbouring cells in which points may be closer than the target."""

    def __init__(self, m: int, target: int, dims: int):
        self.m, self.dims = m, dims
        self.target = target * 4 ** (LARGEST - m)
        # Each pair that is too close counts up to 1; larger nets, which have more pairs, are scaled down.
        self.weight = 2 ** (-m / 2) / self.target
        self.digits = [(m + d) // dims for d in range(dims)]
        shape = tuple(2**k for k in self.digits)
        sides = np.array(shape)[:, None]
        offsets = np.indices(shape).reshape(dims, -1)
        steps = np.minimum(offsets, sides - offsets)
        gaps = np.where(steps > 0, (steps - 1) / sides + 2.0**-m, 0)
        opposite = np.ravel_multi_index(tuple(-offsets % sides), shape)
        near = (gaps**2).sum(axis=0) * 4**m < target
        # One of an offset and its opposite is enough.
        chosen = np.flatnonzero(near & (np.arange(2**m) <= opposite))[1:]
        chosen = chosen[np.argsort(((steps / sides) ** 2).sum(axis=0)[chosen], kind="stable")]
        neighbours = (offsets[:, None] + offsets[:, chosen, None]) % sides[:, None]
        self.neighbours = np.asarray(np.ravel_multi_index(tuple(neighbours), shape), np.int32)

    def points(self, columns: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """Return the points as words, shape (dims, 2**m): i / 2**m if dims is 3, and C_1 i and C_2 i."""
        words = np.zeros((2, 1), np.uint16)
        for column in columns[:, : self.m].T:
            words = np.concatenate([words, words ^ column[:, None]], axis=1)
        words &= np.uint16(2**LARGEST - 2 ** (LARGEST - self.m))
        if self.dims == 2:
            return words
        first = np.arange(2**self.m, dtype=np.uint16) << np.uint16(LARGEST - self.m)
        return np.concatenate([first[None], words])

    def energy(self, columns: NDArray[np.uint16], limit: float) -> float:
        """Sum up by how much pairs of points are too close; a sum above the limit may be incomplete."""
        points = self.points(columns)
        cells = np.zeros(2**self.m, np.int32)
        for row, digits in zip(points, self.digits, strict=True):
            cells = cells << digits | row >> (LARGEST - digits)
        ordered = np.empty_like(points)
        ordered[:, cells] = points
        lacking, count = 0, max(1, CHUNK >> self.m)
        for start in range(0, len(self.neighbours), count):
            chunk = self.neighbours[start : start + count]
            squared = np.zeros(chunk.shape, np.uint32)
            for row in ordered:
                # The difference of two words, as a signed word, is the shorter way around the torus.
                delta = (row.take(chunk) - row).view(np.int16).astype(np.int32)
                squared += (delta * delta).view(np.uint32)
            lacking += int((self.target - np.minimum(squared, self.target)).sum())
            if lacking * self.weight > limit:
                break
        return lacking * self.weight


def search_matrices(
    targets: Mapping[int, int],
    *,
    dims: int = 3,
    seed: int = 0,
    steps: int = 10**6,
    budget_s: float = math.inf,
) -> MatrixSearch:
    """Search for a (0,2)-sequence in base 2 with nets of given minimum distances, by simulated annealing.

    Parameters
    ----------
    targets : mapping of int to int
        The squared toroidal distance on the integer grid to reach, for each m in [1, 16] that matters: one
        for a single net, several for a sequence that is good at all these sizes.
    dims : int
        3 to measure the (0,m,3)-nets of the points (i / 2**m, C_1 i, C_2 i), 2 for the (0,m,2)-nets of
        the first 2**m points of the sequence, truncated to m digits.
    seed : int, in [0, 2**32)
    steps : int
        Maximum number of matrices to try. Positive.
    budget_s : float
        Seconds after which to stop. Unless time runs out, the result only depends on the other arguments.

    Returns
    -------
    MatrixSearch
        The first matrices that reach all targets, or the closest ones: those with the smallest sum over all
        pairs of the excess of the targets over the squared distances, relative to the targets.

    Notes
    -----
    An upper triangular factor U only renumbers the first 2**m points. So it matters only in three dimensions,
    where the search covers every (0,m,3)-net that is digital over F_2, up to the numbering of its points.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.3.
    .. [2] R. Hofer, K. Suzuki, "A complete classification of digital (0,m,3)-nets and digital
       (0,2)-sequences in base 2", 2019.

    Examples
    --------
    >>> search_matrices({3: 12}, seed=1).squared
    {3: 12}
    """
    dims = checks.integer("dims", dims, 2, 3)
    seed = checks.integer("seed", seed, 0, checks.INDEX_LIMIT - 1)
    steps = checks.integer("steps", steps, 1, 2**63 - 1)
    budget_s = _arguments.real("budget_s", budget_s, "positive", lambda seconds: seconds > 0)
    nets = [_Net(m, target, dims) for m, target in _validate_targets(targets, dims).items()]
    budget = Budget(steps, budget_s)
    trials = _trials(nets, np.random.default_rng(seed))
    best, least = next(trials)
    budget.steps = 1
    while least > 0 and budget.step():
        triangles, energy = next(trials)
        if energy < least:
            best, least = triangles, energy
    matrices = _matrices(best)
    columns = _columns(matrices)
    squared = {
        net.m: squared_min_distance((net.points(columns) >> (LARGEST - net.m)).T, 2**net.m) for net in nets
    }
    return MatrixSearch(matrices, squared, least == 0, budget.steps)


def _validate_targets(targets: Mapping[int, int], dims: int) -> dict[int, int]:
    """Return the targets from the smallest net on, or raise a ValueError if there are none."""
    if not isinstance(targets, Mapping) or not targets:
        raise ValueError(f"targets must map at least one m to a squared distance, got {targets!r}")
    checked = {checks.integer("m of targets", m, 2, LARGEST): targets[m] for m in targets}
    # No two points on the torus are farther from each other than half a diagonal.
    return {m: checks.integer(f"targets[{m}]", checked[m], 1, dims * 4 ** (m - 1)) for m in sorted(checked)}


def _trials(nets: list[_Net], rng: np.random.Generator) -> Iterator[tuple[NDArray[np.uint8], float]]:
    """Yield the result of each step, chain after chain: L_1, L_2, U transposed; their energy."""
    size, factors = nets[-1].m, nets[-1].dims
    while True:
        triangles = np.tril(rng.integers(2, size=(3, size, size), dtype=np.uint8), -1)
        triangles |= np.eye(size, dtype=np.uint8)
        energy = _energy(nets, triangles, math.inf)
        yield triangles, energy
        for step in range(1, CHAIN):
            trial = triangles.copy()
            for changes in (True, rng.random() < 0.5, rng.random() < 0.25):
                factor, adds = rng.integers(factors), rng.random() < 0.3
                column, row = sorted(rng.choice(size, 2, replace=False))
                if changes:
                    # Either way the diagonal stays.
                    trial[factor, row] ^= trial[factor, column] if adds else np.arange(size) == column
            temperature = HOT * (COLD / HOT) ** (step / CHAIN)
            limit = energy * math.exp(temperature * rng.exponential())
            found = _energy(nets, trial, limit)
            if found <= limit:
                triangles, energy = trial, found
            yield triangles, energy


def _energy(nets: list[_Net], triangles: NDArray[np.uint8], limit: float) -> float:
    columns, energy = _columns(_matrices(triangles)), 0.0
    for net in nets:
        energy += net.energy(columns, limit - energy)
        if energy > limit:
            break
    return energy


def _matrices(triangles: NDArray[np.uint8]) -> NDArray[np.uint8]:
    index = np.arange(triangles.shape[1])
    pascal = (index[:, None] & index == index[:, None]).astype(np.uint8)
    upper = triangles[2].T
    # Sums of products stay below 256.
    return np.stack([triangles[0] @ upper, triangles[1] @ (pascal @ upper & 1)]) & np.uint8(1)


def _columns(matrices: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Pack each column of the matrices into a word, its first row in the highest bit."""
    weights = np.uint16(1) << np.arange(LARGEST - 1, -1, -1, dtype=np.uint16)
    return np.einsum("...rc,r->...c", matrices, weights[: matrices.shape[1]], dtype=np.uint16)

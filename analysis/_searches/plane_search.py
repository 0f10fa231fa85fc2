"""Search for point sets of small star discrepancy in the plane: over ranks, with the best coordinates.

Ranks come from lattices of a real number field, drawn at random and improved by small changes. Then
neighbouring ranks are swapped at random while a level of discrepancy can be kept, which is lowered from time
to time ("great deluge"), raised when it gets stuck, and lowered again. After some time, other lattices
follow. A step is one lattice, or 2 n swaps.

The conjugates of the integers of Q(sqrt 5) form a lattice. The product of a point's coordinates is the norm
of an integer and stays away from 0: sections of the lattice have discrepancies of the smallest known order.
Stretching the axes by factors of product 1, translating the lattice and choosing its density gives a family
with a few parameters and thousands of different ranks.
"""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis._host import compiled
from analysis._searches.budget import Budget
from analysis._searches.ranks_plane import tighten, walk
from analysis._star.star_discrepancy import star_discrepancy

_LATTICES = 256
"""Lattices in the first round; each further round has half as many again."""

_LATTICES_A_STAGE = 16
"""Number of lattices that take about as long as a stage of annealing, to share the time."""

_PATIENCE = 10
"""Stages without progress after which an annealing ends."""

_ROUNDS = 8
"""Maximum number of corrections per coordinate before a level counts as out of reach."""

_HEATS = 1e-3, 3e-2
"""Relative increase of the level before an annealing."""

_LEAST = 1e-4
"""Smallest relevant relative gain during the search for ranks."""

_ABOVE_ZERO = 2.0**-52
"""Smallest coordinate: coordinates are divisors."""

_NO_LESS = 1 + 1e-10
"""Factor from a star discrepancy to a level, which covers its rounding errors."""

_BASIS = np.vander((1 + np.sqrt(np.array([5.0, 5.0])) * [1, -1]) / 2, 2, increasing=True)
"""Conjugates, one per row, of 1 and the golden ratio. The determinant is the root of the discriminant, 5."""

Floats = NDArray[np.float64]


def search_plane(n: int, budget: Budget, rng: np.random.Generator, start: Floats | None) -> Floats:
    """Return n points of small star discrepancy in the plane, at most that of ``start``."""
    if start is None:
        i = np.arange(n) + 0.5
        start = np.stack([i / n, i * ((1 + math.sqrt(5)) / 2) ** -1.0 % 1], axis=1)
    best = Ranked(start, star_discrepancy(start) * _NO_LESS)
    search = _Search(best, budget, rng)
    search.run()
    return search.best.points()


class Ranked:
    """Points in the order of their coordinates, and a level: an upper bound of their star discrepancy."""

    def __init__(self, points: Floats, level: float) -> None:
        self.level = level
        order = np.argsort(points, axis=0, kind="stable").T
        ranks = np.argsort(order, axis=1)
        x, y = np.maximum(np.sort(points, axis=0).T, _ABOVE_ZERO)
        self.state = [x.copy(), y.copy(), ranks[1, order[0]], ranks[0, order[1]]]

    def copy(self) -> Ranked:
        other = copy.copy(self)
        other.state = [array.copy() for array in self.state]
        return other

    def points(self) -> Floats:
        x, y, of_x, _ = self.state
        return np.stack([x, y[of_x]], axis=1)

    def reach(self, level: float, rounds: int = _ROUNDS) -> bool:
        """Move the coordinates so that they reach a level, if possible."""
        if not tighten(*self.state, level, rounds):
            return False
        self.level = level
        return True

    def lower(self, step: float, least: float, rounds: int = _ROUNDS) -> None:
        """Lower the level by relative steps, halved where one is too large."""
        while step > least:
            if not self.reach(self.level * (1 - step), rounds):
                step /= 2

    def walk(self, draws: Floats) -> None:
        """Try to swap neighbouring ranks at this level."""
        walk(*self.state, self.level, draws)


class _Search:
    """Rounds of lattices and annealing, until the budget is spent."""

    def __init__(self, best: Ranked, budget: Budget, rng: np.random.Generator) -> None:
        self.best, self.budget, self.rng = best, budget, rng

    def run(self) -> None:
        """Anneal the best points and those of new lattices in turn, with increasing lengths."""
        self.best.lower(0.1, _LEAST)
        lattices = _LATTICES
        while self.budget.spent() < 1:
            self._anneal(self.best, lattices)
            self._anneal(self._scan(lattices), lattices)
            lattices += lattices // 2
        self.best.lower(_LEAST, 1e-8, 50)

    def _keep(self, ranked: Ranked) -> None:
        if ranked.level < self.best.level:
            self.best = ranked.copy()

    def _scan(self, count: int) -> Ranked:
        """Return the best of some lattices: half of them arbitrary, half of them near the best so far."""
        n = len(self.best.points())
        found, where = None, None
        for _ in range(count):
            if not self.budget.step():
                break
            if where is None or self.rng.random() < 0.5:
                lattice = random_lattice(n, self.rng)
            else:
                lattice = nearby(where, self.rng)
            points = section(lattice)
            if len(points) != n:
                continue
            ranked = Ranked(points, 1.0)
            if ranked.reach(4 * self.best.level if found is None else found.level * (1 - _LEAST)):
                ranked.lower(0.1, _LEAST)
                found, where = ranked, lattice
                self._keep(ranked)
        return found or self.best

    def _anneal(self, base: Ranked, lattices: int) -> None:
        """Swap ranks while the level decreases, repeatedly."""
        n = len(self.best.points())
        ranked, failures, heat, step = base, _PATIENCE, 0.0, 0.0
        for _ in range(lattices // _LATTICES_A_STAGE):
            if not self.budget.step():
                break
            if failures == _PATIENCE:
                ranked = base.copy()
                heat = np.exp(self.rng.uniform(*np.log(_HEATS)))
                ranked.level *= 1 + heat
                failures, step = 0, heat / 16
            ranked.walk(self.rng.random(2 * n))
            if ranked.reach(ranked.level * (1 - step)):
                failures, step = 0, min(2 * step, heat / 16)
                if ranked.level < base.level:
                    base = ranked.copy()
                    self._keep(base)
            else:
                failures, step = failures + 1, step / 2


class FieldLattice(NamedTuple):
    """The position of a lattice."""

    stretch: Floats
    """Logarithms of factors along the axes, their sum 0."""
    offset: Floats
    """In units of the basis."""
    density: float
    """Mean number of points in the unit square."""


def random_lattice(n: int, rng: np.random.Generator) -> FieldLattice:
    """Draw a lattice; units of the field make all larger stretches equivalent to one of these."""
    stretch = rng.uniform(-1, 1, 2)
    return FieldLattice(stretch - stretch.mean(), rng.random(2), n + rng.uniform(-1, 1))


def nearby(lattice: FieldLattice, rng: np.random.Generator) -> FieldLattice:
    """Change a lattice slightly."""
    scale = 10 ** rng.uniform(-4, -1)
    stretch = lattice.stretch + scale * rng.standard_normal(len(lattice.stretch))
    offset = lattice.offset + scale * rng.standard_normal(len(lattice.offset))
    return FieldLattice(stretch - stretch.mean(), offset, lattice.density + scale * rng.standard_normal())


def section(lattice: FieldLattice) -> Floats:
    """Return the points of a lattice in [0, 1)^2, in the order of the first coordinate."""
    stretch, offset, density = lattice
    scaled = _BASIS * np.exp(stretch)[:, None] * (density * abs(np.linalg.det(_BASIS))) ** (-1 / 2)
    # The corners of the square, in units of the basis.
    corners = np.indices((2, 2)).reshape(2, -1).T @ np.linalg.inv(scaled).T - offset
    low, high = np.floor(corners.min(axis=0)), np.ceil(corners.max(axis=0))
    points = _inside(scaled, offset, low, (high - low).astype(np.int64) + 1)
    return points[np.argsort(points[:, 0], kind="stable")]


@compiled
def _inside(scaled: Floats, offset: Floats, low: Floats, sizes: NDArray[np.int64]) -> Floats:
    """Return the lattice points in the unit square; ``low`` and ``sizes`` bound the coefficients."""
    dims = len(offset)
    found = np.empty((np.prod(sizes) + 1, dims))
    count = 0
    for index in range(len(found) - 1):
        rest, inside = index, True
        point = found[count]
        point[:] = 0.0
        for b in range(dims):
            step = low[b] + rest % sizes[b] + offset[b]
            rest //= sizes[b]
            for a in range(dims):
                point[a] += scaled[a, b] * step
        for a in range(dims):
            inside = inside and 0 <= point[a] < 1
        if inside:
            count += 1
    return found[:count].copy()

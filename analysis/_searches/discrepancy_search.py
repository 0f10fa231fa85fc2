"""Search for point sets of small star discrepancy: over ranks in the plane, by the largest boxes in space.

Initial ranks are those of lattices of a number field: the conjugates of the integers of Q(sqrt 5)
form a lattice. The product of a point's coordinates is the norm of an integer and stays away from 0: sections
of the lattice have discrepancies of the smallest known order. Stretching the axes by factors of product 1,
translating the lattice and choosing its density gives a family with a few parameters and thousands of
different ranks.
"""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import jax
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from analysis import _arguments
from analysis._discrepancy.star_discrepancy import star_discrepancy
from analysis._host import Budget, compiled
from analysis._searches.box_search import search_boxes
from analysis._searches.ranks_plane import tighten, walk
from qmcjax.core import checks

_LARGEST = {2: 4096, 3: 512}
"""Maximum number of points in two and three dimensions: for more, one step would take minutes."""


class DiscrepancySearch(NamedTuple):
    """The result of :func:`search_discrepancy`."""

    points: NDArray[np.float64]
    """Shape (n, dims), in [0, 1)^dims, in the order of the first coordinate."""
    discrepancy: float
    """Their star discrepancy, as computed by :func:`star_discrepancy`."""
    steps: int
    """Number of steps taken."""
    seconds: float
    """Run time."""


def search_discrepancy(
    n: int,
    seconds: float | None,
    key: Array | int,
    dims: int = 2,
    *,
    steps: int | None = None,
    start: ArrayLike | None = None,
) -> DiscrepancySearch:
    """Search for n points of small star discrepancy, in two or three dimensions.

    Parameters
    ----------
    n : int, in [2, 4096] in two dimensions, in [2, 512] in three
    seconds : float, optional
        When to stop, positive. None stops only by ``steps``.
    key : jax.random.key, or int in [0, 2**32)
    dims : int, 2 or 3
    steps : int, optional
        Maximum number of steps, positive. With ``seconds=None``, the result only depends on the other
        arguments.
    start : float ArrayLike, shape (n, dims), optional
        Initial points in [0, 1)^dims, for example from an earlier search: the result is not worse.

    Returns
    -------
    DiscrepancySearch, with ``points``, float64, and their exact ``discrepancy``

    Notes
    -----
    In two dimensions, coordinates with given ranks reach a star discrepancy if they satisfy difference
    constraints on their logarithms (see [1]_): bisection and the Bellman-Ford algorithm find the best
    coordinates for the ranks. Ranks come from lattices of a real number field, drawn at random and improved
    by small changes. Then neighbouring ranks are swapped at random as long as a level of discrepancy can be
    kept. The level is lowered from time to time ("great deluge", [2]_), raised when the search is stuck, and
    lowered again. After some time, other lattices follow. A step is one lattice, or 2 n swaps.

    In three dimensions, all boxes close to the largest local discrepancy are lowered together, by gradients
    of a smooth maximum, from many starts and later from perturbations of the best points. A step is one
    descent.

    Numba compiles the loops if it is installed (``pip install qmcjax[fast]``), which takes a few seconds at
    the first call. Without Numba the search is the same, but about a hundred times slower.

    References
    ----------
    .. [1] F. Clement, C. Doerr, K. Klamroth, L. Paquete, "Searching permutations for constructing uniformly
       distributed point sets", PNAS 122, 2025.
    .. [2] G. Dueck, "New optimization heuristics: the great deluge algorithm and the record-to-record
       travel", J. Comput. Phys. 104, 1993.

    Examples
    --------
    >>> found = search_discrepancy(5, None, key=1, steps=40)
    >>> print(round(found.discrepancy, 3), found.points.shape)
    0.2 (5, 2)
    """
    dims = checks.integer("dims", dims, 2, 3)
    n = checks.integer("n", n, 2, _LARGEST[dims])
    if seconds is not None:
        seconds = _arguments.positive("seconds", seconds)
    if steps is not None:
        steps = checks.integer("steps", steps, 1, 2**63 - 1)
    if seconds is None and steps is None:
        raise ValueError("seconds must be a number where steps is None, got None")
    rng = np.random.default_rng(np.asarray(jax.random.key_data(checks.prng_key("key", key))))
    given = None
    if start is not None:
        given = _arguments.points(start, "start", least=n, least_dims=dims, most_dims=dims)
        if len(given) != n:
            raise ValueError(f"start must have shape ({n}, {dims}), got {given.shape}")
        given = given.astype(np.float64)
    budget = Budget(steps, seconds)
    if dims == 2:
        points = search_plane(n, budget, rng, given)
    else:
        points = search_boxes(n, dims, budget, rng, given)
        points = points[np.argsort(points[:, 0], kind="stable")]
    found = star_discrepancy(points)
    if given is not None and (earlier := star_discrepancy(given)) < found:
        points, found = given[np.argsort(given[:, 0], kind="stable")], earlier
    return DiscrepancySearch(points, found, budget.steps, budget.seconds())


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
        """Move the coordinates to reach a level, if possible."""
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

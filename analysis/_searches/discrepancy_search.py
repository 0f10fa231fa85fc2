"""Search for point sets of small star discrepancy: over ranks, with the best coordinates for each."""

import math
import time
from typing import NamedTuple

import jax
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from analysis import _arguments
from analysis._searches import ranks_plane, ranks_space
from analysis._searches.field_lattices import nearby, random_lattice, section
from analysis._searches.ranks_program import improved
from analysis._star.star_discrepancy import star_discrepancy
from qmcjax.core import checks

_LARGEST = {2: 4096, 3: 512}
"""Maximum number of points in two and three dimensions: beyond, one set of ranks would take minutes."""

_LATTICES = 256
"""Lattices in the first round; each further round has half as many again."""

_LATTICES_A_STAGE = {2: 16, 3: 4}
"""Number of lattices that take about as long as a stage of annealing, to share the time."""

_PATIENCE = 10
"""Stages without progress after which an annealing ends."""

_ROUNDS = {2: 8, 3: 6}
"""Maximum number of corrections per coordinate before a level counts as out of reach."""

_HEATS = 1e-3, 3e-2
"""Relative increase of the level before an annealing."""

_LEAST = {2: 1e-4, 3: 1e-3}
"""Smallest relevant relative gain during the search for ranks."""

_ABOVE_ZERO = 2.0**-52
"""Smallest coordinate: coordinates are divisors."""

_NO_LESS = 1 + 1e-10
"""Factor from a star discrepancy to a level, which covers its rounding errors."""


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


class _Ranked:
    """Points in the order of their coordinates, and a level: an upper bound of their star discrepancy."""

    def __init__(self, points: NDArray[np.float64], level: float) -> None:
        self.level = level
        self.dims = points.shape[1]
        order = np.argsort(points, axis=0, kind="stable").T
        ranks = np.argsort(order, axis=1)
        ends = np.maximum(np.sort(points, axis=0).T, _ABOVE_ZERO)
        if self.dims == 2:
            self.state = [ends[0].copy(), ends[1].copy(), ranks[1, order[0]], ranks[0, order[1]]]
        else:
            self.state = [ends, ranks, np.ascontiguousarray(order)]

    def copy(self) -> "_Ranked":
        other = object.__new__(_Ranked)
        other.dims, other.level, other.state = self.dims, self.level, [array.copy() for array in self.state]
        return other

    def points(self) -> NDArray[np.float64]:
        if self.dims == 2:
            x, y, of_x, _ = self.state
            return np.stack([x, y[of_x]], axis=1)
        ends, ranks, order = self.state
        return np.stack([ends[a, ranks[a]] for a in range(3)], axis=1)[order[0]]

    def reach(self, level: float, rounds: int | None = None) -> bool:
        """Move the coordinates so that they reach a level, if possible."""
        tighten = ranks_plane.tighten if self.dims == 2 else ranks_space.tighten
        if not tighten(*self.state, level, rounds or _ROUNDS[self.dims]):
            return False
        self.level = level
        return True

    def lower(self, step: float, least: float, rounds: int | None = None) -> None:
        """Lower the level by relative steps, halved where one is too large."""
        while step > least:
            if not self.reach(self.level * (1 - step), rounds):
                step /= 2

    def settle(self) -> None:
        """Find the best coordinates for these ranks, in space; in the plane small steps reach them."""
        if self.dims == 3:
            ends, ranks, _ = self.state
            better, level = improved(ends, ranks, self.level)
            if level < self.level:
                ends[:], self.level = better, level * _NO_LESS

    def walk(self, draws: NDArray[np.float64]) -> None:
        """Try to swap neighbouring ranks at this level."""
        (ranks_plane.walk if self.dims == 2 else ranks_space.walk)(*self.state, self.level, draws)


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
        When to stop, positive. None stops by ``steps`` alone.
    key : jax.random.key, or int in [0, 2**32)
    dims : int, 2 or 3
    steps : int, optional
        Maximum number of steps, positive. With ``seconds=None``, the result is a function of the
        other arguments.
    start : float ArrayLike, shape (n, dims), optional
        Points in [0, 1)^dims to continue from, for example from an earlier search: the result is no worse.

    Returns
    -------
    DiscrepancySearch, with ``points``, float64, and their exact ``discrepancy``

    Notes
    -----
    Whether coordinates exist that reach a star discrepancy for given ranks is a system of constraints (see
    [1]_). In two dimensions these are differences of logarithms: the best coordinates for the ranks are found
    by bisection and the Bellman-Ford algorithm. In three dimensions they are found by moving one coordinate
    at a time, which may miss some, and by occasional linear programs.

    Ranks come from lattices of totally real number fields, drawn at random and improved by small changes.
    Then neighbouring ranks are swapped at random while a level of discrepancy can be kept, which is
    lowered from time to time ("great deluge", [2]_), raised when it gets stuck, and lowered again. After some
    time, other lattices follow. A step is one lattice, or 2 n swaps.

    Loops are compiled if Numba is installed (``pip install qmcjax[fast]``), which takes some seconds at the
    first call. Without Numba the search is the same, and about a hundred times slower.

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
    best = given = None
    if start is not None:
        given = _arguments.points(start, "start", least=n, least_dims=dims, most_dims=dims)
        if len(given) != n:
            raise ValueError(f"start must have shape ({n}, {dims}), got {given.shape}")
        given = given.astype(np.float64)
        # The level is no less than the discrepancy in spite of rounding.
        best = _Ranked(given, star_discrepancy(given) * _NO_LESS)
    search = _Search(best or _Ranked(*_kronecker(n, dims)), rng, steps, seconds)
    search.run()
    points = search.best.points()
    found = star_discrepancy(points)
    if given is not None and (earlier := star_discrepancy(given)) < found:
        points, found = given[np.argsort(given[:, 0], kind="stable")], earlier
    return DiscrepancySearch(points, found, search.steps, time.monotonic() - search.began)


def _kronecker(n: int, dims: int) -> tuple[NDArray[np.float64], float]:
    """Return points as a baseline, and their star discrepancy."""
    ratio = {2: (1 + math.sqrt(5)) / 2, 3: 1.324717957244746}[dims]
    i = np.arange(n)[:, None]
    points = np.hstack([(i + 0.5) / n, (i + 0.5) * ratio ** -np.arange(1.0, dims) % 1])
    return points, star_discrepancy(points) * _NO_LESS


class _Search:
    """Rounds of lattices and annealing, until steps or time run out."""

    def __init__(
        self, best: _Ranked, rng: np.random.Generator, steps: int | None, seconds: float | None
    ) -> None:
        self.best, self.rng = best, rng
        self.steps, self.began = 0, time.monotonic()
        self.most = math.inf if steps is None else steps
        self.seconds = math.inf if seconds is None else seconds

    def run(self) -> None:
        """Anneal the best points and those of new lattices in turn, with increasing lengths."""
        self.best.lower(0.1, _LEAST[self.best.dims])
        lattices = _LATTICES
        while not self._over():
            self._anneal(self.best, lattices)
            self._anneal(self._scan(lattices), lattices)
            lattices += lattices // 2
        if self.best.dims == 2:
            self.best.lower(_LEAST[2], 1e-8, 50)
        self.best.settle()

    def _over(self) -> bool:
        return self.steps >= self.most or time.monotonic() - self.began > self.seconds

    def _keep(self, ranked: _Ranked) -> None:
        if ranked.level < self.best.level:
            self.best = ranked.copy()

    def _scan(self, count: int) -> _Ranked:
        """Return the best of some lattices: half of them arbitrary, half of them near the best so far."""
        n, dims = self.best.points().shape
        found, where = None, None
        for _ in range(count):
            if self._over():
                break
            self.steps += 1
            if where is None or self.rng.random() < 0.5:
                lattice = random_lattice(n, dims, self.rng)
            else:
                lattice = nearby(where, self.rng)
            points = section(lattice)
            if len(points) != n:
                continue
            ranked = _Ranked(points, 1.0)
            if ranked.reach(4 * self.best.level if found is None else found.level * (1 - _LEAST[dims])):
                ranked.lower(0.1, _LEAST[dims])
                found, where = ranked, lattice
                self._keep(ranked)
        return found or self.best

    def _anneal(self, base: _Ranked, lattices: int) -> None:
        """Swap ranks while the level decreases, repeatedly."""
        n = len(self.best.points())
        ranked, settled, failures, heat, step = base, None, _PATIENCE, 0.0, 0.0
        for _ in range(lattices // _LATTICES_A_STAGE[self.best.dims]):
            if self._over():
                break
            self.steps += 1
            if failures == _PATIENCE:
                if settled is not base:
                    base.settle()
                    self._keep(base)
                    settled = base
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

"""Exhaustive search over all (0,m,s)-nets in base 2 for the largest minimum distance.

The cells of the grid are the bits of a Python integer, the candidates. Two points exclude each other if
they are too close, or share an elementary interval of volume 2**-m: 2**m points without such a pair are
a net, since there are equally many intervals of each shape. The next point goes to the elementary
interval with the fewest candidates, which may be a column of the grid or any other; an interval without
candidates ends the branch.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from analysis import _arguments
from analysis._distances.distance import squared_min_distance
from analysis._host import Budget
from qmcjax.core import checks

_LARGEST = {2: 8, 3: 5}
"""Largest m by dims: beyond, the tables of mutual exclusion could take gigabytes."""


@dataclass(frozen=True)
class NetSearch:
    """The result of a search for a net of large minimum distance."""

    points: NDArray[np.int64] | None
    """The best net, shape (2**m, dims), on the grid of side 2**m in order of the first coordinate;
    None if no net was found."""
    squared_distance: int | None
    """The square of its toroidal minimum distance on this grid."""
    exhausted: bool
    """Whether the search was complete. This proves that no net of this m has a larger distance or, if none
    was found, that none reaches the requested distance."""


def search_net(
    m: int, dims: int = 2, minimum_squared_distance: int = 1, budget_s: float | None = None
) -> NetSearch:
    """Search all (0,m,s)-nets in base 2 on the grid of side 2**m for the largest toroidal minimum distance.

    Parameters
    ----------
    m : int
        In [1, 8] in two dimensions, in [1, 5] in three. The search ends within seconds for m <= 5 in two
        and m <= 4 in three dimensions; for larger m, request a distance and set a budget.
    dims : int, 2 or 3: in more dimensions there are no such nets with m > 1
    minimum_squared_distance : int
        Only nets of at least this distance, squared and in units of the grid, count. Larger values prune
        branches earlier.
    budget_s : float, optional
        Seconds after which the search stops and returns the best net so far. Unlimited by default.

    Returns
    -------
    NetSearch, always the same without a budget, or with a sufficient one

    Notes
    -----
    The search first requests the smallest distance that counts, and then bisects: far from the largest
    distance, branches end early or a net is found early. The maps that permute the axes and xor each
    coordinate with 0, 2**(m - 1) - 1, 2**(m - 1) or 2**m - 1 (shifts by half the torus, reflections) map nets
    to nets and preserve distances. So a cell without a point in any suitable net rules out all its images.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3: the search over permutations.

    Examples
    --------
    >>> best = search_net(3)
    >>> print(best.points[:, 1], best.squared_distance, best.exhausted)
    [0 5 2 7 4 1 6 3] 8 True
    """
    dims = checks.integer("dims", dims, 2, 3)
    m = checks.integer("m", m, 1, _LARGEST[dims])
    largest = dims * 4 ** (m - 1)
    wanted = checks.integer("minimum_squared_distance", minimum_squared_distance, 1, largest)
    if budget_s is not None:
        budget_s = _arguments.positive("budget_s", budget_s)
    budget = Budget(None, budget_s)
    points, squared_distance = None, None
    reached, impossible = wanted - 1, largest + 1
    while reached + 1 < impossible:
        try:
            found = _Search(m, dims, wanted, budget).net()
        except _OutOfTime:
            return NetSearch(points, squared_distance, exhausted=False)
        if found is None:
            impossible = wanted
        else:
            points, squared_distance = found, squared_min_distance(found, side=2**m)
            reached = squared_distance
        wanted = (reached + impossible) // 2
    return NetSearch(points, squared_distance, exhausted=True)


class _OutOfTime(Exception):
    pass


class _Search:
    """The search for one net of at least a given distance."""

    def __init__(self, m: int, dims: int, squared_distance: int, budget: Budget) -> None:
        self.m, self.dims, self.squared_distance, self.budget = m, dims, squared_distance, budget
        number = np.arange(2**m)
        apart = np.abs(number[:, None] - number)
        self.squares = np.minimum(apart, 2**m - apart) ** 2
        self.common_digits = m - np.frexp(number[:, None] ^ number)[1]
        self.kept: dict[int, int] = {}
        self.intervals = list(self._intervals())

    def net(self) -> NDArray[np.int64] | None:
        """Return the first net found, or None if there is none."""
        cells = self._extend((1 << 2 ** (self.m * self.dims)) - 1, self.intervals)
        if cells is None:
            return None
        return np.array(sorted(self._coordinates(cell) for cell in cells), np.int64)

    def _extend(self, candidates: int, intervals: list[int]) -> list[int] | None:
        """Return candidates, one in each of the intervals, no two of which exclude each other, or None."""
        if not intervals:
            return []
        if self.budget.spent() > 1:
            raise _OutOfTime
        options = min((interval & candidates for interval in intervals), key=int.bit_count)
        while options:
            cell = (options & -options).bit_length() - 1
            rest = [interval for interval in intervals if not interval >> cell & 1]
            cells = self._extend(candidates & self._keeps(cell), rest)
            if cells is not None:
                return [cell, *cells]
            # No remaining net has a point in this cell; at the start, none in its images either.
            candidates &= ~(self._images(cell) if intervals is self.intervals else 1 << cell)
            options &= candidates
        return None

    def _keeps(self, cell: int) -> int:
        """Return the cells that a point in this one does not exclude."""
        if cell not in self.kept:
            at = self._coordinates(cell)
            shared = reduce(np.add.outer, [self.common_digits[a] for a in at])
            squared = reduce(np.add.outer, [self.squares[a] for a in at])
            self.kept[cell] = _mask((shared < self.m) & (squared >= self.squared_distance))
        return self.kept[cell]

    def _intervals(self) -> Iterator[int]:
        """Yield the elementary intervals of volume 2**-m."""
        axes = np.indices((2**self.m,) * self.dims)
        for digits in product(range(self.m + 1), repeat=self.dims):
            if sum(digits) == self.m:
                corners = [axis >> (self.m - count) for axis, count in zip(axes, digits, strict=True)]
                for corner in product(*(range(2**count) for count in digits)):
                    inside = [axis == at for axis, at in zip(corners, corner, strict=True)]
                    yield _mask(np.logical_and.reduce(inside))

    def _images(self, cell: int) -> int:
        """Return the images of this cell under the symmetries."""
        half = 2 ** (self.m - 1)
        at, images = self._coordinates(cell), 0
        for order in permutations(at):
            for flips in product((0, half - 1, half, 2 * half - 1), repeat=self.dims):
                images |= 1 << reduce(lambda high, low: high << self.m | low, map(int.__xor__, order, flips))
        return images

    def _coordinates(self, cell: int) -> tuple[int, ...]:
        return tuple(cell >> (self.m * k) & 2**self.m - 1 for k in reversed(range(self.dims)))


def _mask(cells: NDArray[np.bool_]) -> int:
    return int.from_bytes(np.packbits(cells, bitorder="little").tobytes(), "little")

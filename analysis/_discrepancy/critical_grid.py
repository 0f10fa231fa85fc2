"""Local discrepancy on the critical grid, where the star discrepancy is attained.

The volume of a box anchored at the origin minus its share of the points grows with the box until a
point enters. Its supremum over open boxes is therefore the maximum over boxes that end, in each
dimension, at a coordinate of the points or at 1. The share minus the volume decreases until a point
enters: its supremum over closed boxes is the maximum over boxes that end at coordinates of points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis._host import Attained


class LocalDiscrepancy(float):
    """The local discrepancy of one box: a float with the box's ends; of several, ``max`` keeps the box."""

    ends: NDArray[np.float64]
    is_open: bool

    def __new__(cls, value: float, ends: NDArray[np.float64], is_open: bool) -> LocalDiscrepancy:
        self = super().__new__(cls, value)
        self.ends, self.is_open = ends, is_open
        return self


@dataclass(frozen=True)
class CriticalGrid:
    """Points by the ranks of their coordinates, and the relevant boxes.

    A corner is one integer t in [0, size] per dimension. Its box contains the points with ranks below t:
    it is open and ends at ``opened[j, t]``, or closed and ends at ``closed[j, t]``.
    """

    ranks: NDArray[np.signedinteger]  # (d, n): among the distinct values of a dimension
    opened: NDArray[np.float64]  # (d, n + 1): the distinct values, then 1
    closed: NDArray[np.float64]  # (d, n + 1): 0, then the distinct values
    sizes: NDArray[np.signedinteger]  # (d,): numbers of distinct values

    @property
    def n(self) -> int:
        return self.ranks.shape[1]

    @property
    def dims(self) -> int:
        return self.ranks.shape[0]


def critical_grid(points: NDArray[np.float64]) -> CriticalGrid:
    """Return the critical grid of points in [0, 1]^d."""
    n, dims = points.shape
    # Equal and small types make the comparisons fast; sums like lo + hi must be avoided.
    dtype = np.int16 if n < 2**15 else np.int32
    ranks, sizes = np.empty((dims, n), dtype), np.empty(dims, dtype)
    opened, closed = np.ones((dims, n + 1)), np.zeros((dims, n + 1))
    for j in range(dims):
        distinct, ranks[j] = np.unique(points[:, j], return_inverse=True)
        sizes[j] = len(distinct)
        opened[j, : sizes[j]] = distinct
        closed[j, 1 : sizes[j] + 1] = distinct
    return CriticalGrid(ranks, opened, closed, sizes)


def contains(grid: CriticalGrid, corners: NDArray[np.signedinteger]) -> NDArray[np.bool_]:
    """Return which points the boxes of corners, shape (m, d), contain: shape (m, n)."""
    inside = grid.ranks[0] < corners[:, 0, None]
    for j in range(1, grid.dims):
        inside &= grid.ranks[j] < corners[:, j, None]
    return inside


def local_discrepancy(grid: CriticalGrid, corners: NDArray[np.signedinteger]) -> NDArray[np.float64]:
    """Return the larger of the open and the closed box's local discrepancy, for corners (m, d)."""
    share = np.count_nonzero(contains(grid, corners), axis=1) / grid.n
    axis = np.arange(grid.dims)
    opened, closed = grid.opened[axis, corners], grid.closed[axis, corners]
    return np.maximum(opened.prod(axis=1) - share, share - closed.prod(axis=1))


def of_corner(grid: CriticalGrid, corner: NDArray[np.signedinteger], value: float) -> LocalDiscrepancy:
    """Return the local discrepancy of a corner, shape (d,), known before, with its box."""
    axis = np.arange(grid.dims)
    share = np.count_nonzero(contains(grid, corner[None])) / grid.n
    opened, closed = grid.opened[axis, corner], grid.closed[axis, corner]
    is_open = bool(opened.prod() - share >= share - closed.prod())
    return LocalDiscrepancy(value, opened if is_open else closed, is_open)


def attained_by_box(points: NDArray[np.float64], found: float) -> Attained:
    """Return a local discrepancy and its derivatives: of the volume, by the points where its box ends.

    It has none where the box ends at 1, nor without a box.
    """
    dims = points.shape[1]
    index, slopes = np.zeros(dims, np.int64), np.zeros((dims, dims))
    if isinstance(found, LocalDiscrepancy):
        for j, end in enumerate(found.ends):
            at = points[:, j] == end
            index[j] = at.argmax()
            slopes[j, j] = at.any() * np.delete(found.ends, j).prod() * (1 if found.is_open else -1)
    return float(found), index, slopes


def rounding(dims: int) -> float:
    """Return a bound on the rounding error of a local discrepancy, and of the bounds on regions.

    With u = 2^-53: in a bound, the products are at most 2 d u off in total, since the volumes of slabs
    add up to at most 1; the shares, which do so as well, 2 u; the differences of both 2 u; the sum of
    d + 2 terms, with partial sums of at most 2, 2 (d + 1) u. This is less than (4 d + 8) u.
    """
    return (dims + 2) * 2.0**-51

"""Threshold accepting: random walks on the critical grid to boxes of large local discrepancy."""

import numpy as np
from numpy.typing import NDArray

from analysis._star.critical_grid import CriticalGrid, LocalDiscrepancy, local_discrepancy
from analysis._star.regions import climb

_CHAINS = 64
_THRESHOLDS = 32
"""Each is used for as many moves as there are thresholds."""

_CLIMBERS = 16
"""Chains whose best boxes are improved in the end."""


def threshold_accepting(grid: CriticalGrid, generator: np.random.Generator) -> LocalDiscrepancy:
    """Return a large local discrepancy: a lower bound of the star discrepancy, to ``rounding(grid.dims)``.

    Chains move from box to box and accept a loss up to a threshold that decreases to zero [1]_. As there,
    the thresholds are differences between random neighbours, in descending order, the steps shrink from
    half of the grid to single coordinates, and large coordinates are preferred, since large local
    discrepancies are at large boxes. Unlike there, a step moves one coordinate, open and closed
    boxes share the chains, and the best boxes are improved in the end until no change of one coordinate
    helps, which includes the effect of snapping.

    References
    ----------
    .. [1] M. Gnewuch, M. Wahlstroem, C. Winzen, "A new randomized algorithm to approximate the star
       discrepancy based on threshold accepting", SIAM J. Numer. Anal. 50, 2012.
    """
    size = np.broadcast_to(grid.sizes, (_CHAINS, grid.dims))
    thresholds = np.empty((_THRESHOLDS, _CHAINS))
    for i in range(_THRESHOLDS):
        corners = _draw(grid, generator, np.zeros_like(size), size)
        moved = _neighbours(grid, generator, corners, i / _THRESHOLDS)
        thresholds[i] = np.abs(local_discrepancy(grid, moved) - local_discrepancy(grid, corners))
    thresholds = np.sort(thresholds, axis=0)[::-1]

    corners = _draw(grid, generator, np.zeros_like(size), size)
    values = local_discrepancy(grid, corners)
    best, best_values = corners.copy(), values.copy()
    for i in range(_THRESHOLDS**2):
        moved = _neighbours(grid, generator, corners, i / _THRESHOLDS**2)
        new = local_discrepancy(grid, moved)
        accepted = new >= values - thresholds[i // _THRESHOLDS]
        corners, values = np.where(accepted[:, None], moved, corners), np.where(accepted, new, values)
        better = values > best_values
        best[better], best_values[better] = corners[better], values[better]
    return climb(grid, best[np.argsort(-best_values)[:_CLIMBERS]])


def _neighbours(
    grid: CriticalGrid, generator: np.random.Generator, corners: NDArray[np.signedinteger], time: float
) -> NDArray[np.signedinteger]:
    """Move one coordinate of each corner, by less the closer ``time`` in [0, 1) is to 1."""
    reach = (1 + (grid.sizes // 2) * (1 - time)).astype(corners.dtype)
    low, high = np.maximum(corners, reach) - reach, np.minimum(corners, grid.sizes - reach) + reach
    moving = np.arange(grid.dims) == generator.integers(grid.dims, size=(len(corners), 1))
    return np.where(moving, _draw(grid, generator, low, high), corners)


def _draw(
    grid: CriticalGrid,
    generator: np.random.Generator,
    low: NDArray[np.signedinteger],
    high: NDArray[np.signedinteger],
) -> NDArray[np.signedinteger]:
    """Draw corners from l to h, with the density d y^(d-1) in each fraction y = t / size of the grid."""
    ratio = (low / np.maximum(high, 1)) ** grid.dims
    drawn = high * (ratio + (1 - ratio) * generator.random(low.shape)) ** (1 / grid.dims)
    return np.clip(np.ceil(drawn), low, high).astype(low.dtype)

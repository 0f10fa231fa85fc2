"""The star discrepancy in space by tiles of the critical grid."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis._discrepancy.critical_grid import LocalDiscrepancy

_MARGIN = 2.0**-19
"""More than the rounding errors of a bound: 32 roundings to float32 of numbers of at most 1."""

_BOXES = 2**33
"""Maximum number of boxes that are evaluated."""

Doubles = NDArray[np.float64]
Singles = NDArray[np.float32]


class _Tiling(NamedTuple):
    """Boxes of n points by ranks, in tiles of ``side`` ranks in each dimension, ``count`` of them.

    Ranks beyond the grid repeat its last ones; no point enters there.
    """

    n: int
    side: int
    opened: Doubles  # (3, count, side): where open boxes end
    closed: Doubles  # (3, count, side): and closed ones
    ranks: dict[tuple[int, int], NDArray[np.int64]]  # [j, k] (count, side): in j, of points in the order of k
    edges: NDArray[np.int64]  # (count + 1,): the ranks where tiles begin and end
    corners: NDArray[np.int32]  # (count + 1,) * 3: numbers of points below these


class _Bounds(NamedTuple):
    """Upper bounds of local discrepancies in float32, times n. The axes are z, x, y."""

    first: Singles  # (2, count, count, count): of the open and closed boxes in a tile's first layer
    tile: Singles  # (count, count, count): of all boxes in a tile


def space_star_discrepancy(points: Doubles, lower: float) -> tuple[float, float]:
    """Return a lower and an upper bound of the star discrepancy of points in space, given a lower one.

    They are equal unless very many boxes come close to the largest difference: then the search gives up.

    The (n + 1)^3 boxes of the grid, as in `plane_star_discrepancy`, are cut into tiles of about sqrt(n)
    ranks in each dimension. In a tile that begins at the ranks I, J and K, an open box has the local
    discrepancy

        x_i y_j z_k - C(i, j, k)/n  <=  x_i y_j z_K - C(i, j, K)/n  +  x y (z_k - z_K) - S_k/n,

    x and y the tile's largest coordinates and S_k the number of points of ranks K to k - 1 in z that are
    below I and J. The first difference, of the layer K, is bounded as in the plane: by the chord between the
    peaks of the first and the last row, less the points that enter. The contribution of another layer is a
    number. The same holds for closed boxes, with the tile's smallest coordinates, and all points that may
    enter. All tiles are bounded in O(n^2.5) steps and O(n^1.5) memory. Those with a bound above the largest
    value found are evaluated, the largest bound first, and in them the layers with such a bound.
    """
    n = len(points)
    tiling = _tiling(points)
    peak, bounds = _bounds(tiling)
    best = max(lower, peak / n - _MARGIN)
    upper = bounds.tile.ravel().astype(np.float64) / n + _MARGIN
    tiles = np.flatnonzero(upper > best)
    boxes = 0
    for tile in tiles[np.argsort(-upper[tiles], kind="stable")]:
        if upper[tile] <= best:
            break
        if boxes > _BOXES:
            return best, float(upper[tile])
        z, x, y = np.unravel_index(tile, bounds.tile.shape)
        found, layers = _evaluate(tiling, (int(x), int(y), int(z)), bounds.first[:, z, x, y] / n, best)
        best = max(best, found)
        boxes += layers * tiling.side**2
    return best, best


def _tiling(points: Doubles) -> _Tiling:
    n = len(points)
    side = max(8, math.isqrt(n))
    count = -(-(n + 1) // side)
    padding = count * side - n
    orders = [np.argsort(points[:, j], kind="stable") for j in range(3)]
    ranks = [np.argsort(order) for order in orders]
    opened, closed = np.ones((3, count * side)), np.zeros((3, count * side))
    for j, order in enumerate(orders):
        opened[j, :n] = closed[j, 1 : n + 1] = points[order, j]
        closed[j, n + 1 :] = closed[j, n]
    beyond = np.full(padding, count * side + 1)
    corners = np.zeros((count + 1,) * 3, np.int32)
    np.add.at(corners, tuple(rank // side + 1 for rank in ranks), 1)
    for j in range(3):
        corners = corners.cumsum(axis=j, dtype=np.int32)
    return _Tiling(
        n,
        side,
        opened.reshape(3, count, side),
        closed.reshape(3, count, side),
        {
            (j, k): np.append(ranks[j][orders[k]], beyond).reshape(count, side)
            for j in range(3)
            for k in range(3)
            if j != k
        },
        side * np.arange(count + 1),
        corners,
    )


def _bounds(tiling: _Tiling) -> tuple[float, _Bounds]:
    """Return n times the largest local discrepancy of tiles' first rows in first layers, and the bounds.

    The loops are over the ranks in a tile, and over all tiles of the same z at once: matrices fit the L1
    cache.
    """
    n, side, opened, closed, ranks, edges, corners = tiling
    tiles = (len(edges) - 1,) * 2
    below = edges[:-1]
    # For each y the columns that end there: points below x, z. For each x rows of y, z.
    in_x = _singles(ranks[0, 1].T[:, None, :] < below[:, None])
    in_y = _singles(ranks[1, 0].T[:, :, None] < edges)
    along_opened, along_closed = _along(opened[0]), _along(closed[0])
    x = n * np.stack([opened[0, :, 0], opened[0, :, -1], closed[0, :, 0], closed[0, :, -1]])[:, :, None]
    y = _singles(np.stack([opened[1].T, opened[1].T, closed[1].T, closed[1].T], axis=1)[:, :, None, :])
    largest = _singles(n * np.outer(opened[0, :, -1], opened[1, :, -1]))
    least = _singles(n * np.outer(closed[0, :, 0], closed[1, :, 0]))

    first = np.empty((2, *tiles[:1], *tiles), np.float32)
    whole = np.empty((*tiles[:1], *tiles), np.float32)
    peak = 0.0
    peaks, volumes = np.empty((2, 4, *tiles), np.float32)
    term, wide, wider = (
        np.empty((tiles[0] + i, tiles[1] + j), np.float32) for i, j in ((0, 0), (0, 1), (1, 1))
    )
    for layer, start in enumerate(below):
        ends_opened, ends_closed = opened[2, layer], closed[2, layer]

        # Peaks along y of volume less points in first and last rows: greatest if open, least if closed.
        scaled = _singles(x * np.repeat([ends_opened[0], ends_closed[0]], 2)[:, None, None])
        in_z = _singles(ranks[2, 1].T < start)[:, None, :]
        count = _singles(corners[:-1, :-1, layer])
        peaks[:2], peaks[2:] = -np.inf, np.inf
        for t in range(side):
            np.multiply(scaled, y[t], out=volumes)
            np.subtract(volumes, count, out=volumes)
            np.maximum(peaks[:2], volumes[:2], out=peaks[:2])
            np.minimum(peaks[2:], volumes[2:], out=peaks[2:])
            np.multiply(in_x[t], in_z[t], out=term)
            np.add(count, term, out=count)
        peak = max(peak, float(peaks[0].max()), -float(peaks[2].min()))

        # Chords between the rows, less or plus the points that entered.
        rise_opened, rise_closed = peaks[1] - peaks[0], peaks[2] - peaks[3]
        in_z = _singles(ranks[2, 0].T < start)[:, :, None]
        entered = np.zeros_like(wide)
        above = np.full((2, *tiles), -np.inf, np.float32)
        for t in range(side):
            np.multiply(rise_opened, along_opened[t], out=term)
            np.subtract(term, entered[:, :-1], out=term)
            np.maximum(above[0], term, out=above[0])
            np.multiply(rise_closed, along_closed[t], out=term)
            np.add(term, entered[:, 1:], out=term)
            np.maximum(above[1], term, out=above[1])
            np.multiply(in_y[t], in_z[t], out=wide)
            np.add(entered, wide, out=entered)
        np.add(above[0], peaks[0], out=first[0, layer])
        np.subtract(above[1], peaks[2], out=first[1, layer])

        # The contributions of the other layers.
        rows = _singles(ranks[0, 2][layer][:, None] < edges)[:, :, None]
        columns = _singles(ranks[1, 2][layer][:, None] < edges)[:, None, :]
        steps_opened, steps_closed = (
            _singles(ends_opened - ends_opened[0]),
            _singles(ends_closed - ends_closed[0]),
        )
        entered = np.zeros_like(wider)
        added = np.full((2, *tiles), -np.inf, np.float32)
        for t in range(side):
            np.multiply(largest, steps_opened[t], out=term)
            np.subtract(term, entered[:-1, :-1], out=term)
            np.maximum(added[0], term, out=added[0])
            np.multiply(least, steps_closed[t], out=term)
            np.subtract(entered[1:, 1:], term, out=term)
            np.maximum(added[1], term, out=added[1])
            np.multiply(rows[t], columns[t], out=wider)
            np.add(entered, wider, out=entered)
        whole[layer] = (first[:, layer] + added).max(axis=0)
    return peak, _Bounds(first, whole)


def _evaluate(
    tiling: _Tiling, tile: tuple[int, int, int], first: NDArray[np.floating], best: float
) -> tuple[float, int]:
    """Return the largest local discrepancy of a tile's layers that may exceed ``best``, and their number."""
    n, side, opened, closed, ranks, edges, corners = tiling
    x, y, z = tile
    rows, columns, layers = (edges[t] + np.arange(side + 1) for t in tile)
    in_rows, in_columns = ranks[0, 2][z][:, None] < rows, ranks[1, 2][z][:, None] < columns
    surely, perhaps = (_before(in_rows[:, k] & in_columns[:, k]) / n for k in (0, -1))
    ends_opened, ends_closed = opened[2, z], closed[2, z]
    bound_opened = first[0] + opened[0, x, -1] * opened[1, y, -1] * (ends_opened - ends_opened[0]) - surely
    bound_closed = first[1] - closed[0, x, 0] * closed[1, y, 0] * (ends_closed - ends_closed[0]) + perhaps
    chosen = np.flatnonzero(np.maximum(bound_opened, bound_closed) + _MARGIN > best)

    below = _before((ranks[0, 1][y] < rows[0]) & (ranks[2, 1][y] < layers[0]))
    entered = _before((ranks[1, 0][x][:, None] < columns[:-1]) & (ranks[2, 0][x] < layers[0])[:, None])
    count = corners[x, y, z] + below + entered
    in_rows, in_columns = _singles(in_rows[:, :-1]), _singles(in_columns[:, :-1])
    boxes = [
        ((ends[0, x], ends[1, y], ends[2, z]), np.outer(ends[0, x], ends[1, y]), sign)
        for ends, sign in ((opened, 1), (closed, -1))
    ]
    for k in chosen:
        share = (count + in_rows[:k].T @ in_columns[:k]) / n
        for (along_x, along_y, along_z), area, sign in boxes:
            values = sign * (area * along_z[k] - share)
            row, column = np.unravel_index(values.argmax(), values.shape)
            if values[row, column] > best:
                ends = np.array([along_x[row], along_y[column], along_z[k]])
                best = LocalDiscrepancy(values[row, column], ends, sign > 0)
    return best, len(chosen)


def _before(enters: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Count along the first axis what enters before each."""
    return enters.cumsum(axis=0) - enters


def _singles(array: NDArray) -> Singles:
    return np.ascontiguousarray(array, np.float32)


def _along(ends: Doubles) -> Singles:
    """Return the positions of ascending numbers between the first, 0, and the last, 1, of a tile."""
    low, high = ends[:, :1], ends[:, -1:]
    return _singles(((ends - low) / np.maximum(high - low, np.finfo(np.float64).tiny)).T[:, :, None])

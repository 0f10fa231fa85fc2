"""The closest pair of many points in two or three dimensions, by sorting.

Space is cut into bars along the first axis, of square cross-section. A pair closer than half a side of the
bars lies within one bar, possibly after the bars are shifted by half a side along some of the other axes.
Hence: sort by bar and first coordinate, compare each point with its followers while they are closer in the
first coordinate than the closest pair so far, and do so for all 2^(d - 1) tilings.

Bars as thin as the closest pair allows have few points in such a window, however the points are clustered
or aligned. A first bound on the closest pair comes from comparing each point with the next.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_SLACK = 1 + 2.0**-20
"""Bars are wider than needed by this factor: more than all rounding errors."""

_BLOCK = 2**14
"""Points that are compared with their followers at a time: fits the cache."""

_THINNEST = 2.0**-50
"""Relative to the extent of the set: the numbers of bars have fewer than 64 bits."""

_CROWDED = 256
"""Mean number of points in the windows from which on a tree is faster."""

Floats = NDArray[np.float64]


def squared_closest_pair(columns: Floats, bound: float) -> float | None:
    """Return the square of the smallest distance of two points, or None if the windows are crowded.

    ``columns``: float64 array, shape (d, n): at least two points, C-contiguous; they are sorted in place.
    ``bound``: positive upper bound of the smallest distance. Returns float or None: each square is a sum of d
    rounded squares of rounded differences.
    """
    low = columns.min(axis=1)
    extent = columns.max(axis=1) - low
    side, best = 2 * bound * _SLACK, (bound * _SLACK) ** 2
    unshifted, *shifted = itertools.product((0.0, 0.5), repeat=len(columns) - 1)
    while True:
        bars = _sort(columns, low, extent, side, unshifted)
        best = _compare_with_next(bars, best)
        if best == 0:
            return 0.0
        crowd = _crowd(bars, best)
        thinner = max(2 * math.sqrt(best) * _SLACK, extent.max() * _THINNEST)
        if crowd <= 8 or thinner > side / 2:
            break
        side = thinner
        del bars  # Frees the memory for the next tiling.
    if crowd > _CROWDED:
        return None
    best = _compare_with_windows(bars, best)
    del bars
    for shift in shifted:
        best = _compare_with_windows(_sort(columns, low, extent, side, shift), best)
    return best


class _Bars(NamedTuple):
    columns: Floats
    """The points, sorted by bar and first coordinate."""
    keys: NDArray[np.int64]
    """The number of the bar, then the first coordinate, relative to the smallest and times ``scale``."""
    scale: float

    def window(self, best: float) -> int:
        """Return the largest difference of keys in one bar for pairs that may be closer than the best."""
        return math.floor(math.sqrt(best) * self.scale * _SLACK) + 1


def _sort(columns: Floats, low: Floats, extent: Floats, side: float, shift: tuple[float, ...]) -> _Bars:
    """Sort points into bars, in place.

    The numbers of bars are hashed: where there are too many for the bits, distant ones share a number,
    which adds comparisons and misses none.
    """
    n = columns.shape[1]
    index_bits = (n - 1).bit_length()
    bar_bits = [(math.floor(length / side) + 1).bit_length() for length in extent[1:]]
    while sum(bar_bits) > max(index_bits - 2, 0):
        bar_bits[bar_bits.index(max(bar_bits))] -= 1
    position_bits = 63 - index_bits - sum(bar_bits)
    scale = (2.0**position_bits - 1) / max(extent[0], side) / _SLACK
    keys = np.zeros(n, np.int64)
    parts = [slice(start, start + _BLOCK) for start in range(0, n, _BLOCK)]
    for part in parts:
        key = keys[part]
        for k, bits in enumerate(bar_bits):
            key <<= bits
            bar = (columns[k + 1, part] - low[k + 1]) * (1 / side) + shift[k]
            key |= bar.astype(np.int64) & ((1 << bits) - 1)
        key <<= position_bits
        key |= ((columns[0, part] - low[0]) * scale).astype(np.int64)
        key <<= index_bits
        key |= np.arange(part.start, part.start + len(key))
    keys.sort()
    order, sorted_column = np.bitwise_and(keys, (1 << index_bits) - 1), np.empty(n)
    keys >>= index_bits
    for column in columns:
        # The indices are in range: saying so avoids a copy.
        np.copyto(column, np.take(column, order, out=sorted_column, mode="clip"))
    return _Bars(columns, keys, scale)


def _crowd(bars: _Bars, best: float) -> float:
    """Estimate the mean number of followers in the window."""
    keys = bars.keys
    sample = np.arange(0, len(keys), max(1, len(keys) // 4096))
    last = np.searchsorted(keys, keys[sample] + bars.window(best), side="right") - 1
    return float(np.mean(last - sample))


def _compare_with_next(bars: _Bars, best: float) -> float:
    n = len(bars.keys)
    room = _room()
    for start in range(0, n - 1, _BLOCK):
        best = min(best, _closest_followers(bars, start, min(start + _BLOCK, n - 1), 1, room))
    return best


def _compare_with_windows(bars: _Bars, best: float) -> float:
    """Compare points with the followers in their windows: all points first, then those with followers."""
    keys = bars.keys
    n = len(keys)
    room = _room()
    for start in range(0, n, _BLOCK):
        step, point = 1, np.arange(0)
        while (stop := min(start + _BLOCK, n - step)) > start:
            inside = keys[start + step : stop + step] - keys[start:stop] <= bars.window(best)
            if np.count_nonzero(inside) < (stop - start) // 4:
                point = start + np.flatnonzero(inside)
                break
            best = min(best, _closest_followers(bars, start, stop, step, room))
            step += 1
        while len(point):
            difference = bars.columns[:, point + step] - bars.columns[:, point]
            best = min(best, float(np.square(difference).sum(axis=0).min()))
            step += 1
            point = point[: np.searchsorted(point, n - step)]
            point = point[keys[point + step] - keys[point] <= bars.window(best)]
    return best


def _room() -> Floats:
    return np.empty((2, _BLOCK))


def _closest_followers(bars: _Bars, start: int, stop: int, step: int, room: Floats) -> float:
    """Return the smallest squared distance of the points to the one a given number of steps behind."""
    square, term = room[:, : stop - start]
    square.fill(0)
    for column in bars.columns:
        np.subtract(column[start + step : stop + step], column[start:stop], out=term)
        term *= term
        square += term
    return float(square.min())

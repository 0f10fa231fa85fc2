"""The closest pair of many points in two or three dimensions, by sorting.

Space is cut into bars along the first axis, with square cross-section. A pair closer than half a side of the
bars lies within one bar, possibly after shifting the bars by half a side along some of the other axes. Hence:
sort by bar and first coordinate, compare each point with its followers while they are closer in the first
coordinate than the closest pair so far, and do so for all 2^(d - 1) tilings.

If bars are as thin as the closest pair allows, such a window has few points, even if these are clustered or
aligned. Comparing each point with the next gives a first bound on the closest pair.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_SLACK = 1 + 2.0**-20
"""Bars are wider than needed by this factor: more than all rounding errors."""

_BLOCK = 2**14
"""Points compared with their followers at a time, to fit the cache."""

_THINNEST = 2.0**-50
"""Relative to the extent of the set: the numbers of bars have fewer than 64 bits."""

_CROWDED = 256
"""Mean number of points per window above which a tree is faster."""

Floats = NDArray[np.float64]


def closest_pair(columns: Floats, bound: float) -> tuple[float, Floats] | None:
    """Return the square of the smallest distance, and two points at it; None if the windows are crowded.

    ``columns``: shape (d, n), at least two points, C-contiguous; they are sorted in place. ``bound``: upper
    bound of the smallest distance, positive. The square is a sum of d rounded squares of rounded differences;
    the two points have shape (2, d).
    """
    low = columns.min(axis=1)
    extent = columns.max(axis=1) - low
    side = 2 * bound * _SLACK
    best = _Closest((bound * _SLACK) ** 2)
    unshifted, *shifted = itertools.product((0.0, 0.5), repeat=len(columns) - 1)
    while True:
        bars = _sort(columns, low, extent, side, unshifted)
        _compare_with_next(bars, best)
        if best.square == 0:
            return 0.0, best.pair
        crowd = _crowd(bars, best)
        thinner = max(2 * math.sqrt(best.square) * _SLACK, extent.max() * _THINNEST)
        if crowd <= 8 or thinner > side / 2:
            break
        side = thinner
        del bars  # Frees the memory for the next tiling.
    if crowd > _CROWDED:
        return None
    _compare_with_windows(bars, best)
    del bars
    for shift in shifted:
        _compare_with_windows(_sort(columns, low, extent, side, shift), best)
    return best.square, best.pair


@dataclass
class _Closest:
    """The closest pair so far."""

    square: float
    pair: Floats = field(default_factory=lambda: np.empty((2, 0)))

    def compare(self, squares: Floats, columns: Floats, first: NDArray[np.int64] | int, step: int) -> None:
        """Take the smallest of the squared distances of points to those ``step`` behind."""
        k = int(squares.argmin())
        if squares[k] < self.square:
            at = int(first[k]) if isinstance(first, np.ndarray) else first + k
            self.square, self.pair = float(squares[k]), columns[:, [at, at + step]].T


class _Bars(NamedTuple):
    columns: Floats
    """The points, sorted by bar and first coordinate."""
    keys: NDArray[np.int64]
    """The number of the bar, then the first coordinate, relative to the smallest and times ``scale``."""
    scale: float

    def window(self, best: _Closest) -> int:
        """Return the largest difference of keys in one bar for pairs that may be closer than the best."""
        return math.floor(math.sqrt(best.square) * self.scale * _SLACK) + 1


def _sort(columns: Floats, low: Floats, extent: Floats, side: float, shift: tuple[float, ...]) -> _Bars:
    """Sort points into bars, in place.

    The numbers of bars are hashed: if there are too many for the bits, distant bars share a number, which
    adds comparisons and misses none.
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


def _crowd(bars: _Bars, best: _Closest) -> float:
    """Estimate the mean number of followers in the window."""
    keys = bars.keys
    sample = np.arange(0, len(keys), max(1, len(keys) // 4096))
    last = np.searchsorted(keys, keys[sample] + bars.window(best), side="right") - 1
    return float(np.mean(last - sample))


def _compare_with_next(bars: _Bars, best: _Closest) -> None:
    n = len(bars.keys)
    room = np.empty((2, _BLOCK))
    for start in range(0, n - 1, _BLOCK):
        _compare_with_followers(bars, start, min(start + _BLOCK, n - 1), 1, room, best)


def _compare_with_windows(bars: _Bars, best: _Closest) -> None:
    """Compare points with the followers in their windows: all points first, then those with followers."""
    keys = bars.keys
    n = len(keys)
    room = np.empty((2, _BLOCK))
    for start in range(0, n, _BLOCK):
        step, point = 1, np.arange(0)
        while (stop := min(start + _BLOCK, n - step)) > start:
            inside = keys[start + step : stop + step] - keys[start:stop] <= bars.window(best)
            if np.count_nonzero(inside) < (stop - start) // 4:
                point = start + np.flatnonzero(inside)
                break
            _compare_with_followers(bars, start, stop, step, room, best)
            step += 1
        while len(point):
            difference = bars.columns[:, point + step] - bars.columns[:, point]
            best.compare(np.square(difference).sum(axis=0), bars.columns, point, step)
            step += 1
            point = point[: np.searchsorted(point, n - step)]
            point = point[keys[point + step] - keys[point] <= bars.window(best)]


def _compare_with_followers(
    bars: _Bars, start: int, stop: int, step: int, room: Floats, best: _Closest
) -> None:
    """Compare points with the ones a given number of steps behind."""
    square, term = room[:, : stop - start]
    square.fill(0)
    for column in bars.columns:
        np.subtract(column[start + step : stop + step], column[start:stop], out=term)
        term *= term
        square += term
    best.compare(square, bars.columns, start, step)

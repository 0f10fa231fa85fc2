"""Streams of coordinates of many samples, request by request, in tiles."""

from typing import Protocol

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges.mitsuba._padded_pairs import PaddedPairs

Words = NDArray[np.uint32]
SMALL, TILE = 2**10, 2**14
"""Tile sizes in samples: only two, since each one compiles programs."""

Row = memoryview
"""One coordinate of the samples of a tile: Python floats, which are faster to read than NumPy's."""

_NO_ROWS = 0, 0, memoryview(b""), memoryview(b"")

Place = tuple[int, int]
"""The index of a pair of coordinates, and which of both."""


class Samples(Protocol):
    """Consecutive samples of pixels."""

    @property
    def count(self) -> int: ...

    def where(self, numbers: Words) -> tuple[Words, Words, Words]:
        """Return column, row, and index in its pixel, of some of the samples."""
        ...


class Stream:
    """Samples of pixels, with requests for one coordinate after the other.

    A 2D request takes the next pair, a 1D request the first coordinate of the next pair or the one that the
    last 1D request left: pairs stay together, in which most samplers are best.
    """

    def __init__(self, pairs: PaddedPairs) -> None:
        self.pairs = pairs
        self.samples: Samples | None = None
        self._forget()

    def put(self, samples: Samples) -> None:
        """Start with the first coordinate of other samples."""
        self.samples = samples
        self._tile = SMALL if samples.count <= SMALL else TILE
        self._forget()

    def _forget(self) -> None:
        self._made: dict[int, tuple[int, NDArray[np.float32]]] = {}
        self._rows: dict[int, tuple[int, int, Row, Row]] = {}
        self._whole: tuple[int, NDArray[np.float32]] | None = None
        self.restart()

    def restart(self) -> None:
        """Start again with the first coordinate of the same samples."""
        self._next, self._left = 0, None

    def one(self) -> Place:
        """Consume one coordinate, and return its index."""
        if self._left is not None:
            place, self._left = (self._left, 1), None
            return place
        self._left = self.two()
        return self._left, 0

    def two(self) -> int:
        """Consume a pair of coordinates, and return its index."""
        self._next += 1
        return self._next - 1

    def of_sample(self, pair: int, number: int) -> tuple[float, float]:
        """Return both coordinates of one sample: its tile is computed once for all samples in it."""
        start, end, first, second = self._rows.get(pair, _NO_ROWS)
        if not start <= number < end:
            start, end, first, second = self._rows[pair] = self._row(pair, number)
        return first[number - start], second[number - start]

    def _row(self, pair: int, number: int) -> tuple[int, int, Row, Row]:
        count = self.placed().count
        if not 0 <= number < count:
            raise ValueError(f"sample must be one of {count}, got number {number}")
        first, _ = group = self.pairs.group(pair)
        tile = number // self._tile
        made, values = self._made.get(first, (-1, None))
        if made != tile or values is None:
            values = self._values(group, tile)
            self._made[first] = tile, values
        start, row = tile * self._tile, 2 * (pair - first)
        end = min(start + self._tile, count)
        return start, end, memoryview(values[row]), memoryview(values[row + 1])

    def of_all(self, pair: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return both coordinates of all samples; others computed with them are cached."""
        first, count = group = self.pairs.group(pair)
        if self._whole is None or self._whole[0] != first:
            samples = self.placed()
            values = np.empty((2 * count, samples.count), np.float32)
            for tile in range(-(-samples.count // self._tile)):
                start = tile * self._tile
                values[:, start : start + self._tile] = self._values(group, tile)[:, : samples.count - start]
            self._whole = first, values
        values = self._whole[1]
        row = 2 * (pair - first)
        return values[row], values[row + 1]

    def _values(self, group: tuple[int, int], tile: int) -> NDArray[np.float32]:
        # An incomplete last tile repeats the last sample: all tiles share one program.
        samples, start = self.placed(), tile * self._tile
        numbers = np.minimum(np.arange(start, start + self._tile), samples.count - 1).astype(np.uint32)
        x, y, sample = (jnp.asarray(part, jnp.uint32) for part in samples.where(numbers))
        return self.pairs.coordinates(group, x, y, sample)

    def placed(self) -> Samples:
        """Return the samples, or raise a ValueError."""
        if self.samples is None:
            raise ValueError(
                "seed or seek must set the pixels before coordinates are requested; the size of a wavefront "
                "must be a multiple of the number of pixels of the film"
            )
        return self.samples

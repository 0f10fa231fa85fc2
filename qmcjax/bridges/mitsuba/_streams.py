"""Streams of pairs of coordinates of many samples, request by request, in tiles."""

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges.mitsuba._padded_pairs import PaddedPairs
from qmcjax.bridges.mitsuba._pixels import Block

SMALL, TILE = 2**10, 2**14
"""Tile sizes in samples: only two, since each one compiles programs."""

Row = memoryview
"""One coordinate of the samples of a tile: Python floats, which are faster to read than NumPy's."""

_NO_ROWS = 0, 0, memoryview(b""), memoryview(b"")


class Stream:
    """Samples of pixels, with requests for one pair of coordinates after the other.

    Each request takes the next pair: pairs stay together, in which most samplers are best.
    """

    def __init__(self) -> None:
        self.samples: Block | None = None
        self.restart()

    def put(self, pairs: PaddedPairs, samples: Block) -> None:
        """Start with the first pair of other samples."""
        self.pairs, self.samples = pairs, samples
        self._tile = SMALL if samples.count <= SMALL else TILE
        self._made: dict[int, tuple[int, NDArray[np.float32]]] = {}
        self._rows: dict[int, tuple[int, int, Row, Row]] = {}
        self.restart()

    def restart(self) -> None:
        """Start again with the first pair of the same samples."""
        self._pair = 0

    def next(self, number: int) -> tuple[float, float]:
        """Consume a pair of coordinates, and return that of one sample: its tile is computed once."""
        if self.samples is None:
            raise ValueError("seed or seek must set the pixels before coordinates are requested")
        pair = self._pair
        self._pair += 1
        start, end, first, second = self._rows.get(pair, _NO_ROWS)
        if not start <= number < end:
            start, end, first, second = self._rows[pair] = self._row(pair, number, self.samples)
        return first[number - start], second[number - start]

    def _row(self, pair: int, number: int, samples: Block) -> tuple[int, int, Row, Row]:
        count = samples.count
        if not 0 <= number < count:
            raise ValueError(f"sample must be one of {count}, got number {number}")
        first, _ = group = self.pairs.group(pair)
        tile = number // self._tile
        made, values = self._made.get(first, (-1, None))
        if made != tile or values is None:
            values = self._values(group, tile, samples)
            self._made[first] = tile, values
        start, row = tile * self._tile, 2 * (pair - first)
        end = min(start + self._tile, count)
        return start, end, memoryview(values[row]), memoryview(values[row + 1])

    def _values(self, group: tuple[int, int], tile: int, samples: Block) -> NDArray[np.float32]:
        # An incomplete last tile repeats the last sample: all tiles share one program.
        start = tile * self._tile
        numbers = np.minimum(np.arange(start, start + self._tile), samples.count - 1).astype(np.uint32)
        x, y, sample = (jnp.asarray(part, jnp.uint32) for part in samples.where(numbers))
        return self.pairs.coordinates(group, x, y, sample)

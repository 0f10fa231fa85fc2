"""Samples of pixels for Mitsuba samplers, which receive only counts and a seed, request by request."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._padding import PaddedPairs

Words = NDArray[np.uint32]

BLOCK = 32
"""Side of the blocks of Mitsuba's scalar variants (``MI_BLOCK_SIZE``)."""


@dataclass(frozen=True)
class Window:
    """The sampled pixels: the crop of a film and, if the film samples it, the border around it."""

    width: int
    height: int
    left: int
    top: int

    def __len__(self) -> int:
        return self.width * self.height


@dataclass(frozen=True)
class Block:
    """Samples of the pixels of a square in a window, in Morton order; samples of a pixel are adjacent.

    A square may extend beyond an edge: the last column and row replace missing ones.
    """

    window: Window
    corner: tuple[int, int]
    side: int
    per_pixel: int
    first: int

    @property
    def count(self) -> int:
        return self.side**2 * self.per_pixel

    def where(self, numbers: Words) -> tuple[Words, Words, Words]:
        """Return column, row, and index in its pixel of the given samples."""
        pixel, sample = np.divmod(numbers, np.uint32(self.per_pixel))
        last = self.window.width - 1, self.window.height - 1
        x, y = (
            np.minimum(_even_bits(pixel >> np.uint32(axis)) + np.uint32(self.corner[axis]), np.uint32(end))
            for axis, end in enumerate(last)
        )
        return x + np.uint32(self.window.left), y + np.uint32(self.window.top), sample + np.uint32(self.first)


def block_side(window: Window, threads: int, chosen: int) -> int:
    """Return the side of an integrator's blocks: the given one, else 32, halved until all threads work."""
    if chosen:
        return chosen
    side = BLOCK
    while side > 1 and -(-window.width // side) * -(-window.height // side) < threads:
        side //= 2
    return side


@dataclass(frozen=True)
class Blocks:
    """The numbered blocks of a scalar variant: a pixel's seed is its number in all of them.

    In ``SamplingIntegrator::render_block`` the seed of pixel i of a block, in Morton order, is
    ``number * side**2 + i``, plus the seed of the whole rendering times the number of pixels. Blocks at the
    edges count in full: the numbers of one rendering overlap with those of the next, and a seed other than 0
    cannot always be detected. But such a rendering contains at least one number that is too large.
    """

    window: Window
    corners: NDArray[np.int64]
    """(blocks, 2): column and row of the first pixel in the window, by number."""
    side: int

    def locate(self, seed: int) -> tuple[int, int]:
        """Return the number of a block and the index of a pixel in it, or raise a ValueError."""
        number, pixel = divmod(seed, self.side**2)
        if number >= len(self.corners):
            raise ValueError(
                "seed must be 0 in scalar variants, samples_per_pass unset, and block_size the integrator's, "
                f"got pixel {pixel} of block {number} of {len(self.corners)}: use first_sample instead"
            )
        return number, pixel

    def block(self, number: int, per_pixel: int, first: int) -> Block:
        x, y = self.corners[number].tolist()
        return Block(self.window, (x, y), self.side, per_pixel, first)


def _even_bits(word: Words) -> Words:
    """Move bit 2 k to bit k."""
    word = word & np.uint32(0x55555555)
    for shift, mask in ((1, 0x33333333), (2, 0x0F0F0F0F), (4, 0x00FF00FF), (8, 0x0000FFFF)):
        word = (word | (word >> np.uint32(shift))) & np.uint32(mask)
    return word


SMALL, TILE = 2**10, 2**14
"""Tile sizes in samples: only two, since each one compiles programs."""

Row = memoryview
"""One coordinate of the samples of a tile: Python floats, which are faster to read than NumPy's."""

_NO_ROWS = 0, 0, memoryview(b""), memoryview(b"")


class Stream:
    """Samples of pixels, with requests for one pair of coordinates after another.

    Each request consumes the next pair: this keeps pairs together, in which most samplers are best.
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
        """Consume a pair of coordinates, and return it for one sample; its tile is computed once."""
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

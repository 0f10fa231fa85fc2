"""The plugin for scalar variants: one sample after another, by compiled functions or by JAX."""

import copy
from functools import lru_cache, partial
from types import ModuleType
from typing import Any

import numpy as np

from qmcjax.bridges.mitsuba._given import LIMIT, Given, describe
from qmcjax.bridges.mitsuba._native_sampler import Numbers, register_native
from qmcjax.bridges.mitsuba._streams import Block, Blocks, Stream, Window, block_side
from qmcjax.core import checks


def scalar(mitsuba: ModuleType) -> type:
    """Return the class for scalar variants: one sample after another."""
    import drjit  # pyright: ignore[reportMissingImports]

    class ScalarSampler(mitsuba.Sampler):
        def __init__(self, properties: Any, given: Given | None = None) -> None:
            super().__init__(properties)
            self.given = given or Given(properties)
            self.stream = Stream()
            self.blocks, self.block = None, None
            self.number, self.end = 0, 0

        def fork(self) -> Any:
            """Return a sampler for one thread, without Python in images if there is a compiler."""
            if self.given.in_use() and register_native(mitsuba.variant()):
                made = self._native_copy()
                if made is not None:
                    return made
            return self._copy()

        def _native_copy(self) -> Any:
            count, first, window = self.sample_count(), self.given.first, self.given.window()
            numbers = self._numbers(first + count)
            return numbers.native(mitsuba, self._blocks(window), first, count)

        def _copy(self) -> Any:
            properties = mitsuba.Properties()
            properties["sample_count"] = self.sample_count()
            return ScalarSampler(properties, self.given)

        def clone(self) -> Any:
            other = self._copy()
            other.stream = copy.copy(self.stream)
            other.blocks, other.block = self.blocks, self.block
            other.number, other.end = self.number, self.end
            return other

        def seed(self, seed: int, wavefront_size: int = LIMIT) -> None:
            if self.blocks is None:
                self.blocks = self._blocks(self.given.window())
            number, pixel = self.blocks.locate(int(seed))
            count = self.sample_count()
            if (number, count) != self.block:
                self.given.check_film()
                self._put(self.blocks.block(number, count, self.given.first), self.given.first + count)
                self.block = number, count
            self.stream.restart()
            self.number, self.end = pixel * count, (pixel + 1) * count

        def seek(self, x: int, y: int, sample: int = 0) -> None:
            columns, rows = self.given.whole()
            x, y = checks.integer("x", x, 0, columns - 1), checks.integer("y", y, 0, rows - 1)
            sample = checks.integer("sample", sample, 0, LIMIT - 1)
            end = max(self.given.first + self.sample_count(), sample + 1)
            self._put(Block(Window(1, 1, x, y), (0, 0), 1, end - sample, sample), end)
            self.block, self.number, self.end = None, 0, end - sample

        def advance(self) -> None:
            self.number += 1
            self.stream.restart()

        def next_1d(self, active: bool = True) -> float:
            return self._next()[0]

        def next_2d(self, active: bool = True) -> Any:
            return mitsuba.Point2f(*self._next())

        def to_string(self) -> str:
            return describe(self)

        def _next(self) -> tuple[float, float]:
            if self.number >= self.end:
                raise ValueError(
                    f"sample_count must be the number of samples taken, got {self.sample_count()}"
                )
            return self.stream.next(self.number)

        def _put(self, samples: Block, end: int) -> None:
            self.stream.put(self._numbers(end).pairs, samples)

        def _numbers(self, end: int) -> Numbers:
            numbers = self.given.make_once(self.sample_count(), partial(Numbers, key=self.given.key))
            numbers.pairs.sampler.check(*self.given.whole(), end)
            return numbers

        def _blocks(self, window: Window) -> Blocks:
            # Dr.Jit renders in its threads and in the calling thread.
            side = block_side(window, drjit.thread_count() + 1, self.given.block_side)
            return blocks(mitsuba.Spiral, window, side)

    return ScalarSampler


@lru_cache(maxsize=8)
def blocks(spiral_of: Any, window: Window, side: int) -> Blocks:
    """Return the blocks of a window: ``spiral_of`` is the class of Mitsuba's spirals."""
    spiral = spiral_of([window.width, window.height], [0, 0], side, 1)
    corners = np.empty((spiral.block_count(), 2), np.int64)
    for _ in corners:
        corner, _, number = spiral.next_block()
        corners[number] = np.array(corner)
    return Blocks(window, corners, side)

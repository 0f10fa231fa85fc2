"""The plugin for scalar variants: one sample after another, from tables of nearby ones."""

from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax import orders
from qmcjax.bridges._padding import Padding
from qmcjax.bridges._plain import Tables
from qmcjax.bridges.mitsuba._given import LIMIT, Given, Window, plug_in
from qmcjax.core import checks, draws
from qmcjax.samplers import Sampler

BLOCK = 32
"""Side of the blocks of Mitsuba's scalar variants (``MI_BLOCK_SIZE``)."""

_TOGETHER = 8
"""Number of pairs beyond those of the sampler in a table."""

_KEPT = 2**17
"""Number of cached coordinates for each thread: two tables."""


class Points:
    """The pairs of a sampler, and those beyond; shared by copies of the plugin."""

    def __init__(
        self, sampler: Sampler, *, key: Any, origin: tuple[int, int, int], count: int, threads: int
    ) -> None:
        self.sampler, self.own = sampler, sampler.dims // 2
        words = draws.bits(key, (2,), jnp.uint32)

        def tables(group: int) -> Tables:
            points, pairs = sampler, self.own
            if group:
                points, pairs = Padding(words, jnp.uint32(self.own + _TOGETHER * (group - 1))), _TOGETHER
            return Tables(points, 2 * pairs, sampler.fits.limits, count, threads * _KEPT, origin=origin)

        self.tables = lru_cache(maxsize=None)(tables)

    def place(self, pair: int) -> tuple[int, int]:
        """Return the group of a pair, 0 for those of the sampler, and its number there."""
        if pair < self.own:
            return 0, pair
        group, number = divmod(pair - self.own, _TOGETHER)
        return group + 1, number


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

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """(side**2, 2): column and row in a block of its pixels."""
        positions: Any = np.arange(self.side**2, dtype=np.uint32)
        pixels = orders.morton(self.side, self.side).pixel(positions)
        return np.stack(pixels, axis=1).astype(np.int64)

    def pixel(self, seed: int) -> tuple[int, int]:
        """Return the column and row of a seed, or raise a ValueError."""
        number, place = divmod(seed, self.side**2)
        if number >= len(self.corners):
            raise ValueError(
                "seed must be 0 in scalar variants, samples_per_pass unset, and block_size the integrator's, "
                f"got pixel {place} of block {number} of {len(self.corners)}: use first_sample instead"
            )
        x, y = (self.corners[number] + self.places[place]).tolist()
        return x + self.window.left, y + self.window.top


def block_side(window: Window, threads: int, chosen: int) -> int:
    """Return the side of an integrator's blocks: the given one, else 32, halved until all threads work."""
    if chosen:
        return chosen
    side = BLOCK
    while side > 1 and -(-window.width // side) * -(-window.height // side) < threads:
        side //= 2
    return side


@lru_cache(maxsize=8)
def blocks(spiral_of: Any, window: Window, side: int) -> Blocks:
    """Return the blocks of a window: ``spiral_of`` is the class of Mitsuba's spirals."""
    spiral = spiral_of([window.width, window.height], [0, 0], side, 1)
    corners = np.empty((spiral.block_count(), 2), np.int64)
    for _ in corners:
        corner, _, number = spiral.next_block()
        corners[number] = np.array(corner)
    return Blocks(window, corners, side)


def scalar(mitsuba: ModuleType) -> type:
    """Return the class for scalar variants: one sample after another."""
    import drjit  # pyright: ignore[reportMissingImports]

    class ScalarSampler(plug_in(mitsuba)):
        given: Given

        def __init__(self, properties: Any, given: Given | None = None) -> None:
            super().__init__(properties, given)
            self.blocks: Blocks | None = None
            self.points: Points | None = None
            self.pixel, self.checked = (0, 0), 0
            self._start(0, 0)

        def seed(self, seed: int, wavefront_size: int = LIMIT) -> None:
            if self.blocks is None:
                window = self.given.window()
                side = block_side(window, self._threads(), self.given.block_side)
                self.blocks = blocks(mitsuba.Spiral, window, side)
            pixel = self.blocks.pixel(int(seed))
            self.given.check_film()
            self._put(pixel, self.given.first, self.given.first + self.sample_count())

        def seek(self, x: int, y: int, sample: int = 0) -> None:
            columns, rows = self.given.whole()
            pixel = checks.integer("x", x, 0, columns - 1), checks.integer("y", y, 0, rows - 1)
            sample = checks.integer("sample", sample, 0, LIMIT - 1)
            self._put(pixel, sample, max(self.given.first + self.sample_count(), sample + 1))

        def advance(self) -> None:
            self._start(self.sample + 1, self.end)

        def next_1d(self, active: bool = True) -> float:
            return self._next()[0]

        def next_2d(self, active: bool = True) -> Any:
            return mitsuba.Point2f(*self._next())

        def _threads(self) -> int:
            # Dr.Jit renders in its threads and in the calling thread.
            return drjit.thread_count() + 1

        def _start(self, sample: int, end: int) -> None:
            self.sample, self.end, self.pair = sample, end, 0
            self.known: dict[int, list[float]] = {}

        def _put(self, pixel: tuple[int, int], sample: int, end: int) -> None:
            if self.points is None or self.checked != end:
                origin = *self.given.window()[2:], self.given.first
                how = {"origin": origin, "count": self.sample_count(), "threads": self._threads()}
                self.points = self.given.make_once(
                    self.sample_count(), partial(Points, key=self.given.key, **how)
                )
                self.points.sampler.check(*self.given.whole(), end)
                self.checked = end
            self.pixel = pixel
            self._start(sample, end)

        def _next(self) -> tuple[float, float]:
            """Consume a pair of coordinates: this keeps pairs together, in which most samplers are best."""
            if self.points is None:
                raise ValueError("seed or seek must set the pixels before coordinates are requested")
            if self.sample >= self.end:
                raise ValueError(
                    f"sample_count must be the number of samples taken, got {self.sample_count()}"
                )
            group, number = self.points.place(self.pair)
            self.pair += 1
            if group not in self.known:
                self.known[group] = self.points.tables(group)(*self.pixel, self.sample)
            point = self.known[group]
            return point[2 * number], point[2 * number + 1]

    return ScalarSampler

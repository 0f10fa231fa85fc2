"""The sampler plugin: subclasses of Mitsuba's sampler, for the current variant."""

import copy
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges.mitsuba._padded_pairs import PaddedPairs
from qmcjax.bridges.mitsuba._pixels import Blocks, Chosen, Wavefront, Window, block_side
from qmcjax.bridges.mitsuba._streams import Stream
from qmcjax.core import checks

LIMIT = checks.INDEX_LIMIT - 1


class Given:
    """The properties of a plugin, shared by its copies."""

    def __init__(self, properties: Any) -> None:
        for name in ("sampler", "film"):
            if name not in properties:
                raise ValueError(f"{name} must be a parameter of the plugin, got none")
        sampler, self.film = properties["sampler"], properties["film"]
        if not hasattr(sampler, "held"):
            raise TypeError(
                f"sampler must be made by qmcjax.bridges.mitsuba.held, got {checks.shown(sampler)}"
            )
        if not hasattr(self.film, "crop_size"):
            raise TypeError(f"film must be the sensor's film, got {checks.shown(self.film)}")
        self.pairs = PaddedPairs(sampler.held, properties.get("key", 0))
        self.first = checks.integer("first_sample", properties.get("first_sample", 0), 0, LIMIT)
        self.count = checks.integer("sample_count", properties.get("sample_count", 4), 1, LIMIT)
        side = properties.get("block_size", 0)
        self.block_side = 0 if side == 0 else checks.power_of_two("block_size", side, checks.MAX_SIDE)

    def window(self) -> Window:
        """Return the current pixels of the film."""
        border = self._border
        width, height = (int(side) + 2 * border for side in self.film.crop_size())
        left, top = (int(start) for start in self.film.crop_offset())
        return Window(width, height, left, top)

    def whole(self) -> tuple[int, int]:
        """Return the columns and rows of the whole film with its border, the image size of the sampler."""
        width, height = (int(side) + 2 * self._border for side in self.film.size())
        return width, height

    def check(self, end: int) -> None:
        """Raise unless the sampler has enough pixels and samples for the film."""
        self.pairs.sampler.check(*self.whole(), end)

    @property
    def _border(self) -> int:
        return int(self.film.rfilter().border_size()) if self.film.sample_border() else 0


def scalar(mitsuba: ModuleType) -> type:
    """Return the class for scalar variants: one sample after the other."""
    import drjit  # pyright: ignore[reportMissingImports]

    class ScalarSampler(mitsuba.Sampler):
        def __init__(self, properties: Any, given: Given | None = None) -> None:
            super().__init__(properties)
            self.given = given or Given(properties)
            self.stream = Stream(self.given.pairs)
            self.blocks, self.block = None, None
            self.number, self.end = 0, 0

        def fork(self) -> Any:
            return ScalarSampler(_properties(mitsuba, self), self.given)

        def clone(self) -> Any:
            other = self.fork()
            other.stream = copy.copy(self.stream)
            other.blocks, other.block = self.blocks, self.block
            other.number, other.end = self.number, self.end
            return other

        def seed(self, seed: int, wavefront_size: int = LIMIT) -> None:
            if self.blocks is None:
                self.blocks = self._layout()
            number, pixel = self.blocks.found(int(seed))
            count = self.sample_count()
            if (number, count) != self.block:
                self.given.check(self.given.first + count)
                self.stream.put(self.blocks.block(number, count, self.given.first))
                self.block = number, count
            self.stream.restart()
            self.number, self.end = pixel * count, (pixel + 1) * count

        def seek(self, x: int, y: int, sample: int = 0) -> None:
            columns, rows = self.given.whole()
            x, y = checks.integer("x", x, 0, columns - 1), checks.integer("y", y, 0, rows - 1)
            sample = checks.integer("sample", sample, 0, LIMIT - 1)
            end = max(self.given.first + self.sample_count(), sample + 1)
            self.given.check(end)
            self.stream.put(Wavefront(Window(1, 1, x, y), end - sample, sample))
            self.block, self.number, self.end = None, 0, end - sample

        def advance(self) -> None:
            self.number += 1
            self.stream.restart()

        def next_1d(self, active: bool = True) -> float:
            pair, side = self.stream.one()
            return self._both(pair)[side]

        def next_2d(self, active: bool = True) -> Any:
            return mitsuba.Point2f(*self._both(self.stream.two()))

        def _both(self, pair: int) -> tuple[float, float]:
            if self.number >= self.end:
                raise ValueError(
                    f"sample_count must be the number of samples taken, got {self.sample_count()}"
                )
            return self.stream.of_sample(pair, self.number)

        def _layout(self) -> Blocks:
            window = self.given.window()
            # Dr.Jit renders in its threads and in the calling one.
            side = block_side(window, drjit.thread_count() + 1, self.given.block_side)
            spiral = mitsuba.Spiral([window.width, window.height], [0, 0], side, 1)
            corners = np.empty((spiral.block_count(), 2), np.int64)
            for _ in corners:
                corner, _, number = spiral.next_block()
                corners[number] = np.array(corner)
            return Blocks(window, corners, side)

    return ScalarSampler


def vectorized(mitsuba: ModuleType) -> type:
    """Return the class for variants that trace wavefronts of rays: all samples at once."""
    import drjit  # pyright: ignore[reportMissingImports]

    class VectorizedSampler(mitsuba.Sampler):
        def __init__(self, properties: Any, given: Given | None = None) -> None:
            super().__init__(properties)
            self.given = given or Given(properties)
            self.stream = Stream(self.given.pairs)
            self.samples: Wavefront | Chosen | None = None
            self.checked = False

        def fork(self) -> Any:
            return VectorizedSampler(_properties(mitsuba, self), self.given)

        def clone(self) -> Any:
            other = self.fork()
            other.stream = copy.copy(self.stream)
            other.samples, other.checked = self.samples, self.checked
            return other

        def seed(self, seed: Any, wavefront_size: int = LIMIT) -> None:
            super().seed(seed, wavefront_size)
            window = self.given.window()
            per_pixel, rest = divmod(wavefront_size, len(window))
            if rest or not per_pixel:
                # After an image Mitsuba seeds samplers for one sample, to free memory: this is an error only
                # if coordinates are requested.
                self.stream, self.samples = Stream(self.given.pairs), None
                return
            number = int(np.ravel(np.array(seed))[0])
            self._put(Wavefront(window, per_pixel, self.given.first + number * self.sample_count()))

        def seek(self, x: Any, y: Any, sample: Any = 0) -> None:
            named = zip(("x", "y", "sample"), (x, y, sample), (*self.given.whole(), LIMIT), strict=True)
            words = [
                np.ravel(np.asarray(checks.unsigned(name, np.asarray(value), limit)))
                for name, value, limit in named
            ]
            x, y, sample = np.broadcast_arrays(*words)
            self._put(Chosen(x, y, sample))

        def advance(self) -> None:
            if self.samples is not None:
                self._put(self.samples.following())

        def next_1d(self, active: Any = True) -> Any:
            pair, side = self.stream.one()
            return mitsuba.Float(self._both(pair)[side])

        def next_2d(self, active: Any = True) -> Any:
            return mitsuba.Point2f(*map(mitsuba.Float, self._both(self.stream.two())))

        def _both(self, pair: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
            if drjit.flag(drjit.JitFlag.SymbolicScope):
                raise RuntimeError(
                    "symbolic loops must be off, since they request coordinates only once: "
                    "drjit.set_flag(drjit.JitFlag.SymbolicLoops, False)"
                )
            if self.samples is not None and not self.checked:
                if self.samples.end > checks.INDEX_LIMIT:
                    raise ValueError(
                        "first_sample + (seed + 1) * sample_count must be at most 2**32, got "
                        f"{self.samples.end}; this also holds for seed_grad of mitsuba.render"
                    )
                self.given.check(self.samples.end)
                self.checked = True
            return self.stream.of_all(pair)

        def _put(self, samples: Wavefront | Chosen) -> None:
            # Checked when coordinates are requested: after its last pass Mitsuba advances once more.
            self.samples, self.checked = samples, False
            self.stream.put(samples)

    return VectorizedSampler


def _properties(mitsuba: ModuleType, sampler: Any) -> Any:
    """Return the properties of a copy of Mitsuba's base sampler."""
    properties = mitsuba.Properties()
    properties["sample_count"] = sampler.sample_count()
    return properties

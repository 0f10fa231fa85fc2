"""The plugin for LLVM and CUDA variants, which compile the program of a sampler into theirs."""

from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np

from qmcjax.bridges._source import Table
from qmcjax.bridges._source._read import SamplerPrograms
from qmcjax.bridges.mitsuba._evaluated import Arrays, Evaluated
from qmcjax.bridges.mitsuba._given import LIMIT, Given, plug_in
from qmcjax.core import checks, draws
from qmcjax.samplers import Sampler


class Recorded:
    """The pairs of a sampler, and those beyond, on arrays of a variant; shared by copies of the plugin."""

    def __init__(self, arrays: Arrays, key: Any, sampler: Sampler) -> None:
        self.sampler = sampler
        self.count = sampler.dims // 2
        pairs = [(2 * k, 2 * k + 1) for k in range(self.count)]
        programs = SamplerPrograms(sampler, np.asarray(draws.bits(key, (2,), jnp.uint32)), pairs)
        tables: dict[Table, Any] = {}
        self.prepare = Evaluated(arrays, programs.prepared.program(), tables)
        every = (*map(programs.own, range(self.count)), programs.padding())
        self._pairs = [Evaluated(arrays, program, tables) for program in every]
        # In memory, not a compiled constant: another key does not recompile.
        self.seeds = [arrays.drjit.opaque(arrays.uint, int(word)) for word in programs.seeds]
        self._switch, self._minimum = arrays.drjit.switch, arrays.drjit.minimum

    def pair(
        self, number: int | None, least: int, pair: Any, members: Sequence[Any], sample: Any
    ) -> Sequence[Any]:
        """Return the coordinates of a pair; its number is known while recording, or an array.

        ``least``: a lower bound of the numbers. ``members``: of the pixels. Dr.Jit removes what is not used:
        a coordinate, and arguments of calls.
        """
        lowest = min(least, self.count)
        choices = [self._pairs[k] for k in range(lowest, self.count + 1)]
        if number is not None or len(choices) == 1:
            return self._choose(choices[0], members, pair, sample)

        def calls(choice: Evaluated) -> Callable[..., tuple[Any, ...]]:
            return lambda pair, sample, given: tuple(self._choose(choice, given, pair, sample))

        index = self._minimum(pair, self.count) - lowest
        return self._switch(index, list(map(calls, choices)), pair, sample, list(members))

    def _choose(self, choice: Evaluated, members: Sequence[Any], pair: Any, sample: Any) -> list[Any]:
        padding = choice is self._pairs[self.count]
        return choice([*self.seeds, *members, *([pair] if padding else []), sample])


class Last:
    """The number of the pair that follows a request: as an array, and its lower bound.

    Not a tuple: Dr.Jit does not find the array, which is no state of loops. As it is kept, no other variable
    gets its index.
    """

    def __init__(self, pair: Any, least: int) -> None:
        self.pair, self.least = pair, least


def copy_arrays(*of: Any) -> list[Any]:
    """Return arrays of Dr.Jit as other objects."""
    return [type(array)(array) for array in of]


def vectorized(mitsuba: ModuleType) -> type:
    """Return the class of the plugin for the current variant."""
    import drjit  # pyright: ignore[reportMissingImports]

    arrays = Arrays(drjit, mitsuba.Float)
    word = arrays.uint

    class VectorizedSampler(plug_in(mitsuba)):
        given: Given

        # Dr.Jit finds the arrays among the attributes: in symbolic loops they are the state of the loop.
        def __init__(self, properties: Any, given: Given | None = None) -> None:
            super().__init__(properties, given)
            self.recorded: Recorded | None = None
            self.members, self.sample, self.pair = [], word(0), word(0)
            self.last, self.least = Last(None, 0), 0
            self.end, self.step = 0, 0
            self.seeded, self.checked = False, False

        def clone(self) -> Any:
            other = super().clone()
            # Loops change arrays of their state in place: copies need their own arrays.
            other.sample, other.pair, *other.members = copy_arrays(self.sample, self.pair, *self.members)
            return other

        def seed(self, seed: Any, wavefront_size: int = LIMIT) -> None:
            super().seed(seed, wavefront_size)
            window, count = self.given.window(), self.sample_count()
            per_pixel, rest = divmod(wavefront_size, window.width * window.height)
            if rest or not per_pixel or count % per_pixel:
                # After an image Mitsuba seeds samplers for one sample, to free memory: this is an error only
                # if coordinates are requested.
                self.recorded = None
                return
            start = self.given.first + int(np.ravel(np.array(seed))[0]) * count
            if self._recorded().sampler.fits.spp > LIMIT:
                start %= checks.INDEX_LIMIT
            pixel, sample = self._divide(drjit.arange(word, wavefront_size), per_pixel)
            row, column = self._divide(pixel, window.width)
            # In memory, not a compiled constant: another window or seed does not recompile.
            left, top, first = (
                drjit.opaque(word, each) for each in (window.left, window.top, start % checks.INDEX_LIMIT)
            )
            self._put(column + left, row + top, sample + first)
            self.end, self.step, self.seeded = start + per_pixel, per_pixel, True

        def seek(self, x: Any, y: Any, sample: Any = 0) -> None:
            named = zip(("x", "y", "sample"), (x, y, sample), (*self.given.whole(), LIMIT), strict=True)
            words = [
                np.ravel(np.asarray(checks.unsigned(name, np.asarray(value), limit)))
                for name, value, limit in named
            ]
            self._put(*(word(each) for each in np.broadcast_arrays(*words)))
            self.end, self.step, self.seeded = int(words[2].max()) + 1, 1, False

        def advance(self) -> None:
            self.sample, self.pair, self.least = self.sample + self.step, word(0), 0
            # Checked when coordinates are requested: after its last pass Mitsuba advances once more.
            self.end, self.checked = self.end + self.step, False

        def schedule_state(self) -> None:
            drjit.schedule(self.members, self.sample, self.pair)

        def next_1d(self, active: Any = True) -> Any:
            return mitsuba.Float(self._next()[0])

        def next_2d(self, active: Any = True) -> Any:
            return mitsuba.Point2f(*self._next())

        def _next(self) -> Sequence[Any]:
            recorded = self._checked()
            pair, number, least = self.pair, None, self.least
            if pair.state == drjit.VarState.Literal:
                number = least = int(pair[0])
                # In a branch other lanes do not take part: what follows may have lower numbers.
                if not drjit.flag(drjit.JitFlag.SymbolicScope):
                    self.least = number + 1
            elif self.last.pair is not None and self.last.pair.index == pair.index:
                # The same variable, not that of another round of a loop.
                least = self.last.least
            self.pair = pair + 1
            self.last = Last(copy_arrays(self.pair)[0], least + 1)
            return recorded.pair(number, least, pair, self.members, self.sample)

        def _recorded(self) -> Recorded:
            return self.given.make_once(self.sample_count(), partial(Recorded, arrays, self.given.key))

        def _put(self, x: Any, y: Any, sample: Any) -> None:
            self.recorded = self._recorded()
            self.members = copy_arrays(*self.recorded.prepare([*self.recorded.seeds, x, y]))
            self.sample, self.pair, self.least, self.checked = sample, word(0), 0, False

        def _checked(self) -> Recorded:
            if self.recorded is None:
                raise ValueError(
                    "film must be the sensor's film, and seed or seek must set the pixels before coordinates "
                    "are requested: the size of a wavefront must be the number of pixels of the film times "
                    "the samples per pixel, or times a divisor of them"
                )
            if not self.checked:
                if self.seeded:
                    self.given.check_film()
                self.recorded.sampler.check(*self.given.whole(), self.end)
                self.checked = True
            return self.recorded

        @staticmethod
        def _divide(number: Any, by: int) -> tuple[Any, Any]:
            quotient = number // by
            return quotient, number - quotient * by

    return VectorizedSampler

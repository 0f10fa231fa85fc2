"""The programs of a sampler's pairs of coordinates, and of those beyond."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._padding import padding_pair, padding_pixel
from qmcjax.bridges._source import Program
from qmcjax.bridges._source._nouns import Seeded
from qmcjax.bridges._source._prepared import Prepared
from qmcjax.bridges._source._program import scheduled
from qmcjax.samplers import Sampler

_WORD = jax.ShapeDtypeStruct((), np.uint32)


class Programs:
    """What a pixel prepares, and pairs (2 k, 2 k + 1) of its samples.

    Inputs of ``prepare``: ``seeds``, column, row. Its outputs are the members of the pixel. Inputs of
    ``own(k)``: seeds, members, sample; of ``padding``: seeds, members, number of the pair, sample.
    """

    seeds: NDArray[np.uint32]
    """The words that another key changes, the padding's last."""

    def __init__(self, sampler: Sampler, padding: NDArray[np.uint32]) -> None:
        self._seeded = seeded = Seeded.of(sampler)
        self.count = sampler.dims // 2
        self.seeds = np.concatenate([seeded.words(), padding])

        def prepare(seeds: Any, x: Any, y: Any) -> Any:
            own, words = seeds
            made = seeded.put(own)
            return [made.prepare(x, y, _dims(k)) for k in range(self.count)], padding_pixel(words, x, y)

        examples = seeded.seeds, jax.ShapeDtypeStruct((2,), np.uint32)
        self._prepared = Prepared(prepare, examples, _WORD, _WORD)
        self._own: dict[int, Program] = {}

    @property
    def prepare(self) -> Program:
        """The program of the members of a pixel."""
        return self._prepared.program()

    def own(self, pair: int) -> Program:
        """Return the program of one of the sampler's pairs."""
        if pair not in self._own:
            self._own[pair] = self._prepared.then(self._points(pair), _WORD)
        return self._own[pair]

    def _points(self, pair: int) -> Callable[..., Any]:
        def points(seeds: Any, state: Any, sample: Any) -> Any:
            return self._seeded.put(seeds[0]).points(state[0][pair], sample, _dims(pair), jnp.float32)

        return points

    @cached_property
    def padding(self) -> Program:
        """The program of the pairs beyond the sampler's."""

        def points(seeds: Any, state: Any, pair: Any, sample: Any) -> Any:
            return padding_pair(state[1], pair, sample)

        return self._prepared.then(points, _WORD, _WORD)


def first_of(program: Program) -> Program:
    """Return the program of the first output alone."""
    return scheduled(program.inputs, program.outputs[:1], [()])


def _dims(pair: int) -> tuple[int, int]:
    return 2 * pair, 2 * pair + 1

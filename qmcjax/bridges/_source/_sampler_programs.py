"""The programs of a sampler: what a pixel prepares, coordinates of its samples, and pairs beyond."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._padding import padding_pair, padding_pixel
from qmcjax.bridges._source._nouns import Seeded
from qmcjax.bridges._source._prepared import Prepared
from qmcjax.bridges._source._program import Program, scheduled
from qmcjax.samplers import Sampler

_WORD = jax.ShapeDtypeStruct((), np.uint32)


class SamplerPrograms:
    """The programs of groups of coordinates.

    Inputs of ``prepared``: ``seeds``, column, row, below ``limits``. Its members are those of the pixel.
    Inputs of ``own(k)``: seeds, members, sample; of ``padding``: seeds, members, number of the pair, sample.
    """

    seeds: NDArray[np.uint32]
    """The words that another key changes, the padding's last."""

    def __init__(
        self,
        sampler: Sampler,
        padding: NDArray[np.uint32],
        groups: Sequence[tuple[int, ...]],
        has_64: bool = True,
        limits: Sequence[int] = (),
    ) -> None:
        self._seeded = seeded = Seeded.of(sampler)
        self._groups, self._limits = groups, limits
        self.seeds = np.concatenate([seeded.words(), padding])

        def prepare(seeds: Any, x: Any, y: Any) -> Any:
            own, words = seeds
            made = seeded.put(own)
            return [made.prepare(x, y, dims) for dims in groups], padding_pixel(words, x, y)

        examples = seeded.seeds, jax.ShapeDtypeStruct((2,), np.uint32)
        self.prepared = Prepared(prepare, examples, _WORD, _WORD, has_64=has_64, below=limits[:2])

    def own(self, group: int) -> Program:
        """Return the program of one group of coordinates."""

        def points(seeds: Any, state: Any, sample: Any) -> Any:
            made = self._seeded.put(seeds[0])
            return made.points(state[0][group], sample, self._groups[group], jnp.float32)

        return self.prepared.then(points, _WORD, below=self._limits[2:])

    def padding(self) -> Program:
        """Return the program of the pairs beyond the sampler's."""

        def points(seeds: Any, state: Any, pair: Any, sample: Any) -> Any:
            return padding_pair(state[1], pair, sample)

        return self.prepared.then(points, _WORD, _WORD)


def first_of(program: Program) -> Program:
    """Return the program of the first output alone."""
    return scheduled(program.inputs, program.outputs[:1])

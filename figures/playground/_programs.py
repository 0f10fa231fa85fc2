"""Samplers as functions of a shader: one text for all keys, and for all counts that share it."""

from collections.abc import Callable, Sequence
from typing import Any

from figures.playground._blob import Blob, Place
from qmcjax.bridges import seeds, source
from qmcjax.samplers import Sampler

Maker = Callable[[int, int], Sampler]
"""From a number of samples and a key to a sampler."""

Known = list[tuple[Sampler, int, Place | None]]
"""Samplers that were translated, with the numbers of their texts and their tables."""


class Programs:
    """The programs of all samplers, whose texts and tables are kept once.

    A program is the number of its text, its tables, if it has any, and its seeds.
    """

    def __init__(self, side: int, blob: Blob) -> None:
        self.texts: list[str] = []
        self._side, self._blob = side, blob

    def add(self, make: Maker, counts: Sequence[int], keys: Sequence[int], most_dims: int) -> dict[str, Any]:
        """Return the programs of one method, by counts, then by keys: or in words why there is none."""
        found: dict[str, Any] = {"dims": 0, "programs": []}
        known: Known = []
        for count in counts:
            try:
                made = [self._made(make, count, key, max(counts)) for key in keys]
                found["dims"] = min(made[0].dims, most_dims)
                programs: Any = [self._program(each, found["dims"], known) for each in made]
            except Exception as error:  # The samplers of users raise what they like.
                programs = str(error) or type(error).__name__
            found["programs"].append(programs)
        return found

    def _made(self, make: Maker, count: int, key: int, most: int) -> Sampler:
        sampler = make(count, key)
        sampler.check(self._side, self._side, count)
        return sampler.up_to(min(most, sampler.limits[2]))

    def _program(self, sampler: Sampler, dims: int, known: Known) -> list[Any]:
        for other, text, tables in known:
            try:
                return [text, tables, seeds(other, sampler).tolist()]
            except ValueError:
                continue
        made = source(sampler, tuple(range(dims)), "glsl", "mine")
        if made not in self.texts:
            self.texts.append(str(made))
        tables = self._blob.planes(made.tables, 4) if made.tables.size else None
        known.append((sampler, self.texts.index(made), tables))
        return [*known[-1][1:], seeds(sampler, sampler).tolist()]

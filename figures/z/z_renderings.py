"""The samplers that the Z paper compares on rendered scenes; Heitz et al.'s own tables, if named."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from figures.making import heitz
from figures.making.schema import Found
from figures.shared.rendered import padded_samplers
from qmcjax import samplers, sequences
from qmcjax.core import checks
from qmcjax.core.pytrees import pytree

STAND_IN, PUBLISHED = "ranked keys", "Heitz et al."
"""Our own optimisation after theirs, and theirs."""


@pytree
@dataclass(frozen=True)
class Published(samplers.Sampler):
    """Sample s of a pixel is point s xor its ranking key, xor its scrambling key, of a table of points.

    Both keys are of a pixel and a dimension. Dimensions from 8 on have the scrambling keys of dimensions 0 to
    7 again; their ranking keys are those that follow in the table, which belong to neighbours, as in the
    published program.
    """

    sequence: Array
    """uint8 (65536,), as in the file; so are the others."""
    scrambling: Array
    ranking: Array
    translation: Array
    """uint32 (2,): offsets of x and y in the tile."""
    coordinates: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.coordinates

    @property
    def limits(self) -> tuple[int, int, int]:
        """No more samples than the table has."""
        return checks.INDEX_LIMIT, checks.INDEX_LIMIT, heitz.SEQUENCE

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise unless the table has this number of samples."""
        super().check(width, height, spp)
        checks.integer("spp", spp, 1, heitz.SEQUENCE)

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return where the keys of pixels begin."""
        column, row = ((axis + self.translation[k]) % np.uint32(heitz.TILE) for k, axis in enumerate((x, y)))
        return (column + row * np.uint32(heitz.TILE)) * np.uint32(heitz.OPTIMISED)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the middles of the 256 intervals that the published bytes stand for."""
        found = [self._byte(state, sample, dim) for dim in dims]
        return (jnp.stack(found, axis=-1).astype(dtype) + 0.5) / heitz.SEQUENCE

    def _byte(self, pixel: Array, sample: Array, dim: int) -> Array:
        rank = self.ranking[(pixel + np.uint32(dim)) % np.uint32(len(self.ranking))]
        index = sample ^ rank.astype(jnp.uint32)
        key = self.scrambling[pixel + np.uint32(dim % heitz.OPTIMISED)]
        return self.sequence[index * np.uint32(heitz.SEQUENCE) + np.uint32(dim)] ^ key


def published(tables: heitz.Tables, dims: int, key: int) -> Published:
    """Make the sampler of up to 256 dimensions; the key translates the tile."""
    dims = checks.integer("dims", dims, 1, heitz.SEQUENCE)
    translation = jax.random.bits(jax.random.key(key), (2,), jnp.uint32)
    sequence, scrambling, ranking = map(jnp.asarray, tables)
    return Published(sequence, scrambling, ranking, translation, dims)


@cache
def _tables() -> heitz.Tables | None:
    file = heitz.path()
    return None if file is None else heitz.read(file)


def names() -> tuple[str, ...]:
    """Return the names of our ranked keys and, if their file is named, of those of Heitz et al."""
    return (STAND_IN,) if _tables() is None else (STAND_IN, PUBLISHED)


def beside(dims: int, key: int) -> dict[str, samplers.Sampler]:
    """Return the sampler of the published tables, by its name, if their file is named."""
    tables = _tables()
    return {} if tables is None else {PUBLISHED: published(tables, dims, key)}


def judge_by(claim: Callable[[str], Found | Mapping[str, Found]]) -> Found | Mapping[str, Found]:
    """Return what a claim finds of ranked keys, and with published tables also of these, case by case."""
    found = {name: claim(name) for name in names()}
    if len(found) == 1:
        return found[STAND_IN]
    cases: dict[str, Found] = {}
    for name, of in found.items():
        if isinstance(of, Mapping):
            cases |= {f"{case}, {name}": held for case, held in of.items()}
        else:
            cases[name] = of
    return cases


def note() -> str:
    """Return where the published tables are from, if they are used."""
    file = heitz.path()
    if file is None:
        return ""
    return (
        f"{PUBLISHED}: the published tables of {file.name}, bytes for points and at most 256 samples of a "
        "pixel; the key of an image translates the tile of 128 x 128 pixels. "
    )


KEY, SPP = 5, 4

EFFECTS = {
    "sports": "motion blur",
    "defocus": "depth of field",
    "interior": "paths",
    "caustic": "bidirectional paths",
}
"""What the scenes of Fig. 10 and 11 are for."""


def constituents(needs: tuple[str, ...]) -> tuple[int, ...]:
    """Return the sizes of what belongs together: x and y, and all u and v; other coordinates are single."""
    sizes = []
    for name in needs:
        if name == "y" or name.endswith("_v"):
            sizes[-1] = 2
        else:
            sizes.append(1)
    return tuple(sizes)


def make_samplers(
    needs: tuple[str, ...], side: int, spp: int = SPP, key: int = KEY
) -> dict[str, samplers.Sampler]:
    """Return the samplers for a square image of a scene with these coordinates.

    They are the paper's four, with our ranked keys for those of Heitz et al., and these if they are there.
    """
    sizes, bits = constituents(needs), spp.bit_length() - 1
    made = {
        "(0,2)-sequence": padded_samplers.zero_two(sizes, key, key + 1, bits),
        "Sobol'": samplers.full_screen(sequences.sobol(len(needs)), side, side),
        "ranked keys": padded_samplers.ranked_in_orders(sizes, key, key + 1, bits),
        "Z": samplers.z(side, side, spp, key, constituents=sizes),
    }
    return made | beside(len(needs), key)

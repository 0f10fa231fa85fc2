"""Objects to translate, and their parameters: seeds."""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.plug_ins import parameters
from qmcjax.orders import Order, as_order
from qmcjax.samplers import Sampler, as_sampler
from qmcjax.scenes import as_scene
from qmcjax.sequences import Sequence, as_sequence

_SEEDS = frozenset(
    ("seed", "seeds", "key", "shift", "shifts", "offset", "offsets", "flips", "words", "tails", "translation")
) | {"frame", "dim"}
"""Names of attributes that a new key changes."""

MOST_SEEDS = 64
"""Largest number of words of such an attribute: larger ones become tables."""


def noun(name: str, value: Any) -> Sampler | Sequence | Order | Any:
    """Return an argument as a sampler, a sequence, an order, or a scene."""
    if getattr(value, "needs", None) is not None and callable(value):
        return as_scene(name, value)
    if isinstance(value, Sampler | Sequence | Order):
        return value
    if callable(getattr(value, "position", None)):
        return as_order(name, value)
    if not isinstance(value, type) and hasattr(value, "dims"):
        if callable(getattr(value, "prepare", None)) or len(parameters(value)) >= 4:
            return as_sampler(name, value)
        return as_sequence(name, value)
    raise TypeError(
        f"{name} must be a sampler, a sequence, an order or a scene, with the methods of its protocol, got "
        f"{checks.shown(value)}"
    )


@dataclass(frozen=True)
class Seeded:
    """An object whose seeds are words of one array; the rest of it is constant."""

    leaves: tuple[Any, ...]
    tree: Any
    places: tuple[int, ...]
    """The leaves that are seeds."""
    paths: tuple[str, ...]
    """Where they are."""

    @classmethod
    def of(cls, value: Any) -> "Seeded":
        """Return an object with its seeds found by their names."""
        paths, tree = jax.tree_util.tree_flatten_with_path(value)
        places = tuple(place for place, (path, leaf) in enumerate(paths) if _is_seed(path, leaf))
        named = tuple(jax.tree_util.keystr(paths[place][0]) for place in places)
        return cls(tuple(leaf for _, leaf in paths), tree, places, named)

    @property
    def seeds(self) -> tuple[Any, ...]:
        return tuple(self.leaves[place] for place in self.places)

    @property
    def constants(self) -> list[tuple[np.dtype, tuple[int, ...], bytes]]:
        """The dtypes, shapes and bits of the other leaves."""
        rest = (np.asarray(leaf) for place, leaf in enumerate(self.leaves) if place not in self.places)
        return [(leaf.dtype, leaf.shape, leaf.tobytes()) for leaf in rest]

    def words(self) -> np.ndarray:
        """Return all words of the seeds, those of keys included."""
        found = [np.ravel(jax.random.key_data(s) if _is_key(s) else np.asarray(s)) for s in self.seeds]
        return np.concatenate([*found, np.empty(0, np.uint32)]).astype(np.uint32)

    def named(self) -> list[tuple[str, int]]:
        """Return where each of the seeds is, and its number of words."""
        sizes = [np.size(jax.random.key_data(s)) if _is_key(s) else np.size(s) for s in self.seeds]
        return list(zip(self.paths, sizes, strict=True))

    def put(self, seeds: Any) -> Any:
        leaves = list(self.leaves)
        for place, seed in zip(self.places, seeds, strict=True):
            leaves[place] = seed
        return self.tree.unflatten(leaves)


def _is_key(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array) and jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _is_seed(path: Any, leaf: Any) -> bool:
    if _is_key(leaf):
        return True
    named = getattr(path[-1], "name", None) in _SEEDS if path else False
    return named and getattr(leaf, "dtype", None) == np.uint32 and np.size(leaf) <= MOST_SEEDS


def padding_words(known: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the seeds of pairs beyond those of the sampler, derived from the sampler's seeds."""
    return np.random.SeedSequence([2, *known.tolist()]).generate_state(2).astype(np.uint32)


def seed_words(value: Any, seeded: Seeded) -> NDArray[np.uint32]:
    """Return all words that functions of an object take as seeds."""
    words = seeded.words()
    return np.concatenate([words, padding_words(words)]) if isinstance(value, Sampler) else words


def seeds(sampler: Any, other: Any) -> NDArray[np.uint32]:
    """Return the seeds with which the source code of one object computes another.

    A shader generated with one key renders with any key: pass these words instead of its seeds.

    Parameters
    ----------
    sampler, other : Sampler, Sequence, Order or Scene, or object that implements the protocol
        ``sampler`` is that of the source code; ``other`` differs only in its seeds, as with another key.

    Returns
    -------
    uint32 array, shape (n,)
        The argument ``seeds`` of all functions of ``source(sampler)``.

    Raises
    ------
    TypeError
        If one is neither a sampler, a sequence, an order nor a scene.
    ValueError
        If ``other`` needs another program.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> made = [samplers.independent(sequences.sobol(2), key) for key in (1, 2)]
    >>> print(seeds(made[0], made[1]).shape)
    (6,)
    """
    one, value = noun("sampler", sampler), noun("other", other)
    known, seeded = Seeded.of(one), Seeded.of(value)
    same = known.tree == seeded.tree and known.places == seeded.places
    if not same or known.constants != seeded.constants:
        raise ValueError(f"other must differ from sampler in its seeds only, got {checks.shown(other)}")
    words = seed_words(value, seeded)
    if words.size != seed_words(one, known).size:
        raise ValueError(f"other must have as many seeds as sampler, got {checks.shown(other)}")
    return words

"""Samplers of many dimensions made of samplers of few, as renderers have them."""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax import samplers, sequences
from qmcjax.core.bits import hash_word, owen_hash, reverse
from qmcjax.core.pytrees import pytree


@pytree
@dataclass(frozen=True)
class Padded(samplers.Sampler):
    """The coordinates of samplers of two dimensions, one after the other."""

    parts: tuple[samplers.Sampler, ...]

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return 2 * len(self.parts)

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return what the parts prepare."""
        return tuple(part.prepare(x, y, (0, 1)) for part in self.parts)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the points of the parts, side by side."""
        values = [
            part.points(of_part, sample, (0, 1), dtype)
            for part, of_part in zip(self.parts, state, strict=True)
        ]
        return jnp.concatenate(values, axis=-1)[..., jnp.array(dims)]


@pytree
@dataclass(frozen=True)
class Shuffled(samplers.Sampler):
    """The samples of each pixel in a random order of its own, which keeps aligned blocks of 2**k together.

    Sample s becomes the scrambled s of B. Burley, "Practical Hash-based Owen Scrambling", 2020: the first
    2**k samples are an aligned block of as many of the sequence, any one.
    """

    sampler: samplers.Sampler
    seed: Array

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.sampler.dims

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the seeds of the pixels' orders, and what the sampler prepares."""
        return hash_word(hash_word(x ^ self.seed) + y), self.sampler.prepare(x, y, dims)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the sampler's points in the pixels' orders."""
        seed, prepared = state
        return self.sampler.points(prepared, reverse(owen_hash(reverse(sample), seed)), dims, dtype)


def zero_two(dims: int, key: int) -> Padded:
    """Make the (0,2)-sequence sampler of PBRT: pairs of dimensions, each scrambled and shuffled per pixel."""
    keys = jax.random.split(jax.random.key(key), -(-dims // 2))
    words = jax.random.bits(jax.random.key(key), (len(keys),), jnp.uint32)
    sobol = sequences.sobol(2)
    return Padded(
        tuple(
            Shuffled(samplers.independent(sobol, each, "xor"), word)
            for each, word in zip(keys, words, strict=True)
        )
    )


def ranked(dims: int, key: int) -> Padded:
    """Make a sampler of blue noise by keys for many dimensions: pairs, each with a translation of its own.

    It stands for that of Heitz et al., whose keys were arranged for eight dimensions together.
    """
    keys = jax.random.split(jax.random.key(key), -(-dims // 2))
    return Padded(tuple(samplers.ranked(2, each) for each in keys))

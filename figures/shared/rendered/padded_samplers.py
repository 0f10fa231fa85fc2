"""Samplers of many dimensions made of samplers of few, as renderers have them."""

from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax import samplers, sequences
from qmcjax.core.bits import hash_pair, owen_hash, reverse
from qmcjax.core.pytrees import pytree


@pytree
@dataclass(frozen=True)
class Padded(samplers.Sampler):
    """The first coordinates of some samplers, side by side."""

    parts: tuple[samplers.Sampler, ...]
    sizes: tuple[int, ...] = field(metadata={"static": True})
    """How many coordinates of each are used."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return sum(self.sizes)

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return what the parts prepare."""
        return tuple(
            part.prepare(x, y, tuple(range(size))) for part, size in zip(self.parts, self.sizes, strict=True)
        )

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the points of the parts, side by side."""
        values = [
            part.points(of_part, sample, tuple(range(size)), dtype)
            for part, of_part, size in zip(self.parts, state, self.sizes, strict=True)
        ]
        return jnp.concatenate(values, axis=-1)[..., jnp.array(dims)]


@pytree
@dataclass(frozen=True)
class Shuffled(samplers.Sampler):
    """Samples in a random order, which keeps aligned blocks of 2**k together.

    Sample s becomes the scrambled s of B. Burley, "Practical Hash-based Owen Scrambling", 2020: the first
    2**k samples are an aligned block of as many of the sequence, any one of those below 2**bits.
    """

    sampler: samplers.Sampler
    seed: Array
    bits: int = field(metadata={"static": True})
    """Logarithm of the number of samples that are permuted."""
    in_pixels: bool = field(metadata={"static": True})
    """Whether each pixel has its own order."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.sampler.dims

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the seeds of the orders, and what the sampler prepares."""
        seed = hash_pair(x ^ self.seed, y ^ ~self.seed) if self.in_pixels else self.seed
        return seed, self.sampler.prepare(x, y, dims)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the sampler's points in another order."""
        (seed, prepared), unused = state, np.uint32(32 - self.bits)
        shuffled = reverse(owen_hash(reverse(sample << unused), seed)) >> unused
        return self.sampler.points(prepared, shuffled, dims, dtype)


def pairs(dims: int) -> tuple[int, ...]:
    """Return the sizes of as many pairs as fit, and of what is left."""
    return (2,) * (dims // 2) + (1,) * (dims % 2)


def zero_two(sizes: tuple[int, ...], key: int, orders: int, bits: int = 32) -> Padded:
    """Make the (0,2)-sequence sampler of PBRT: constituents of one or two dimensions.

    Each is scrambled in each pixel by ``key``, and shuffled within 2**bits samples by the key ``orders``.
    """
    sobol = sequences.sobol(2)
    parts = (samplers.independent(sobol, each, "xor") for each in _keys(sizes, key))
    return Padded(_shuffled(parts, sizes, orders, bits, in_pixels=True), sizes)


def ranked(sizes: tuple[int, ...], key: int) -> Padded:
    """Make a sampler of blue noise by keys for many dimensions: each constituent has its own translation.

    It stands for that of Heitz et al., whose keys were arranged for eight dimensions together.
    """
    return Padded(tuple(samplers.ranked(2, each) for each in _keys(sizes, key)), sizes)


def ranked_in_orders(sizes: tuple[int, ...], key: int, orders: int, bits: int) -> Padded:
    """Make the same with 2**bits samples, each constituent in its own order.

    The arrangement in a tile is of sets of samples: an order that is the same everywhere leaves it.
    """
    parts = ranked(sizes, key).parts
    return Padded(_shuffled(parts, sizes, orders, bits, in_pixels=False), sizes)


def _keys(sizes: tuple[int, ...], key: int) -> Array:
    return jax.random.split(jax.random.key(key), len(sizes))


def _shuffled(parts: Any, sizes: tuple[int, ...], orders: int, bits: int, in_pixels: bool) -> Any:
    seeds = jax.random.bits(jax.random.key(orders), (len(sizes),), jnp.uint32)
    return tuple(Shuffled(part, seed, bits, in_pixels) for part, seed in zip(parts, seeds, strict=True))

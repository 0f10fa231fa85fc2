"""Scrambled Morton orders without tables: the permutation of a node is a hash of its digits."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import draws
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._hierarchy import ScrambledMorton, permutation_number

GOLDEN = np.uint32(0x9E3779B9)
"""The fractional part of the golden ratio, as a 32-bit fraction rounded down."""


@jax.jit
def with_random_words(first: Array, keys: Array) -> Array:
    """Return a word followed by one random word per key: uint32 (len(keys) + 1,)."""
    return jnp.concatenate([first[None], jax.vmap(lambda key: draws.bits(key, (), jnp.uint32))(keys)])


@frozen_pytree
class Hashed(ScrambledMorton):
    """The word of a node is a hash of its parent's word and its digit; the root has the seed.

    Every step down the tree is a bijection, so the word of each node takes all values over the seeds.
    """

    seed: Array
    """uint32 scalar."""

    @property
    def root(self) -> Array:
        return self.seed

    def family(self, keys: Array) -> "Hashed":
        return replace(self, seed=with_random_words(self.seed, keys))

    def member(self, number: int) -> "Hashed":
        return replace(self, seed=self.seed[number])

    def _permutation(self, node: Array) -> Array:
        return permutation_number(node)

    def _child(self, node: Array, digit: Array) -> Array:
        # Plus one: the hash maps 0 to 0.
        return hash_word(node + (digit + np.uint32(1)) * GOLDEN)


@frozen_pytree
class Multiplicative(ScrambledMorton):
    """The word of a node is its prefix of the Morton code; Eq. 8 of the Z paper hashes it."""

    dim: Array
    """uint32 scalar: the sampled dimension d."""

    @property
    def root(self) -> Array:
        return jnp.uint32(0)

    def family(self, keys: Array) -> "Multiplicative":
        return replace(self, dim=with_random_words(self.dim, keys))

    def member(self, number: int) -> "Multiplicative":
        return replace(self, dim=self.dim[number])

    def _permutation(self, node: Array) -> Array:
        return permutation_number((node ^ (np.uint32(0x55555555) * self.dim)) * GOLDEN)

    def _child(self, node: Array, digit: Array) -> Array:
        return (node << 2) | digit

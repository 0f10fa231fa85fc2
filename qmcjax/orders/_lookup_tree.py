"""Scrambled Morton orders by a self-similar tree: a grammar with a permutation for each letter."""

from dataclasses import replace
from functools import partial
from typing import Self

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import draws, number_theory
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._hierarchy import PERMUTATIONS, ScrambledMorton, scaled


@frozen_pytree
class LookupTree(ScrambledMorton):
    """The word of a node is a letter, 0 at the root (Z paper, Eq. 13 to 18)."""

    production: Array
    """uint16 (letters, 4): the letters of the children, by their digits in the Morton code."""
    permutations: Array
    """uint8 (letters,): the permutation of each letter, below 24."""

    @property
    def root(self) -> Array:
        return jnp.uint32(0)

    def family(self, keys: Array) -> Self:
        """Return orders with a common production and separate permutations as one object (Eq. 13 to 18)."""
        others = _permutations_of(keys, self.permutations.shape[0])
        return replace(self, permutations=jnp.concatenate([self.permutations[None], others]))

    def member(self, number: int) -> Self:
        return replace(self, permutations=self.permutations[number])

    def _permutation(self, node: Array) -> Array:
        return self.permutations.at[node].get(mode="promise_in_bounds").astype(jnp.uint32)

    def _child(self, node: Array, digit: Array) -> Array:
        return (
            self.production.ravel().at[(node << 2) | digit].get(mode="promise_in_bounds").astype(jnp.uint32)
        )


@frozen_pytree
class RandomTree(LookupTree):
    """The same with a random production; members of a family enter it at shifted letters.

    So two nodes with equal letters in one member have independent letters in another, as if each member had
    its own production.
    """

    shift: Array
    """uint32 scalar, below the number of letters."""

    def family(self, keys: Array) -> Self:
        shifts = _shifts_of(keys, self.permutations.shape[0])
        return replace(super().family(keys), shift=jnp.concatenate([self.shift[None], shifts]))

    def member(self, number: int) -> Self:
        return replace(super().member(number), shift=self.shift[number])

    def _child(self, node: Array, digit: Array) -> Array:
        return super()._child((node + self.shift) % np.uint32(self.production.shape[0]), digit)


@partial(jax.jit, static_argnums=1)
def _permutations_of(keys: Array, letters: int) -> Array:
    """Draw permutations by each key; compiled, since otherwise every call traces the generator anew."""
    return jax.vmap(lambda key: random_permutations(letters, key))(keys)


@partial(jax.jit, static_argnums=1)
def _shifts_of(keys: Array, letters: int) -> Array:
    """Draw a letter by each key."""
    words = jax.vmap(lambda key: draws.bits(jax.random.fold_in(key, 1), (), jnp.uint32))(keys)
    return scaled(words, letters)


def random_permutations(letters: int, key: Array) -> Array:
    """Draw one of the 24 permutations for each letter."""
    return scaled(draws.bits(key, (letters,), jnp.uint32), PERMUTATIONS).astype(jnp.uint8)


def random_production(letters: int, key: Array) -> Array:
    """Draw the letter of each child of each letter."""
    return scaled(draws.bits(key, (letters, 4), jnp.uint32), letters).astype(jnp.uint16)


def art_production() -> Array:
    """Return a production in which no two equal letters come close at any level.

    A letter is a pair of symbols, one for the row and one for the column (see
    :func:`qmcjax.core.number_theory.word_children`).
    """
    symbols = number_theory.word_children()
    count = len(symbols)
    # Axes: row symbol, column symbol, lower half, right half.
    pairs = symbols[:, None, :, None] * count + symbols[None, :, None, :]
    return jnp.asarray(pairs.reshape(count**2, 4).astype(np.uint16))

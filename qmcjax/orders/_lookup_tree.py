"""Scrambled Morton orders by a self-similar tree: a grammar whose letters carry permutations."""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.pytrees import pytree
from qmcjax.orders._hierarchy import PERMUTATIONS, ScrambledMorton, scaled

ART_CONTEXT = 20
"""Letters of the Thue-Morse word before its own that a symbol of a row or column remembers."""


@pytree
@dataclass(frozen=True)
class LookupTree(ScrambledMorton):
    """The word of a node is a letter, that of the root is 0 (Z paper, Eq. 13 to 18)."""

    production: Array
    """uint16 (letters, 4): the letters of the children, by their digits in the Morton code."""

    permutations: Array
    """uint8 (letters,): the permutation of each letter, below 24."""

    @property
    def root(self) -> Array:
        """Letter 0."""
        return jnp.uint32(0)

    def family(self, keys: Array) -> "LookupTree":
        """Return independent orders with one production as one object (Eq. 13 to 18)."""
        others = jax.vmap(lambda key: random_permutations(self.permutations.shape[0], key))(keys)
        return replace(self, permutations=jnp.concatenate([self.permutations[None], others]))

    def member(self, number: int) -> "LookupTree":
        """Return one order of a family."""
        return replace(self, permutations=self.permutations[number])

    def _permutation(self, node: Array) -> Array:
        return self.permutations.at[node].get(mode="promise_in_bounds").astype(jnp.uint32)

    def _child(self, node: Array, digit: Array) -> Array:
        return (
            self.production.ravel().at[(node << 2) | digit].get(mode="promise_in_bounds").astype(jnp.uint32)
        )


def random_permutations(letters: int, key: Array) -> Array:
    """Draw one of the 24 permutations for each letter."""
    return scaled(jax.random.bits(key, (letters,), jnp.uint32), PERMUTATIONS).astype(jnp.uint8)


def random_production(letters: int, key: Array) -> Array:
    """Draw the letter of each child of each letter."""
    return scaled(jax.random.bits(key, (letters, 4), jnp.uint32), letters).astype(jnp.uint16)


def art_factors() -> list[tuple[int, ...]]:
    """Return the 64 factors of 21 letters of the Thue-Morse word, in the order of their first occurrence."""
    word = [0]
    while len(word) < 2**10:
        word += [1 - letter for letter in word]
    length = ART_CONTEXT + 1
    return list(dict.fromkeys(tuple(word[i : i + length]) for i in range(len(word) - length + 1)))


def art_production() -> Array:
    """Return a production in which no two equal letters come close at any level.

    A letter is a pair of symbols, of its row and its column: factors u of the Thue-Morse word, which say the
    letter at that row with those before it. Its substitution m, 0 -> 01, 1 -> 10, writes the next level: the
    children of u are the factors m(u)[20:41] and m(u)[21:42] [1]_. The rows of a level are therefore
    successive factors of the word, equal ones of which are 24 or more places apart.

    References
    ----------
    .. [1] A. Ahmed, T. Niese, H. Huang, O. Deussen, "An Adaptive Point Sampler on a Regular Lattice", 2017:
       the idea of tiles named by factors. The rule is our own.
    """
    factors = art_factors()
    number = {factor: i for i, factor in enumerate(factors)}
    symbols = np.empty((len(factors), 2), np.uint32)
    for i, factor in enumerate(factors):
        image = [half for letter in factor for half in (letter, 1 - letter)]
        for half in range(2):
            start = ART_CONTEXT + half
            symbols[i, half] = number[tuple(image[start : start + ART_CONTEXT + 1])]
    count = len(factors)
    # Axes: row symbol, column symbol, lower half, right half.
    pairs = symbols[:, None, :, None] * count + symbols[None, :, None, :]
    return jnp.asarray(pairs.reshape(count**2, 4).astype(np.uint16))

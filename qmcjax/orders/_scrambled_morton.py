"""The variants of the scrambled Morton order, and Morton orders of pixels and frames."""

from dataclasses import replace
from functools import partial
from typing import Self

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, draws, number_theory
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import FrameOrder, animation_size
from qmcjax.orders._hierarchy import (
    GOLDEN,
    PERMUTATIONS,
    Hashed,
    Multiplicative,
    ScrambledMorton,
    permutation_number,
    permuted,
    scaled,
    unpermuted,
)


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
        """Return orders with one production and separate permutations as one object (Eq. 13 to 18)."""
        others = _permutations_of(keys, self.permutations.shape[0])
        return replace(self, permutations=jnp.concatenate([self.permutations[None], others]))

    def member(self, number: int | Array) -> Self:
        return replace(self, permutations=self.permutations[number])

    def _permutation(self, node: Array) -> Array:
        return self.permutations.at[node].get(mode="promise_in_bounds").astype(jnp.uint32)

    def _child(self, node: Array, digit: Array) -> Array:
        return (
            self.production.ravel().at[(node << 2) | digit].get(mode="promise_in_bounds").astype(jnp.uint32)
        )


@frozen_pytree
class RandomTree(LookupTree):
    """The same with a random production; members of a family start at shifted letters.

    So two nodes with equal letters in one member have independent letters in another, as if each member had
    its own production.
    """

    shift: Array
    """uint32 scalar, below the number of letters."""

    def family(self, keys: Array) -> Self:
        shifts = _shifts_of(keys, np.uint32(self.permutations.shape[0]))
        return replace(super().family(keys), shift=jnp.concatenate([self.shift[None], shifts]))

    def member(self, number: int | Array) -> Self:
        return replace(super().member(number), shift=self.shift[number])

    def _child(self, node: Array, digit: Array) -> Array:
        return super()._child((node + self.shift) % np.uint32(self.production.shape[0]), digit)


def _permutations_of(keys: Array, letters: int) -> Array:
    return _drawn_permutations(keys, max(letters, ALPHABET))[:, :letters]


# Compiled, since otherwise every call traces the generator again. Words of an alphabet begin with those of a
# smaller one: small alphabets share a program.
@partial(jax.jit, static_argnums=1)
def _drawn_permutations(keys: Array, letters: int) -> Array:
    words = jax.vmap(lambda key: draws.bits(key, (letters,), jnp.uint32))(keys)
    return scaled(words, PERMUTATIONS).astype(jnp.uint8)


@partial(jax.jit, static_argnums=2)
def _drawn_production(key: Array, letters: Array | int, count: int) -> Array:
    return scaled(draws.bits(key, (count, 4), jnp.uint32), letters).astype(jnp.uint16)


@jax.jit
def _shifts_of(keys: Array, letters: Array | int) -> Array:
    words = jax.vmap(lambda key: draws.bits(jax.random.fold_in(key, 1), (), jnp.uint32))(keys)
    return scaled(words, letters)


def art_production() -> Array:
    """Return a production that keeps equal letters far apart at every level.

    A letter is a pair of symbols, one for the row and one for the column (see
    :func:`qmcjax.core.number_theory.word_children`).
    """
    symbols = number_theory.word_children()
    count = len(symbols)
    # Axes: row symbol, column symbol, lower half, right half.
    pairs = symbols[:, None, :, None] * count + symbols[None, :, None, :]
    return jnp.asarray(pairs.reshape(count**2, 4).astype(np.uint16))


VARIANTS = ("hash", "multiplicative", "tree", "art")
"""Sources of permutations, see :func:`scrambled_morton`."""

ALPHABET = 4096
"""Letters of the tree in the Z paper, Sect. 4.2."""


def scrambled_morton(
    width: int, height: int, key: Array | int, variant: str = "hash", alphabet: int | None = None
) -> ScrambledMorton:
    """Make a hierarchically scrambled Morton order: the quadrants of each square are permuted at random.

    Every aligned square of ``2**k`` pixels per side keeps one contiguous aligned run of positions, as in the
    Morton order.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the curve fills the next square with a power of two as side
    key : jax.random.key, or int in [0, 2**32)
        A new key gives a new order without recompilation. For "multiplicative" an int is the paper's
        dimension d; a key draws one.
    variant : {"hash", "multiplicative", "tree", "art"}
        Source of the permutation at each node. "hash": a hash of the node and the key, with three products
        per level. "multiplicative": the paper's product with the golden ratio. "tree": the letter of the node
        in a random grammar. "art": the same for a grammar of 4096 letters with equal letters far apart.
    alphabet : int, optional
        For "tree" only: the number of letters, in [1, 65536], by default 4096.

    Notes
    -----
    Over the keys all 24 permutations of each node are equally likely. "multiplicative" lacks independence:
    over the nodes of a level all permutations are equally frequent, but the permutation of a node leaves only
    two choices for its sibling. It hashes prefixes as numbers, without leading zeros: on the path to pixel
    (0, 0) all permutations equal that of the root. The golden ratio is truncated to 32 bits, so dimension
    d + 3 repeats d with each aligned block of ``2 g`` nodes reversed, where g is the largest power of two
    that divides d. The numbering of the 24 permutations is ours: the paper gives none.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Sect. 3.2 (Eq. 5), 4.1 (Eq. 8), 4.2 and 4.4 (Eq. 13 to 18;
       Eq. 18 stands for alpha <- psi[alpha][z_j]), 5.7 (ART).

    Examples
    --------
    >>> order = scrambled_morton(4, 4, key=1)
    >>> print(sorted(int(order.position(x, y)) // 4 for x in (0, 1) for y in (2, 3)))
    [3, 3, 3, 3]
    """
    width, height = checks.image_size(width, height)
    checks.choice("variant", variant, VARIANTS)
    if alphabet is not None and variant != "tree":
        raise ValueError(f"alphabet must be given for variant='tree' only, got {alphabet!r}")
    random = checks.prng_key("key", key)
    if variant == "hash":
        return Hashed(width, height, draws.bits(random, (), jnp.uint32))
    if variant == "multiplicative":
        dim = jnp.uint32(key) if isinstance(key, int) else draws.bits(random, (), jnp.uint32)
        return Multiplicative(width, height, dim)
    of_production, of_permutations = draws.split(random)
    letters = checks.integer("alphabet", ALPHABET if alphabet is None else alphabet, 1, 2**16)
    permutations = _permutations_of(of_permutations[None], letters)[0]
    if variant == "art":
        return LookupTree(width, height, art_production(), permutations)
    production = _drawn_production(of_production, np.uint32(letters), max(letters, ALPHABET))[:letters]
    return RandomTree(width, height, production, permutations, jnp.uint32(0))


_IDENTITY = 0
"""The number of the identity permutation."""


@frozen_pytree
class Morton3(FrameOrder):
    """Quadrants and halves of the frames alternate, from the largest to the smallest, permuted at each node.

    The word of a node is a hash of its parent's word and its digit. Digits are those of pixels and frames,
    before their permutation.
    """

    seed: Array | None
    """uint32 scalar; None without permutations."""

    @property
    def _levels(self) -> list[tuple[str, int]]:
        """Kind and place of each digit, the first one first."""
        count = max(self.log_side, self.log_frames)
        places = range(count - 1, -1, -1)
        both = [(kind, place) for place in places for kind in ("quadrant", "half")]
        return [(k, place) for k, place in both if place < (self.log_side, self.log_frames)[k == "half"]]

    def _node(self, shape: tuple[int, ...]) -> Array | None:
        return None if self.seed is None else jnp.broadcast_to(self.seed, shape)

    def unchecked_position(self, x: Array, y: Array, t: Array) -> Array:
        node, position, one = self._node(x.shape), jnp.zeros_like(x), np.uint32(1)
        for kind, place in self._levels:
            if kind == "half":
                digit = (t >> place) & one
                position = (position << 1) | _halved(node, digit)
            else:
                digit = ((x >> place) & one) | (((y >> place) & one) << 1)
                position = (position << 2) | permuted(_number(node), digit)
            node = _child(node, digit)
        return position

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array, Array]:
        node, one, left = self._node(position.shape), np.uint32(1), 2 * self.log_side + self.log_frames
        x = y = t = jnp.zeros_like(position)
        for kind, place in self._levels:
            if kind == "half":
                left -= 1
                digit = _halved(node, (position >> left) & one)
                t = t | (digit << place)
            else:
                left -= 2
                digit = unpermuted(_number(node), (position >> left) & np.uint32(3))
                x, y = x | ((digit & one) << place), y | ((digit >> 1) << place)
            node = _child(node, digit)
        return x, y, t


def _number(node: Array | None) -> Array:
    return jnp.uint32(_IDENTITY) if node is None else permutation_number(node)


def _halved(node: Array | None, digit: Array) -> Array:
    """Exchange both halves, or not: its own inverse."""
    return digit if node is None else digit ^ (node >> 31)


def _child(node: Array | None, digit: Array) -> Array | None:
    # Plus one: the hash maps 0 to 0.
    return None if node is None else hash_word(node + (digit + np.uint32(1)) * GOLDEN)


def morton3(width: int, height: int, frames: int, key: Array | int | None = None) -> Morton3:
    """Make the Morton order of the pixels of an animation, plain or scrambled.

    The digits of the position are, in turn, a quadrant and a half of the frames, from the largest to the
    smallest. Every aligned block of ``2**k`` x ``2**k`` pixels in ``2**k`` or ``2**(k + 1)`` frames has a
    contiguous aligned run of positions.

    Parameters
    ----------
    width, height : int, in [1, 65536]; padded to a square with a power of two as side
    frames : int
        Padded to a power of two; there are at most 2**32 positions. If the number of frames exceeds the side,
        the first digits are halves only; if the side is larger, they are quadrants only.
    key : jax.random.key, or int in [0, 2**32), optional
        Permutes the quadrants and halves of each block at random, as :func:`scrambled_morton` does; all
        permutations are equally likely. A new key does not recompile. None gives the plain Morton order.

    Returns
    -------
    Morton3
        ``position(x, y, t)``, ``pixel(position)``, and ``at_frame(t)``, an order of pixels for samplers.

    Notes
    -----
    With ``contiguous(order, sequence, spp)`` only these blocks are nets, not those of other numbers of pixels
    and frames, and errors of a single frame are larger than in an order of pixels alone.
    :func:`qmcjax.sequences.in_time` stratifies all blocks, and does not change single frames.

    Examples
    --------
    >>> order = morton3(4, 4, 2)
    >>> print(order.position(1, 0, 1), [int(v) for v in order.pixel(3)])
    3 [1, 0, 1]
    """
    size = animation_size(width, height, frames)
    seed = None if key is None else draws.bits(checks.prng_key("key", key), (), jnp.uint32)
    return Morton3(*size, seed)

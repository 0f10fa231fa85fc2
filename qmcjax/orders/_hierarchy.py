"""Hierarchically scrambled Morton orders: a permutation of the four children at each node of the quadtree."""

import abc
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from qmcjax.core import checks, draws
from qmcjax.core.bits import gather, hash_word, high_product, spread, traced_once
from qmcjax.core.parameters import together
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import SquareOrder

PERMUTATIONS = 24
"""Number of permutations of the four children."""

_MATRICES = ((1, 2), (1, 3), (2, 1), (2, 3), (3, 1), (3, 2))
_INVERSES = ((1, 2), (1, 3), (2, 1), (3, 1), (2, 3), (3, 2))
"""The regular 2 x 2 matrices over F2 and their inverses: the images of 1 and 2."""


def _packed(matrices: tuple[tuple[int, int], ...]) -> np.uint32:
    return np.uint32(sum((one | two << 2) << (4 * i) for i, (one, two) in enumerate(matrices)))


_IMAGES, _INVERSE_IMAGES = _packed(_MATRICES), _packed(_INVERSES)


def _product(matrices: np.uint32, number: Array, digit: Array) -> Array:
    images = (matrices >> ((number >> 2) << 2)) & np.uint32(15)
    one, two = np.uint32(0) - (digit & np.uint32(1)), np.uint32(0) - (digit >> 1)
    return (images & one & np.uint32(3)) ^ ((images >> 2) & two)


@traced_once
def permuted(number: Array, digit: Array) -> Array:
    """Apply one of the 24 permutations of {0, 1, 2, 3}: they are the affine maps of the plane over F2.

    Digit z, the vector of its two bits, becomes M z + v. The number is v plus four times that of M.
    """
    return _product(_IMAGES, number, digit) ^ (number & np.uint32(3))


@traced_once
def unpermuted(number: Array, digit: Array) -> Array:
    """Invert :func:`permuted`."""
    return _product(_INVERSE_IMAGES, number, digit ^ (number & np.uint32(3)))


def scaled(word: Array, count: Array | int) -> Array:
    """Map uniform words to {0, ..., count - 1}, equally many to each, up to one."""
    return high_product(word, jnp.full_like(word, count))


@traced_once
def permutation_number(word: Array) -> Array:
    """Map uniform words to {0, ..., 23} by ``word * 24 >> 32``, without a 64-bit product.

    The relative error of the probabilities is at most 4e-9.
    """
    upper, lower = word >> 3, word & np.uint32(7)
    return (upper + (upper << 1) + ((lower + (lower << 1)) >> 3)) >> 26


STEP = 3
"""Levels of the quadtree between squares and what is inside them."""


@dataclass(frozen=True)
class ScrambledMorton(SquareOrder):
    """A Morton order with permuted base 4 digits; each permutation depends on the digits before it.

    These are the digits of the Morton code, before their permutation: a node of the quadtree is one square of
    pixels, at any place in the order (Z paper, Eq. 5). One word identifies a node.
    """

    @property
    @abc.abstractmethod
    def root(self) -> Array:
        """The word of the whole square: a uint32 scalar."""

    @abc.abstractmethod
    def _permutation(self, node: Array) -> Array:
        """Return the numbers of the permutations of the children of nodes, below 24."""

    @abc.abstractmethod
    def _child(self, node: Array, digit: Array) -> Array:
        """Return the words of children, by their digit in the Morton code."""

    @abc.abstractmethod
    def family(self, keys: Array) -> "ScrambledMorton":
        """Return independent orders of the same variant as one object, for :meth:`member`.

        Parameters
        ----------
        keys : jax.random.key Array, shape (n,)

        Returns
        -------
        ScrambledMorton
            n + 1 members: this order, and one for each key. Its arrays have an additional leading axis.
        """

    @abc.abstractmethod
    def member(self, number: int | Array) -> "ScrambledMorton":
        """Return one order of a :meth:`family`; member 0 is the original order."""

    def scrambled(self, code: Array | int, digits: int, node: Array | None = None) -> tuple[Array, Array]:
        """Permute the base 4 digits of Morton codes, from the first to the last.

        The digits may continue below the pixels: the node of a pixel, the second result for its code, is the
        root of the permutations of its sample numbers [1]_.

        Parameters
        ----------
        code : uint32 Array, shape (...), or int, below ``4**digits``
        digits : int, in [0, 16]
        node : uint32 Array, shape (...), optional
            Node above the first digit, by default ``root``.

        Returns
        -------
        position : uint32 Array, shape (...), below ``4**digits``
        node : uint32 Array, shape (...), node after the last digit

        References
        ----------
        .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
           Hierarchical Ordering of Pixels", 2020, Eq. 5 and 16.
        """
        digits = checks.integer("digits", digits, 0, 16)
        code = checks.unsigned("code", code, 4**digits)
        if node is not None:
            code, node = together(code=code, node=checks.unsigned("node", node))
        return self._scrambled(code, digits, node)

    def _scrambled(self, code: Array, digits: int, node: Array | None = None) -> tuple[Array, Array]:
        node = jnp.broadcast_to(self.root if node is None else node, code.shape)
        levels = range(digits - 1, -1, -1)
        return self.scrambled_digits([(code >> (2 * level)) & np.uint32(3) for level in levels], node)

    def squares(self, levels: int) -> tuple[Array, Array]:
        """Permute the digits of all aligned squares of ``2**levels`` pixels per side that cover the image.

        Returns
        -------
        position, node : uint32 Array, shape (rows, columns), as of :meth:`scrambled`
            For :meth:`inside`.
        """
        columns, rows = -(-self.width >> levels), -(-self.height >> levels)
        x, y = (lax.broadcasted_iota(jnp.uint32, (rows, columns), axis) for axis in (1, 0))
        digits = self.log_side - levels
        if digits <= STEP:
            return self._scrambled(spread(x) | (spread(y) << 1), digits)
        return self.inside(self.squares(levels + STEP), x, y)

    def inside(self, squares: tuple[Array, Array], x: Array, y: Array) -> tuple[Array, Array]:
        """Permute the digits of pixels, or squares, by those of squares of ``2**STEP`` of them per side.

        XLA does not fuse lookups with their operands: neighbours share the digits of their square.
        """
        columns = np.uint32(squares[0].shape[1])
        place = (y >> STEP) * columns + (x >> STEP)
        position, node = (words.ravel().at[place].get(mode="promise_in_bounds") for words in squares)
        code = spread(x) | (spread(y) << 1)
        lower, node = self._scrambled(code & np.uint32(4**STEP - 1), STEP, node)
        return (position << (2 * STEP)) | lower, node

    def scrambled_digits(self, digits: list[Array], node: Array) -> tuple[Array, Array]:
        """Permute digits below a node; each digit has the node's shape, or is a scalar for all nodes.

        Parameters
        ----------
        digits : list of uint32 Array, in base 4, the first one first
        node : uint32 Array, shape (...)

        Returns
        -------
        position, node : uint32 Array, shape (...), as of :meth:`scrambled`
        """
        position = jnp.zeros_like(node)
        for digit in digits:
            position = (position << 2) | permuted(self._permutation(node), digit)
            node = self._child(node, digit)
        return position, node

    def unchecked_position(self, x: Array, y: Array) -> Array:
        return self._scrambled(spread(x) | (spread(y) << 1), self.log_side)[0]

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        node = jnp.broadcast_to(self.root, position.shape)
        code = jnp.zeros_like(position)
        for level in range(self.log_side - 1, -1, -1):
            digit = unpermuted(self._permutation(node), (position >> (2 * level)) & np.uint32(3))
            code = (code << 2) | digit
            node = self._child(node, digit)
        return gather(code), gather(code >> 1)


GOLDEN = np.uint32(0x9E3779B9)
"""The fractional part of the golden ratio, as a 32-bit fraction rounded down."""


@jax.jit
def with_random_words(first: Array, keys: Array) -> Array:
    return jnp.concatenate([first[None], jax.vmap(lambda key: draws.bits(key, (), jnp.uint32))(keys)])


@frozen_pytree
class Hashed(ScrambledMorton):
    """The word of a node is a hash of its parent's word and its digit; that of the root is the seed.

    Every step down the tree is a bijection, so the word of each node takes all values over the seeds.
    """

    seed: Array
    """uint32 scalar."""

    @property
    def root(self) -> Array:
        return self.seed

    def family(self, keys: Array) -> "Hashed":
        return replace(self, seed=with_random_words(self.seed, keys))

    def member(self, number: int | Array) -> "Hashed":
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

    def member(self, number: int | Array) -> "Multiplicative":
        return replace(self, dim=self.dim[number])

    def _permutation(self, node: Array) -> Array:
        return permutation_number((node ^ (np.uint32(0x55555555) * self.dim)) * GOLDEN)

    def _child(self, node: Array, digit: Array) -> Array:
        return (node << 2) | digit

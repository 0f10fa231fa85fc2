"""Owen scrambling by a grammar of symbols with random words, by invertible lookups."""

from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks, draws, number_theory
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.cells import Moved
from qmcjax.sequences._protocol.binary import BinarySequence, Fraction, as_binary
from qmcjax.sequences._scrambling.scrambled import Scrambled, of_dims

_FEW = 32
"""Up to so many coordinates have tables of eight digits, of 80 KiB each; more have tables of four digits."""

_SYMBOLS = 64


@frozen_pytree
class Codes:
    """The scramblings of all coordinates, in tables over 64 symbols and all values of a few digits."""

    flips: Array
    """uint32 (dims * entries,): flips of all following digits by the nodes on the path of the next ones."""
    origins: Array
    """uint8 (dims * entries,): the preimages of some digits."""
    children: Array
    """uint8 (entries,): the symbol after the digits."""

    @property
    def entries(self) -> int:
        """Length of the table of a coordinate."""
        return self.children.shape[0]

    @property
    def digits(self) -> int:
        """Number of digits per lookup."""
        return (self.entries // _SYMBOLS).bit_length() - 1

    def scrambled(self, word: Array, dim: Array | int) -> Array:
        """Scramble words of the given coordinates."""
        return self._mapped(word, dim, backwards=False)

    def unscrambled(self, word: Array, dim: Array | int) -> Array:
        """Invert :meth:`scrambled`."""
        return self._mapped(word, dim, backwards=True)

    def _mapped(self, word: Array, dim: Array | int, backwards: bool) -> Array:
        start = dim * np.uint32(self.entries)
        symbol = flips = result = jnp.zeros_like(word)
        first = np.uint32(32 - self.digits)
        for _ in range(32 // self.digits):
            digits, node = word >> first, symbol << self.digits
            if backwards:
                # The flips of the symbols on this path are known; those below follow.
                moved = digits ^ (flips >> first)
                digits = self.origins.at[start + (node | moved)].get(mode="promise_in_bounds")
                digits = digits.astype(jnp.uint32)
            flips = flips ^ self.flips.at[start + (node | digits)].get(mode="promise_in_bounds")
            result = (result << self.digits) | (digits if backwards else digits ^ (flips >> first))
            symbol = self.children.at[node | digits].get(mode="promise_in_bounds").astype(jnp.uint32)
            word, flips = word << self.digits, flips << self.digits
        return result


@frozen_pytree
class ArtOwen(Scrambled):
    """A sequence with an invertible nested permutation of each coordinate."""

    codes: Codes

    called = "art_owen"

    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        numbers = jax.lax.iota(jnp.uint32, self.dims)
        return fraction.mapped(word=lambda word: self.codes.scrambled(word, of_dims(numbers, dims, word)))

    def inverted(self, log_side: int) -> Any:
        """Return an object that finds points from their cells by unscrambling the cells."""
        return Unscrambled(self.sequence.inverted(log_side), self.codes)


@frozen_pytree
class Unscrambled(Moved):
    """An invertible net after this scrambling."""

    codes: Codes

    called = "art_owen"

    def word(self, index: Array, dim: int) -> Array:
        return self.codes.scrambled(self.net.word(index, dim), dim)

    def before(self, place: Array, dim: int, log_side: int) -> Array:
        # Two shifts, because a shift by 32 is undefined.
        word = place << (31 - log_side) << 1
        return self.codes.unscrambled(word, dim) >> 1 >> (31 - log_side)


def art_owen(sequence: BinarySequence, key: Array | int) -> ArtOwen:
    """Owen-scramble a sequence in base 2 by invertible lookups, which find points from their cells.

    Each node of the tree of digits has one of 64 symbols, and each symbol a random word of 32 bits. Digit k
    is flipped by the sum of one bit of each word on the path to its node: the first bit of the node's word,
    the second of its parent's, and so on. Equal symbols on a level are at least 24 nodes apart.

    Parameters
    ----------
    sequence : BinarySequence, with ``bits``
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    ArtOwen
        Invertible if the sequence is: :func:`inverted` finds the index of the point in a cell, and
        :func:`qmcjax.samplers.full_screen` accepts it in any dimension.

    Notes
    -----
    Any two points are distributed exactly as after nested uniform scrambling, so variances of means are the
    same. The flip of digit k of one point contains bit k of the word of the root, and no later bit. If the
    points part at digit j, the difference of their flips of a digit k > j contains bit k - j - 1 of the words
    of two different symbols, and no later bit. So in a sum of such flips, one of the latest bits remains: no
    sum vanishes, and these flips are independent. The flips of many points are not: 2**11 random bits per
    coordinate determine all of them.

    The rule for children, the words of 32 bits and the tables of several digits are our own.

    References
    ----------
    .. [1] A. Ahmed, M. Pharr, P. Wonka, "ART-Owen Scrambling", ACM Transactions on Graphics 42, 2023.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> scrambled = art_owen(sequences.sobol(2), key=1)
    >>> cells = sequences.inverted(scrambled, 3)
    >>> index = cells.index_in_cell(jnp.uint32(5), jnp.uint32(2), 3, jnp.uint32(0))
    >>> print((scrambled(index) * 8).astype(int))
    [5 2]
    """
    sequence = as_binary("sequence", sequence)
    return with_tables(sequence, checks.prng_key("key", key), 8 if sequence.dims <= _FEW else 4)


def with_tables(sequence: BinarySequence, key: Array, digits: int) -> ArtOwen:
    """Scramble by tables of 4 or 8 digits; the points are the same."""
    return ArtOwen(sequence, _codes(draws.bits(key, (sequence.dims, _SYMBOLS), jnp.uint32), digits))


@partial(jax.jit, static_argnames="digits")
def _codes(words: Array, digits: int) -> Codes:
    """Return the tables of random words, uint32 (dims, 64)."""
    symbols = _symbols_on_the_way(digits)
    flips = jnp.zeros((words.shape[0], _SYMBOLS << digits), jnp.uint32)
    for depth in range(digits):
        flips = flips ^ (words[:, symbols[depth]] >> depth)
    numbers = np.arange(2**digits, dtype=np.uint32)
    moved = numbers[None, None] ^ (flips >> (32 - digits)).reshape(-1, _SYMBOLS, 2**digits)
    origins = jnp.argsort(moved, axis=-1).astype(jnp.uint8)
    return Codes(flips.ravel(), origins.ravel(), jnp.asarray(symbols[digits].astype(np.uint8)))


@cache
def _symbols_on_the_way(digits: int) -> list[NDArray[np.uint32]]:
    """Return the symbols of the nodes before each digit, and after the last, for all entries.

    They are uint32: JAX accepts the same int64 array only either inside or outside ``jax.enable_x64``.
    """
    entry = np.arange(_SYMBOLS << digits, dtype=np.uint32)
    children: NDArray[np.uint32] = number_theory.word_children().astype(np.uint32)
    symbols: list[NDArray[np.uint32]] = [entry >> np.uint32(digits)]
    for place in range(digits - 1, -1, -1):
        symbols.append(children[symbols[-1], entry >> place & 1])
    return symbols

"""Owen scrambling by a grammar whose symbols carry random words: looked up, and inverted as easily."""

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks, thue_morse
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._digital.cells import Moved
from qmcjax.sequences._protocol.binary import BinarySequence, as_binary
from qmcjax.sequences._protocol.fraction import Fraction
from qmcjax.sequences._scrambling.scrambled import Scrambled, of_dims

_FEW = 32
"""Up to so many coordinates have tables of eight digits, which take 80 KiB each; others of four digits."""

_SYMBOLS = 64


@pytree
@dataclass(frozen=True, eq=False, repr=False)
class Codes:
    """The scramblings of all coordinates, in tables over 64 symbols times all numbers of some digits."""

    flips: Array
    """uint32 (dims * entries,): flips of all digits from here on, by the nodes on the way of the next."""
    origins: Array
    """uint8 (dims * entries,): the digits that are moved to some digits."""
    children: Array
    """uint8 (entries,): the symbol behind the digits."""

    @property
    def entries(self) -> int:
        """Length of the table of a coordinate."""
        return self.children.shape[0]

    @property
    def digits(self) -> int:
        """Number of digits that are looked up together."""
        return (self.entries // _SYMBOLS).bit_length() - 1

    def scrambled(self, word: Array, dim: Array | int) -> Array:
        """Scramble words of some coordinates."""
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
                # Those of the symbols on the way are still to come; the flips of this way are known.
                moved = digits ^ (flips >> first)
                digits = self.origins.at[start + (node | moved)].get(mode="promise_in_bounds")
                digits = digits.astype(jnp.uint32)
            flips = flips ^ self.flips.at[start + (node | digits)].get(mode="promise_in_bounds")
            result = (result << self.digits) | (digits if backwards else digits ^ (flips >> first))
            symbol = self.children.at[node | digits].get(mode="promise_in_bounds").astype(jnp.uint32)
            word, flips = word << self.digits, flips << self.digits
        return result


@pytree
@dataclass(frozen=True, eq=False, repr=False)
class ArtOwen(Scrambled):
    """A sequence whose coordinates go through nested permutations, one each, that can be inverted."""

    sequence: BinarySequence
    codes: Codes

    called = "art_owen"

    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        """Scramble the digits."""

        def word() -> Array:
            word = fraction.word
            return self.codes.scrambled(word, of_dims(jax.lax.iota(jnp.uint32, self.dims), dims, word))

        return Fraction(word=word)

    def inverted(self, log_side: int) -> Any:
        """Return an object that finds points from their cells, whose numbers it unscrambles."""
        return Unscrambled(self.sequence.inverted(log_side), self.codes)


@pytree
@dataclass(frozen=True, eq=False, repr=False)
class Unscrambled(Moved):
    """An invertible net after this scrambling."""

    codes: Codes

    called = "art_owen"

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        return self.codes.scrambled(self.net.word(index, dim), dim)

    def before(self, place: Array, dim: int, log_side: int) -> Array:
        """Return the columns or rows that were moved to some places."""
        # In two steps, since a shift by 32 is not defined.
        word = place << (31 - log_side) << 1
        return self.codes.unscrambled(word, dim) >> 1 >> (31 - log_side)


def art_owen(sequence: BinarySequence, key: Array | int) -> ArtOwen:
    """Owen-scramble a sequence in base 2 by look-ups that can be inverted, from a cell to its points.

    Each node of the tree of digits has one of 64 symbols, and each symbol a random word of 32 bits. Digit k
    is flipped by the sum of one bit of each word on the way to its node: the first bit of the node's own, the
    second of its parent's, and so on. The symbols of a level follow one another as in a word without
    repetitions: equal ones are at least 24 nodes apart.

    Parameters
    ----------
    sequence : BinarySequence
        Any sequence that has ``bits``.
    key : jax.random.key, or int in [0, 2**32)
        A new key gives new words and compiles nothing anew.

    Returns
    -------
    ArtOwen
        If the sequence can be inverted, so can this: :func:`inverted` finds the index of the point in a cell,
        and :func:`qmcjax.samplers.full_screen` scrambles a sequence of any dimension over the screen.

    Raises
    ------
    TypeError
        If ``sequence`` is not in base 2 or ``key`` is no key.

    Notes
    -----
    Any two points are distributed exactly as after nested uniform scrambling, and so variances of means are
    the same. The flip of digit k of one point has bit k of the root's word in it, and no later bit. If the
    points part at digit j, the difference of their flips of a digit k > j has bit k - j - 1 of the words
    of two different symbols in it, and no later bit. So in a sum of such flips, one of the latest bits
    is left over: no sum vanishes, and all these flips are independent. Those of many points are not:
    2**11 random bits a coordinate decide them all.

    The rule for children, the words of all 32 bits and the tables of some digits are our own.

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
    """Scramble by tables of so many digits, 4 or 8, which makes no difference to the points."""
    return ArtOwen(sequence, _codes(jax.random.bits(key, (sequence.dims, _SYMBOLS), jnp.uint32), digits))


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
def _symbols_on_the_way(digits: int) -> list[NDArray[np.int64]]:
    """Return the symbols of the nodes before each of some digits, and behind the last, for all entries."""
    entry = np.arange(_SYMBOLS << digits)
    children, symbols = thue_morse.children().astype(np.int64), [entry >> digits]
    for place in range(digits - 1, -1, -1):
        symbols.append(children[symbols[-1], entry >> place & 1])
    return symbols

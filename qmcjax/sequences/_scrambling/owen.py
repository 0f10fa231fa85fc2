"""Owen scrambling: by hashing, of words in base 2 and of spans of digits in base b; by invertible lookups.

The lookups are in a grammar of symbols with random words.
"""

from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks, draws, number_theory
from qmcjax.core.bits import hash_pair, hash_word, high_product, owen_hash
from qmcjax.core.digits import base_of, cell_fraction, digit_spans, looked_up, word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.halton import random_permutations
from qmcjax.sequences._protocol.base import DigitSequence, with_digits
from qmcjax.sequences._protocol.binary import BinarySequence, Dims, as_binary
from qmcjax.sequences._scrambling.mapped import Mapped, ScrambledDigits, of_dims


@frozen_pytree
class OwenDigits(ScrambledDigits):
    """A sequence with a nested random permutation of each coordinate.

    Digits are grouped into digits in base B, the largest power of b with a small table, with the first digit
    lowest. A hash of the preceding digits is added modulo B to each, with carries only to later digits. Then
    it is looked up in a table drawn by nested uniform scrambling, one per coordinate. So for any two points,
    the lookups after their common digits are independent and uniform, and the digits where they part are
    mapped by one uniform permutation.
    """

    tables: Array
    """uint16: the concatenated tables of all coordinates."""
    seeds: Array
    """uint32 (dims, spans + 1): one seed for each digit in base B, and one for the digits after the last."""

    called = "owen"

    def _scrambled(self, index: Array, dims: np.ndarray | Array, dtype: DTypeLike) -> Array:
        bases = self.sequence.bases
        base = base_of(bases, dims)
        width = digit_spans(base)[0]
        size = base**width
        start = jnp.asarray(_starts(bases))[dims]
        numbers = self.sequence.spans(index, dims)
        seeds = self.seeds[dims]

        prefix = node = jnp.zeros_like(numbers[0])
        scrambled = []
        for k, number in enumerate(numbers):
            node = prefix ^ seeds[..., k]
            moved = number + high_product(hash_word(node), jnp.broadcast_to(word(size), node.shape))
            moved = jnp.where(moved < word(size), moved, moved - word(size))
            scrambled.append(looked_up(self.tables, start, moved))
            prefix = prefix + number * word(size**k)
        leading = jnp.zeros_like(prefix)
        for number in scrambled[:-1]:
            leading = leading * word(size) + number
        # All digits as one number may not fit a word.
        tail = hash_pair(node, numbers[-1] ^ seeds[..., len(numbers)])
        return cell_fraction(leading, scrambled[-1], tail, base, dtype, width, width * len(numbers))


@cache
def _starts(bases: tuple[int, ...]) -> np.ndarray:
    """Return where the table of each base begins: uint32."""
    return np.cumsum([0, *(base ** digit_spans(base)[0] for base in bases[:-1])], dtype=np.uint32)


def owen_digits(sequence: DigitSequence, key: Array) -> OwenDigits:
    """Draw the tables and seeds of all coordinates."""
    bases = sequence.bases
    tables_key, seeds_key = draws.split(key)
    lengths = [np.full(base**level, base) for base in bases for level in range(digit_spans(base)[0])]
    tables = _nested_tables(random_permutations(np.concatenate(lengths), tables_key), bases)
    spans = max(len(digit_spans(base)) for base in bases)
    return OwenDigits(sequence, tables, draws.bits(seeds_key, (len(bases), spans + 1), jnp.uint32))


@partial(jax.jit, static_argnames="bases")
def _nested_tables(permutations: Array, bases: tuple[int, ...]) -> Array:
    """Return tables of nested permutations of spans of digits, with the lowest digit of the argument first.

    There is one permutation for each base, each level, and each prefix.
    """
    parts, start = [], 0
    for base in bases:
        if digit_spans(base)[0] == 1:
            break
        table = jnp.zeros(1, jnp.uint32)
        for level in range(digit_spans(base)[0]):
            of_level = permutations[start : start + base ** (level + 1)].reshape(-1, base)
            table = jnp.tile(table, base) * np.uint32(base) + of_level.T.ravel()
            start += base ** (level + 1)
        parts.append(table.astype(jnp.uint16))
    return jnp.concatenate([*parts, permutations[start:].astype(jnp.uint16)])


@frozen_pytree
class OwenHash:
    """A nested random permutation of each coordinate, by hashing."""

    seeds: Array
    """uint32 (dims,)."""

    called = "owen"

    def bit_reversed(self, bits: Array, dims: Dims) -> Array:
        return owen_hash(bits, of_dims(self.seeds, dims, bits))


def owen(sequence: BinarySequence | DigitSequence, key: Array | int) -> Mapped | OwenDigits:
    """Owen-scramble a sequence by nested hashing.

    Every (t,m,s)-net remains a (t,m,s)-net, and the stratification of the Halton sequence is preserved. Each
    point is uniform in the unit cube, and the coordinates are scrambled independently.

    Parameters
    ----------
    sequence : sequence in base 2, or Halton, Faure or van der Corput sequence
        Digits are scrambled in their base.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Mapped or OwenDigits
        The first in base 2, with exact ``bits``. In other bases the zeros after the digits of an index are
        scrambled as well, down to the resolution of float64. Values in float64 are rounded to nearest and lie
        in the elementary intervals of the scrambled digits. Values in float32 are these, rounded down, unless
        that leaves an interval of length b**-k > 2**-24.

    Notes
    -----
    In base 2, the hash is nearly, but not exactly, uniform over all nested permutations. Tests over many
    keys, which common hashes of this kind fail, find no bias in the flip of a digit, no empty interval, and
    no dependence between the flips at any two or three nodes, or between two points after the digit where
    they part. All permutations of any four consecutive digits occur. Parities of many flips are not uniform:
    of four digits after the first, the parity of all twelve flips of the last two is even with probability
    0.44 or 0.56 instead of 0.5; other parities deviate less. A seed has 32 bits, so only few permutations of
    five or more digits occur. If this matters, use :func:`owen_exact`.

    In base b, any two points are distributed as after nested uniform scrambling, up to the quality of a
    32-bit hash, so variances of means are the same [3]_. Three or more points are not: the permutations at
    all nodes of a coordinate come from one random table of nested permutations of several digits, with
    shifted arguments. If this matters, use :func:`owen_exact`. In contrast to linear scrambling, factors do
    not depend only on the place of a digit, and the base may be composite.

    Two scramblings of one sequence are no further dimensions of each other: equal digits of the sequence keep
    their points in the same places of both, whatever the keys, as for Sobol' indices from two matrices of
    points. Scramble one sequence of all dimensions and divide them: ``owen(sobol(2 * d), key)``.

    References
    ----------
    .. [1] A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1, "Full Owen-Scrambling".
    .. [3] A. B. Owen, "Variance with alternative scramblings of digital nets", 2003.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = sequences.owen(sequences.sobol(2), key=1).points(4)
    >>> print(sorted((points[:, 0] * 4).astype(int).tolist()))
    [0, 1, 2, 3]
    >>> points = sequences.owen(sequences.halton(2), key=1).points(9)
    >>> print(sorted((points[:, 1] * 9).astype(int).tolist()))
    [0, 1, 2, 3, 4, 5, 6, 7, 8]
    """
    if not isinstance(sequence, BinarySequence):
        return owen_digits(with_digits("sequence", sequence), checks.prng_key("key", key))
    seeds = draws.bits(checks.prng_key("key", key), (sequence.dims,), jnp.uint32)
    return Mapped(sequence, OwenHash(seeds))


_FEW = 32
"""Up to so many coordinates have tables of eight digits, of 80 KiB each; more have tables of four digits."""

_SYMBOLS = 64


@frozen_pytree
class Codes:
    """An invertible nested permutation of each coordinate.

    The scramblings are in tables over 64 symbols and all values of a few digits.
    """

    flips: Array
    """uint32 (dims * entries,): flips of all following digits by the nodes on the path of the next ones."""
    origins: Array
    """uint8 (dims * entries,): the preimages of some digits."""
    children: Array
    """uint8 (entries,): the symbol after the digits."""

    called = "art_owen"

    @property
    def entries(self) -> int:
        """Length of the table of a coordinate."""
        return self.children.shape[0]

    @property
    def digits(self) -> int:
        """Number of digits per lookup."""
        return (self.entries // _SYMBOLS).bit_length() - 1

    def word(self, word: Array, dims: Dims) -> Array:
        return self._mapped(word, dims, backwards=False)

    def inverse(self, word: Array, dims: Dims) -> Array:
        return self._mapped(word, dims, backwards=True)

    def _mapped(self, word: Array, dims: Dims, backwards: bool) -> Array:
        numbers = jax.lax.iota(jnp.uint32, self.flips.shape[0] // self.entries)
        start = of_dims(numbers, dims, word) * np.uint32(self.entries)
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


def art_owen(sequence: BinarySequence, key: Array | int) -> Mapped:
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
    Mapped
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


def with_tables(sequence: BinarySequence, key: Array, digits: int) -> Mapped:
    """Scramble by tables of 4 or 8 digits; the points are the same."""
    return Mapped(sequence, _codes(draws.bits(key, (sequence.dims, _SYMBOLS), jnp.uint32), digits))


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

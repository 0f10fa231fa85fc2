"""Owen scrambling in base b by hashing: one nested permutation of spans of digits, shifted by prefix."""

from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import draws
from qmcjax.core.bits import hash_pair, hash_word, high_product
from qmcjax.core.digits import base_of, cell_fraction, digit_spans, word
from qmcjax.core.permuted_digits import looked_up
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._halton.digit_permutations import random_permutations
from qmcjax.sequences._protocol.digit_sequence import DigitSequence
from qmcjax.sequences._scrambling.scrambled import ScrambledDigits


@frozen_pytree
class OwenDigits(ScrambledDigits):
    """A sequence with a nested random permutation of each coordinate.

    Digits are grouped to digits in base B, the largest power of b with a small table, with the first digit
    lowest. A hash of the digits before is added modulo B to each: carries run to later digits only. Then it
    is looked up in a table drawn by nested uniform scrambling, one per coordinate. So for any two points, the
    numbers looked up after their common digits are independent and uniform, and the digits where they part
    go through one uniform permutation.
    """

    tables: Array
    """uint16: the tables of all coordinates, one after the other."""
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
        # All digits as one number may exceed a word.
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

"""Blocks of radical inverses: their points share the high digits of the index, except for one carry.

A block starts at index ``high * b**L + low`` and has at most b**L points. So the index of point k has the low
digits ``low + k``, or these minus b**L and the high digits of ``high + 1``. Both high parts are reflected
once for all points of the block; only the few low digits are reflected for each point.
"""

from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import reverse, to_unit
from qmcjax.core.digits import (
    digit_count,
    digit_reversed,
    digit_spans,
    exact_fraction,
    joined,
    looked_up,
    permuted_spans,
    span_numbers,
    word,
)

PACKED = 8
"""Largest base with permutations packed into words: four bits per digit, looked up by a shift."""


def low_digits(base: int, count: int) -> int:
    """Return the smallest L with ``base**L >= count``, at least 1."""
    digits = 1
    while base**digits < count:
        digits += 1
    return digits


def carried(low: Array, k: Array, size: int) -> tuple[Array, Array]:
    """Return the low digits of point k of a block as a number, and whether they carry."""
    number = low + k
    carry = number >= word(size)
    return jnp.where(carry, number - word(size), number), carry


def prepare(first: Array, count: int, base: int, tables: Array | None, start: int) -> Any:
    """Return the shared state of the blocks that start at ``first``, for one coordinate.

    ``count``: number of points in a block. ``tables``: reflection tables of permuted digits, uint16.
    ``start``: start of the tables of this base. For :func:`points`, with the same arguments.
    """
    if base == 2 or not _shares(base, count, tables):
        return first
    digits = _digits(base, count, tables)
    size = word(base**digits)
    high = first // size
    reflected = partial(_reflected, base=base, digits=digits, tables=tables, start=start)
    block = (first - high * size, reflected(high), reflected(high + np.uint32(1)))
    return block if tables is None or base > PACKED else (*block, _packed(tables, start, base, digits))


def points(
    block: Any, k: Array, count: int, base: int, tables: Array | None, start: int, dtype: DTypeLike
) -> Array | None:
    """Return the coordinate of point k of each block; None if they share no state."""
    if base == 2:
        index = block + k
        return to_unit(reverse(index) ^ _flips(tables, start), dtype)
    if not _shares(base, count, tables):
        return None
    digits = _digits(base, count, tables)
    low, *high = block[:3]
    number, carry = carried(low, k, base**digits)
    if tables is None:
        leading = digit_reversed(number, base, digits)
    elif base <= PACKED:
        leading = _permuted(number, base, digits, block[3])
    else:
        leading = looked_up(tables, jnp.asarray(word(start)), number)
    return exact_fraction(
        leading, jnp.where(carry, high[1], high[0]), base, dtype, digit_count(base) - digits
    )


def _shares(base: int, count: int, tables: Array | None) -> bool:
    """Return whether there are enough low digits for a block, and high digits."""
    return _digits(base, count, tables) < digit_count(base) and (
        tables is None or base ** digit_spans(base)[0] >= count
    )


def _digits(base: int, count: int, tables: Array | None) -> int:
    """Return the number of low digits: the smallest possible, or those of one lookup."""
    return low_digits(base, count) if tables is None or base <= PACKED else digit_spans(base)[0]


def _reflected(high: Array, base: int, digits: int, tables: Array | None, start: int) -> Array:
    """Permute and reflect all digits but the low ones, as an integer: below 2**32."""
    if tables is None:
        return digit_reversed(high, base, digit_count(base) - digits)

    # The low digits are zeros here; their images are subtracted. Intermediate results may wrap.
    def number(index: Array) -> tuple[Array, Array]:
        spans = permuted_spans(span_numbers(index, base), base, tables, jnp.asarray(word(start)))
        return joined(spans, base)

    leading, last = number(high * word(base**digits))
    zero = looked_up(tables, jnp.asarray(word(start)), jnp.uint32(0))
    span, below = digit_spans(base)[0], digit_spans(base)[-1]
    first_digits = zero // word(base ** (span - digits))
    return leading * word(base**below) + last - first_digits * word(base ** (digit_count(base) - digits))


def _packed(tables: Array, start: int, base: int, digits: int) -> Array:
    """Return the permutations of the low digits, uint32 (digits,): the image of d in bits 4 d to 4 d + 3."""
    span = digit_spans(base)[0]
    exponent = np.arange(digits, dtype=np.uint32)[:, None]
    digit = np.arange(base, dtype=np.uint32)
    reflected = looked_up(tables, jnp.asarray(word(start)), jnp.asarray(digit * np.uint32(base) ** exponent))
    images = reflected // np.uint32(base) ** (np.uint32(span - 1) - exponent) % np.uint32(base)
    return jnp.sum(images << (digit * np.uint32(4))[None], axis=1, dtype=jnp.uint32)


def _permuted(number: Array, base: int, digits: int, packed: Array) -> Array:
    """Permute and reflect the low digits."""
    leading = jnp.zeros_like(number)
    for k in range(digits):
        rest = number // word(base) if k < digits - 1 else jnp.zeros_like(number)
        digit = number - rest * word(base)
        leading = leading * word(base) + ((packed[k] >> (digit << 2)) & np.uint32(15))
        number = rest
    return leading


def _flips(tables: Array | None, start: int) -> Array:
    """Return the image of 0: permutations of binary digits flip the same digits of all words."""
    if tables is None:
        return jnp.uint32(0)
    zeros = span_numbers(jnp.uint32(0), 2)
    leading, last = joined(permuted_spans(zeros, 2, tables, jnp.asarray(word(start))), 2)
    return (leading << digit_spans(2)[-1]) | last

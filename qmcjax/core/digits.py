"""Digits in any base: radical inverses of exact fractions, plain or with permuted digits.

An index below 2**32 has ``K = digit_count(base)`` digits, the smallest K with ``base**K >= 2**32``. Reflected
at the radix point they are an integer over ``base**K``. The integer may not fit a word, so its last digits
are stored separately and joined in float64, where it is exact.

``base``, in [2, 2**16], can be an int64 array of bases with equal K, of the rank of the index: then one
program serves all bases. It compiles faster but divides slower than with a constant divisor. Integers in
arrays are uint32, and results are in [0, 1), of ``dtype``: float32 or float64.

Arguments are as in :mod:`qmcjax.core.digits`.
"""

from functools import cache
from itertools import groupby
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import below_one, reverse, to_unit

_TABLE_SIZE = 8192
"""Largest table that permutes several digits together, to fit a first-level cache."""


Base: TypeAlias = int | np.ndarray


def word(value: Base) -> np.uint32:
    """Return an integer, or an array of integers, modulo 2**32."""
    return np.uint32(value % 2**32)


def base_of(bases: tuple[int, ...], dims: np.ndarray | Array) -> Base:
    """Return the base of coordinates that share it, or an array of bases in the shape of ``dims``."""
    if len(set(bases)) == 1:
        return bases[0]
    chosen = np.array(bases)[np.asarray(dims)]
    return int(chosen) if chosen.ndim == 0 else chosen


def quotient(number: Array, divisor: Base) -> Array:
    """Return number // divisor: integer division by an array is slow, a float64 product is exact here.

    (number + 1/2) / divisor is at least 2**-17 away from all integers.
    """
    if np.ndim(divisor) == 0:
        return number // word(divisor)
    with jax.enable_x64(True):
        return ((number.astype(jnp.float64) + 0.5) * (1 / np.asarray(divisor))).astype(jnp.uint32)


def digit_count(base: Base) -> int:
    """Return the number of digits of uint32 indices: the smallest K with ``base**K >= 2**32``.

    Examples
    --------
    >>> digit_count(2), digit_count(3), digit_count(65536)
    (32, 21, 2)
    """
    smallest, count = int(np.min(base)), 1
    while smallest**count < 2**32:
        count += 1
    return count


def exact_fraction(
    leading: Array, last: Array, base: Base, dtype: DTypeLike = jnp.float32, span: int = 1
) -> Array:
    """Divide a numerator of ``K = digit_count(base)`` digits by ``base**K``, once.

    ``leading``: the first ``K - span`` digits after the radix point, as an integer. ``last``: the last
    ``span`` digits, as an integer. In float64 the fraction is rounded to nearest. In float32 this value is
    rounded to nearest again, but never up to 1.
    """
    with jax.enable_x64(True):
        exact = leading.astype(jnp.float64) * np.float64(base**span) + last.astype(jnp.float64)
        # XLA compiles division by a constant to a product with the rounded reciprocal, which loses a bit,
        # but not if the divisor formally depends on the numerator.
        value = exact / (exact * 0.0 + np.float64(base ** digit_count(base)))
        if dtype == jnp.float64:
            return value
        return jnp.minimum(value.astype(jnp.float32), below_one(np.float32))


def cell_fraction(
    leading: Array,
    last: Array,
    tail: Array,
    base: Base,
    dtype: DTypeLike = jnp.float32,
    span: int = 1,
    count: int | None = None,
) -> Array:
    """Return a random point of the elementary interval given by the leading digits.

    The digits after them are the midpoint of a cell of the finest grid on which the sum of both is an exact
    float64. So the point is more than a rounding error away from both ends of its interval, and the single
    division leaves it inside.

    ``leading``: the first ``count - span`` digits after the radix point, as an integer. ``last``: the next
    ``span`` digits, as an integer. ``tail``: the following digits, as a fraction in base 2 with the first in
    bit 31. ``count``: number of digits, ``digit_count(base)`` by default; ``base**count`` is at most 2**48.
    In float64 the fraction is rounded to nearest. In float32 this value is rounded down to a multiple of
    2**-24, unless that lies below its interval of length base**-k, for the largest k with base**-k > 2**-24:
    then it is rounded up.
    """
    count = digit_count(base) if count is None else count
    total = base**count
    with jax.enable_x64(True):
        bits = 53 - np.ceil(np.log2(total)).astype(np.int64)
        middle = ((tail >> word(33 - bits)) << 1 | np.uint32(1)).astype(jnp.float64) * 2.0**-bits
        exact = leading.astype(jnp.float64) * np.float64(base**span) + last.astype(jnp.float64) + middle
        # A divisor that depends on the numerator, as above.
        value = exact / (exact * 0.0 + np.float64(total))
        if dtype == jnp.float64:
            return value
        kept = np.ceil(24 / np.log2(base)).astype(np.int64) - 1
        cell = quotient(leading, base ** (count - span - kept)).astype(jnp.float64)
        lowest = jnp.ceil(cell * (2.0**24 / base**kept))
        return (jnp.maximum(jnp.floor(value * 2.0**24), lowest) * 2.0**-24).astype(jnp.float32)


def radical_inverse(index: Array, base: Base, dtype: DTypeLike = jnp.float32) -> Array:
    """Reflect the digits of an index in base ``base`` at the radix point.

    The reflected digits are collected as an exact integer and divided once, in float64: no error
    accumulates, and every uint32 index has its own value.

    The result is rounded to nearest, but never up to 1 (see :func:`exact_fraction`); in base 2, where float64
    is exact, float32 is rounded down.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Eq. 1.

    Examples
    --------
    >>> print(radical_inverse(jnp.uint32(5), 3))  # 5 is 12 in base 3, reflected 0.21
    0.7777778
    """
    if np.ndim(base) == 0 and base == 2:
        return to_unit(reverse(index), dtype)
    # Digit k is q_k - base q_(k+1), with q_k = index // base**k: collected by quotients instead of digits,
    # the sum of digit k times base**(n - 1 - k) needs one product each, and is right modulo 2**32.
    n = digit_count(base) - 1
    leading = index * word(base ** (n - 1))
    rest = index
    for k in range(1, n + 1):
        rest = quotient(rest, base)
        leading = leading + rest * word(base ** (n - k) // base - base ** (n - k + 1))
    return exact_fraction(leading, rest, base, dtype)


def digit_spans(base: Base) -> tuple[int, ...]:
    """Return the numbers of consecutive digits that one lookup permutes.

    Examples
    --------
    >>> digit_spans(3), digit_spans(101)
    ((8, 8, 5), (1, 1, 1, 1, 1))
    """
    count = digit_count(base)
    smallest, widest = int(np.min(base)), 1
    while smallest ** (widest + 1) <= _TABLE_SIZE:
        widest += 1
    return tuple(min(widest, count - first) for first in range(0, count, widest))


def alike(bases: tuple[int, ...], dims: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Group coordinates that can share a program: of one base, or with equally many spans of one digit."""

    def kind(dim: int) -> int:
        base = bases[dim]
        return digit_count(base) if max(digit_spans(base)) == 1 else -base

    return [tuple(group) for _, group in groupby(dims, kind)]


def span_numbers(index: Array, base: Base) -> list[Array]:
    """Split an index into its spans of digits, low digits first."""
    numbers = []
    for span in digit_spans(base)[:-1]:
        rest = quotient(index, base**span)
        numbers.append(index - rest * word(base**span))
        index = rest
    return [*numbers, index]


def digit_reversed(number: Array, base: Base, span: int) -> Array:
    """Reverse the order of the ``span`` digits of a number."""
    # Collected by quotients, as in radical_inverse: right modulo 2**32.
    reverse = number * word(base ** (span - 1))
    for k in range(1, span):
        number = quotient(number, base)
        reverse = reverse + number * word(base ** (span - 1 - k) - base ** (span + 1 - k))
    return reverse


def limit_64(base: int) -> int:
    """Return the number of indices of :func:`radical_inverse_64`, in [2**48, 2**64)."""
    return 2**32 * base ** (digit_count(base) - 1)


def radical_inverse_64(high: Array, low: Array, base: int, dtype: DTypeLike = jnp.float32) -> Array:
    """Reflect the digits of a 64-bit index at the radix point.

    ``high``, ``low``: the index ``high * 2**32 + low``, below :func:`limit_64`. In base 2 the result has the
    first 32 digits. In other bases float64 is off by less than 2**-52, and float32 is this value rounded to
    nearest; neither is ever 1.
    """
    if base == 2:
        return to_unit(reverse(low), dtype)
    count = digit_count(base) - 1
    with jax.enable_x64(True):
        index = (high.astype(jnp.uint64) << 32) | low.astype(jnp.uint64)
        # Both the first ``count`` digits and the others are numbers below 2**32.
        rest = index // np.uint64(base**count)
        first = (index - rest * np.uint64(base**count)).astype(jnp.uint32)
        tail = radical_inverse(rest.astype(jnp.uint32), base, jnp.float64)
        value = (digit_reversed(first, base, count).astype(jnp.float64) + tail) * np.float64(1 / base**count)
        if dtype == jnp.float64:
            return jnp.minimum(value, np.float64(1 - 2.0**-53))
        return jnp.minimum(value.astype(jnp.float32), below_one(np.float32))


_SELECTED = 5
"""Largest base with single digits permuted without a gather."""


def reflection_tables(rows: Any) -> list[Any]:
    """Return tables of the permuted and reflected digits of all numbers of each span of digits.

    ``rows``: uint32 numpy or JAX array, shape (digit_count(base), base): row k permutes digit k, that of
    ``base**k``. Tables are uint16, shape (base**span,), one for each of ``digit_spans(base)``.
    """
    base = rows.shape[1]
    tables, first = [], 0
    for span in digit_spans(base):
        table = rows[first]
        for k in range(first + 1, first + span):
            table = (table[None, :] * np.uint32(base) + rows[k][:, None]).ravel()
        tables.append(table.astype(np.uint16))
        first += span
    return tables


@cache
def table_starts(bases: tuple[int, ...]) -> np.ndarray:
    """Return the int64 starts of the tables of each base in their concatenation."""
    sizes = [sum(base**span for span in digit_spans(base)) for base in bases]
    return np.cumsum([0, *sizes[:-1]], dtype=np.int64)


def looked_up(tables: Array, start: Array, number: Array) -> Array:
    """Return entries of the table that begins at ``start``; without bounds checks."""
    return tables.at[number + start].get(mode="promise_in_bounds").astype(jnp.uint32)


def permuted_digit(permutation: Array, digit: Array) -> Array:
    """Return an entry of a permutation; short ones use selections, since accelerators gather slowly."""
    base = permutation.shape[0]
    if base > _SELECTED:
        return permutation.at[digit].get(mode="promise_in_bounds")
    entry = jnp.broadcast_to(permutation[0], digit.shape)
    for k in range(1, base):
        entry = jnp.where(digit == np.uint32(k), permutation[k], entry)
    return entry


def permuted_spans(numbers: list[Array], base: Base, tables: Array, start: Array) -> list[Array]:
    """Permute and reflect the digits of each span by its table; the first begins at ``start``."""
    permuted = []
    for number, span in zip(numbers, digit_spans(base), strict=True):
        permuted.append(looked_up(tables, start, number))
        start = start + word(base**span)
    return permuted


def joined(numbers: list[Array], base: Base) -> tuple[Array, Array]:
    """Join reflected spans, except the last, to one number, and return it with the last."""
    leading = jnp.zeros_like(numbers[0])
    for number, span in zip(numbers[:-1], digit_spans(base), strict=False):
        leading = leading * word(base**span) + number
    return leading, numbers[-1]


def permuted_radical_inverse(
    index: Array, base: Base, tables: Array, dtype: DTypeLike = jnp.float32, offset: Base = 0
) -> Array:
    """Permute the digits of an index, then reflect them at the radix point.

    All ``K = digit_count(base)`` digits are permuted, including leading zeros of the index, and none beyond.
    If a permutation moves 0, the infinitely many zeros beyond would add the same constant to the values of
    all indices, between 0 and ``base**-K``, at most 2**-32.

    ``tables``: uint16 Array: the concatenated :func:`reflection_tables`. ``offset``: start of the tables of
    this base, of the shape of ``base``. Values are rounded as by :func:`radical_inverse`.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.1.

    Examples
    --------
    >>> from qmcjax.core.digits import digit_count
    >>> swap = jnp.array([[0, 2, 1]] * digit_count(3), jnp.uint32)
    >>> tables = jnp.concatenate(reflection_tables(swap))
    >>> print(permuted_radical_inverse(jnp.uint32(5), 3, tables))  # 0.21 becomes 0.12
    0.5555556
    """
    start = jnp.asarray(word(offset))
    leading, last = joined(permuted_spans(span_numbers(index, base), base, tables, start), base)
    span = digit_spans(base)[-1]
    if np.ndim(base) == 0 and base == 2:
        return to_unit((leading << span) | last, dtype)
    return exact_fraction(leading, last, base, dtype, span)

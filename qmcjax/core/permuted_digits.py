"""Permuted digits: radical inverses with tables that permute several digits in one look-up.

Arguments are as in :mod:`qmcjax.core.digits`.
"""

from functools import cache
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import to_unit
from qmcjax.core.digits import Base, digit_spans, exact_fraction, span_numbers, word

_SELECTED = 5
"""Largest base with single digits permuted without a gather."""


def reflection_tables(rows: Any) -> list[Any]:
    """Return tables of the permuted and reflected digits of all numbers of each span of digits.

    ``rows``: uint32 numpy or JAX array, shape (digit_count(base), base): row k permutes digit k, the digit of
    ``base**k``. Returns list of uint16 arrays, numpy or JAX as ``rows``, shapes (base**span,): one for each
    of ``digit_spans(base)``.
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

    All ``K = digit_count(base)`` digits are permuted, leading zeros of the index among them, and none
    beyond. Where a permutation moves 0, the infinitely many zeros beyond would add the same constant to the
    values of all indices, between 0 and ``base**-K``, at most 2**-32.

    ``tables``: uint16 Array: the permutations: the :func:`reflection_tables`, one after the other.
    ``offset``: of the shape of ``base``: where the tables of this base start. Values are rounded as by
    :func:`radical_inverse`.

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

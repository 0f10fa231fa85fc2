"""Digital sequences in an odd prime base: a coordinate is a matrix over F_q times the digits of the index."""

from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.digits import digit_count, digit_spans, exact_fraction
from qmcjax.pytrees import pytree
from qmcjax.sequences._base import FEW, Sequence


@pytree
@dataclass(frozen=True)
class PrimeDigital(Sequence):
    """Coordinate j of point i is C_j times the digits of i, over F_q (thesis Eq. 5.9).

    The products with all numbers of a few digits are tabulated. Each digit of a product has a field of a
    word, wide enough for the sum of the table entries of an index; at last it is reduced modulo q.
    """

    base: int = field(metadata={"static": True})
    tables: Array
    """uint32 (dims, words, entries): the tables of all spans of digits, one after the other."""

    @property
    def dims(self) -> int:
        """Number of coordinates."""
        return self.tables.shape[0]

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices, in their shape."""
        return self._fractions(index, np.array(dim), dtype)

    def _values(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if len(dims) <= FEW:
            return super()._values(index, dims, dtype)
        return self._fractions(index[..., None], np.array(dims).reshape((1,) * index.ndim + (-1,)), dtype)

    def _fractions(self, index: Array, dims: np.ndarray, dtype: DTypeLike) -> Array:
        base = np.uint32(self.base)
        _, words, entries = self.tables.shape
        tables = self.tables.ravel()
        sums = [jnp.zeros_like(index)] * words
        rest = index
        start = dims * (words * entries)
        for size in (self.base**span for span in digit_spans(self.base)):
            quotient = rest // np.uint32(size)
            number = rest - quotient * np.uint32(size)
            for w in range(words):
                place = number + (start + w * entries).astype(np.uint32)
                sums[w] = sums[w] + tables.at[place].get(mode="promise_in_bounds")
            rest, start = quotient, start + size
        width, per_word = _fields(self.base)
        mask = np.uint32(2**width - 1)
        digits = [
            ((sums[k // per_word] >> (k % per_word * width)) & mask) % base
            for k in range(digit_count(self.base))
        ]
        leading = digits[0]
        for digit in digits[1:-1]:
            leading = leading * base + digit
        return exact_fraction(leading, digits[-1], self.base, dtype)


def prime_digital(matrices: np.ndarray, base: int) -> PrimeDigital:
    """Make the digital sequence of matrices over F_q, int64 (dims, K, K), for the K digits of an index."""
    width, per_word = _fields(base)
    dims, count, _ = matrices.shape
    words = -(-count // per_word)
    tables = []
    first = 0
    for span in digit_spans(base):
        number = np.arange(base**span)
        digits = np.stack([number // base**k % base for k in range(span)])
        product = matrices[:, :, first : first + span] @ digits % base
        packed = np.zeros((dims, words, len(number)), np.uint32)
        for k in range(count):
            packed[:, k // per_word] |= product[:, k].astype(np.uint32) << np.uint32(k % per_word * width)
        tables.append(packed)
        first += span
    return PrimeDigital(base, jnp.asarray(np.concatenate(tables, axis=-1)))


def _fields(base: int) -> tuple[int, int]:
    """Return the bits of a field that holds a sum of one digit from each table, and the fields of a word."""
    width = (len(digit_spans(base)) * (base - 1)).bit_length()
    return width, 32 // width

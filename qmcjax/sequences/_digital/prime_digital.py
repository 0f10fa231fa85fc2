"""Digital sequences in an odd prime base: a coordinate is a matrix over F_q times the digits of the index."""

from dataclasses import field
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax.core.digits import digit_count, digit_spans, exact_fraction
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import FEW
from qmcjax.sequences._protocol.digit_sequence import DigitSequence


@frozen_pytree
class PrimeDigital(DigitSequence):
    """Coordinate j of point i is C_j times the digits of i, over F_q (thesis Eq. 5.9).

    Tables hold the products with all numbers of a few digits. Each digit of a product has a field of a word,
    wide enough for the sum of the table entries of an index; the sum is reduced modulo q.
    """

    bases: tuple[int, ...] = field(metadata={"static": True})
    """The prime q, for all coordinates."""
    tables: Array
    """uint32 (dims, words, entries): the tables of all spans of digits, one after the other."""
    called: str = field(default="faure", metadata={"static": True})
    """Name of the function that makes such a sequence."""

    reported = ("dims", "base")

    @property
    def base(self) -> int:
        """The prime q."""
        return self.bases[0]

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        return self._fractions(index, np.array(dim), dtype)

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if len(dims) <= FEW:
            return super().coordinates(index, dims, dtype)
        return self._fractions(index[..., None], np.array(dims).reshape((1,) * index.ndim + (-1,)), dtype)

    def spans(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        digits = iter(self._digits(index, dims))
        numbers = []
        for span in digit_spans(self.base):
            of_span = list(islice(digits, span))
            number = of_span[-1]
            for digit in of_span[-2::-1]:
                number = number * np.uint32(self.base) + digit
            numbers.append(number)
        return numbers

    def radical_bases(self) -> tuple[int | None, ...]:
        """Return the base for each component with a lower triangular or traced matrix."""
        if isinstance(self.tables, Tracer):
            return self.bases
        return tuple(
            self.base if not np.any(np.triu(matrix, 1)) and np.all(np.diagonal(matrix)) else None
            for matrix in map(self.matrix, range(self.dims))
        )

    def index_digits(self, component: int, count: int) -> None:
        """Return None if the matrix of the component is the identity or traced."""
        if isinstance(self.tables, Tracer):
            return
        matrix = self.matrix(component)
        if np.any(matrix != np.eye(len(matrix))):
            super().index_digits(component, count)

    def matrix(self, component: int) -> NDArray[np.uint32]:
        """Return a generator matrix: column k has the digits of point base**k."""
        powers = np.uint32(self.base) ** np.arange(digit_count(self.base), dtype=np.uint32)
        return np.asarray(_digits_of(self, jnp.asarray(powers), jnp.uint32(component)))

    def _fractions(self, index: Array, dims: np.ndarray, dtype: DTypeLike) -> Array:
        digits = self._digits(index, dims)
        leading = digits[0]
        for digit in digits[1:-1]:
            leading = leading * np.uint32(self.base) + digit
        return exact_fraction(leading, digits[-1], self.base, dtype)

    def _digits(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        """Return the digits after the radix point, the first one first."""
        base = np.uint32(self.base)
        _, words, entries = self.tables.shape
        tables = self.tables.ravel()
        sums = [jnp.zeros_like(index)] * words
        rest = index
        start = jnp.asarray(dims.astype(np.uint32)) * np.uint32(words * entries)
        for size in (self.base**span for span in digit_spans(self.base)):
            quotient = rest // np.uint32(size)
            number = rest - quotient * np.uint32(size)
            for w in range(words):
                place = number + start + np.uint32(w * entries)
                sums[w] = sums[w] + tables.at[place].get(mode="promise_in_bounds")
            rest, start = quotient, start + np.uint32(size)
        width, per_word = _fields(self.base)
        mask = np.uint32(2**width - 1)
        return [
            ((sums[k // per_word] >> (k % per_word * width)) & mask) % base
            for k in range(digit_count(self.base))
        ]


@jax.jit
def _digits_of(sequence: PrimeDigital, index: Array, dim: Array) -> Array:
    return jnp.stack(sequence._digits(index, dim))


def prime_digital(matrices: np.ndarray, base: int, called: str = "faure") -> PrimeDigital:
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
    return PrimeDigital((base,) * dims, jnp.asarray(np.concatenate(tables, axis=-1)), called)


def _fields(base: int) -> tuple[int, int]:
    """Return the bits of a field for a sum of one digit per table, and the fields of a word."""
    width = (len(digit_spans(base)) * (base - 1)).bit_length()
    return width, 32 // width

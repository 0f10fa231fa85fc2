"""Radical inverses with or without permuted digits: the van der Corput and the Halton sequence.

For references see :func:`qmcjax.sequences.halton`.
"""

from dataclasses import field, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, draws
from qmcjax.core.digits import (
    alike,
    base_of,
    digit_count,
    digit_reversed,
    digit_spans,
    limit_64,
    permuted_radical_inverse,
    permuted_spans,
    radical_inverse,
    radical_inverse_64,
    reflection_tables,
    span_numbers,
    table_starts,
    word,
)
from qmcjax.core.number_theory import next_prime
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.core.tables import rows
from qmcjax.sequences._digital import radical_blocks
from qmcjax.sequences._digital.digital import Digital, sobol
from qmcjax.sequences._protocol.base import DigitSequence, Sequence

FAURE_LEMIEUX_DIMS = 360
"""Number of factors in the table."""


def zaremba_permutations(base: int) -> np.ndarray:
    """Return the shifts (a + k) mod b of digit k [1]_."""
    digit, k = np.arange(base), np.arange(digit_count(base))
    return (digit[None, :] + k[:, None]) % base


def faure_permutations(base: int) -> np.ndarray:
    """Return Faure's permutation for all digits [2]_; it keeps 0.

    It starts with the identity for b = 2. The permutation of 2b is twice the permutation of b, followed by
    the same plus 1. For odd b = 2c + 1, entries of the permutation of 2c that are at least c increase by one,
    and c is inserted in the middle.
    """
    return _every_digit(_faure_permutation(base))


def faure_lemieux_permutations(bases: tuple[int, ...]) -> list[np.ndarray]:
    """Return the multiples f a mod b of each base [3]_."""
    factors = [int(factor) for (factor,) in rows("sequences", "faure_lemieux.txt")]
    return [
        _every_digit(factor * np.arange(base) % base)
        for base, factor in zip(bases, factors[: len(bases)], strict=True)
    ]


def permutation_tables(permutations: list[np.ndarray]) -> Array:
    """Return the concatenated lookup tables of all bases."""
    return jnp.asarray(
        np.concatenate([t for p in permutations for t in reflection_tables(p.astype(np.uint32))])
    )


def random_permutations(lengths: np.ndarray, key: Array) -> Array:
    """Draw independent uniform permutations of the given lengths: uint32, concatenated."""
    # A single sort puts the numbers of each permutation in random order.
    which = np.repeat(np.arange(len(lengths), dtype=np.uint32), lengths)
    digit = np.arange(len(which)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    return _shuffled(key, jnp.asarray(which), jnp.asarray(digit.astype(np.uint32)))


@jax.jit
def _shuffled(key: Array, which: Array, digit: Array) -> Array:
    random = draws.bits(key, (2, len(which)), jnp.uint32)
    return jax.lax.sort((which, random[0], random[1], digit), num_keys=3)[3]


def random_tables(bases: tuple[int, ...], key: Array) -> Array:
    """Return the lookup tables of independent uniform permutations of each digit of each base."""
    return _joined(random_permutations(np.repeat(bases, [digit_count(base) for base in bases]), key), bases)


@partial(jax.jit, static_argnames="bases")
def _joined(digits: Array, bases: tuple[int, ...]) -> Array:
    """Replace permutations of single digits by tables of spans, the same for large bases."""
    parts, start = [], 0
    for base in bases:
        if max(digit_spans(base)) == 1:
            break
        stop = start + digit_count(base) * base
        parts += reflection_tables(digits[start:stop].reshape(-1, base))
        start = stop
    return jnp.concatenate([*parts, digits[start:].astype(jnp.uint16)])


def _every_digit(permutation: np.ndarray) -> np.ndarray:
    base = len(permutation)
    return np.broadcast_to(permutation, (digit_count(base), base))


def _faure_permutation(base: int) -> np.ndarray:
    if base == 2:
        return np.arange(2)
    if base % 2 == 0:
        half = 2 * _faure_permutation(base // 2)
        return np.concatenate([half, half + 1])
    middle = base // 2
    even = _faure_permutation(base - 1)
    return np.insert(even + (even >= middle), middle, middle)


HALTON_DIMS = 1024

PERMUTATIONS = (None, "zaremba", "faure", "faure_lemieux", "random")

MANY = 64
"""Number of coordinates above which large bases share code, to limit compile time."""


@frozen_pytree
class RadicalInverses(DigitSequence):
    """One radical inverse per coordinate (Hilbert paper, Eq. 1), with or without permuted digits."""

    bases: tuple[int, ...] = field(metadata={"static": True})
    tables: Array | None = None
    """uint16: the concatenated reflection tables of all bases."""
    high: Array | None = None
    """Upper words of 64-bit indices."""

    reported = ("dims", "base", "permuted")

    @property
    def called(self) -> str:
        return "halton" if self.base is None else "van_der_corput"

    @property
    def base(self) -> int | None:
        """The base of the van der Corput sequence in a base other than 2."""
        return self.bases[0] if self.dims == 1 and self.bases[0] > 2 else None

    @property
    def permuted(self) -> bool:
        """Whether digits are permuted."""
        return self.tables is not None

    @property
    def limit_64(self) -> int:
        """Limit of 64-bit indices; permutations cover only the digits of 32-bit indices."""
        return self.limit if self.tables is not None else min(limit_64(base) for base in self.bases)

    def with_high_word(self, high: Array) -> Sequence:
        return super().with_high_word(high) if self.tables is not None else replace(self, high=high)

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        base = self.bases[dim]
        if self.high is not None:
            return radical_inverse_64(self.high, index, base, dtype)
        if self.tables is None:
            return radical_inverse(index, base, dtype)
        return permuted_radical_inverse(index, base, self.tables, dtype, table_starts(self.bases)[dim])

    def spans(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        base = base_of(self.bases, dims)
        numbers = span_numbers(index, base)
        if self.tables is None:
            return numbers
        permuted = permuted_spans(
            numbers, base, self.tables, jnp.asarray(word(table_starts(self.bases)))[dims]
        )
        return [digit_reversed(n, base, span) for n, span in zip(permuted, digit_spans(base), strict=True)]

    def radical_bases(self) -> tuple[int | None, ...]:
        return self.bases

    def index_digits(self, component: int, count: int) -> Array | None:
        """Return the inverse permutations of the first digits of an index."""
        return None if self.tables is None or count == 0 else _inverse_permutations(self, component, count)

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if len(dims) < MANY or self.high is not None:
            return super().coordinates(index, dims, dtype)
        parts = []
        for wanted in alike(self.bases, dims):
            coordinates = self._together if len(wanted) > 1 else super().coordinates
            parts.append(coordinates(index, wanted, dtype))
        return jnp.concatenate(parts, axis=-1)

    def prepare_block(self, first: Array, count: int, dims: tuple[int, ...]) -> Any:
        return {
            j: radical_blocks.prepare(first, count, self.bases[j], self.tables, table_starts(self.bases)[j])
            for j in dims
        }

    def block_points(
        self, block: Any, k: Array, count: int, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        values = []
        for j in dims:
            start = table_starts(self.bases)[j]
            value = radical_blocks.points(block[j], k, count, self.bases[j], self.tables, start, dtype)
            values.append(self.coordinate(block[j] + k, j, dtype) if value is None else value)
        return jnp.stack(values, axis=-1)

    def _together(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return coordinates with bases of equally many digits."""
        row = (1,) * index.ndim + (-1,)
        bases = np.array([self.bases[j] for j in dims]).reshape(row)
        if self.tables is None:
            return radical_inverse(index[..., None], bases, dtype)
        offsets = table_starts(self.bases)[np.array(dims)].reshape(row)
        return permuted_radical_inverse(index[..., None], bases, self.tables, dtype, offsets)


@partial(jax.jit, static_argnames=("component", "count"))
def _inverse_permutations(sequence: RadicalInverses, component: int, count: int) -> Array:
    base = sequence.bases[component]
    powers = base ** np.arange(count, dtype=np.uint32)[:, None]
    numbers = sequence.spans(jnp.asarray(powers * np.arange(base, dtype=np.uint32)), np.array(component))
    rows, first = [], 0
    for number, span in zip(numbers, digit_spans(base), strict=True):
        here = range(min(span, count - first))
        rows += [number[first + k] // np.uint32(base**k) % np.uint32(base) for k in here]
        first += span
    return jnp.argsort(jnp.stack(rows), axis=1).astype(jnp.uint32)


def van_der_corput(base: int = 2) -> RadicalInverses | Digital:
    """Make the van der Corput sequence: the digits of the index, reflected at the radix point.

    Parameters
    ----------
    base : int, in [2, 65536]; in base 2 the sequence has exact ``bits``

    Returns
    -------
    Sequence, one dimension

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Eq. 1.

    Examples
    --------
    >>> print(van_der_corput(3).points(4)[:, 0])
    [0.         0.33333334 0.6666667  0.11111111]
    """
    base = checks.integer("base", base, 2, 2**16)
    return sobol(1) if base == 2 else RadicalInverses((base,))


def halton(dims: int, permutation: str | None = None, key: Array | int | None = None) -> RadicalInverses:
    """Make the Halton sequence: radical inverses in the first prime bases, with or without permuted digits.

    Parameters
    ----------
    dims : int, in [1, 1024]; in [1, 360] for "faure_lemieux"
    permutation : {None, "zaremba", "faure", "faure_lemieux", "random"}
        The image of digit a, the k-th of the index (k = 0 is the digit of b**0), in base b. "zaremba": (a +
        k) mod b [1]_. "faure": Faure's recursively constructed permutation [2]_. "faure_lemieux": f a mod b
        with a searched factor for each b [3]_. "random": an independent uniform permutation for each digit of
        each component.
    key : jax.random.key, or int in [0, 2**32), optional
        For "random" only. A new key does not recompile.

    Returns
    -------
    RadicalInverses
        Every value is an exact fraction, rounded once, with the K digits of uint32 indices: K is the smallest
        number with b**K >= 2**32. The Zaremba and the random permutations move 0: digits beyond K would add
        one constant below b**-K to all values; it is omitted.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.1.
    .. [2] H. Faure, "Good permutations for extreme discrepancy", J. Number Theory 42, 1992.
    .. [3] H. Faure, C. Lemieux, "Generalized Halton Sequences in 2008: A Comparative Study", 2009.

    Examples
    --------
    >>> print(halton(2).points(3))
    [[0.         0.        ]
     [0.5        0.33333334]
     [0.25       0.6666667 ]]
    >>> print((halton(3, "faure").points(5)[:, 2] * 5).astype(int))
    [0 3 2 1 4]
    """
    if permutation is not None:
        checks.choice("permutation", permutation, PERMUTATIONS)
    if (key is None) == (permutation == "random"):
        raise ValueError(f"key must be given for permutation='random' only, got {checks.shown(key)}")
    limit = FAURE_LEMIEUX_DIMS if permutation == "faure_lemieux" else HALTON_DIMS
    bases = _primes(checks.integer("dims", dims, 1, limit))
    if permutation is None:
        return RadicalInverses(bases)
    if permutation == "random":
        tables = random_tables(bases, checks.prng_key("key", key))
    elif permutation == "faure_lemieux":
        tables = permutation_tables(faure_lemieux_permutations(bases))
    else:
        of_base = faure_permutations if permutation == "faure" else zaremba_permutations
        tables = permutation_tables([of_base(base) for base in bases])
    return RadicalInverses(bases, tables)


def _primes(count: int) -> tuple[int, ...]:
    primes = [2]
    while len(primes) < count:
        primes.append(next_prime(primes[-1] + 1))
    return tuple(primes)

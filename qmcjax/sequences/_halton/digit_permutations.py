"""Digit permutations of the Halton sequence: an array (digits, base) per base, row k for digit k.

References are those of :func:`qmcjax.sequences.halton`.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import draws
from qmcjax.core.digits import digit_count, digit_spans
from qmcjax.core.permuted_digits import reflection_tables
from qmcjax.core.tables import rows

FAURE_LEMIEUX_DIMS = 360
"""Number of factors in the table."""


def zaremba(base: int) -> np.ndarray:
    """Return the shifts (a + k) mod b of digit k [1]_."""
    digit, k = np.arange(base), np.arange(digit_count(base))
    return (digit[None, :] + k[:, None]) % base


def faure(base: int) -> np.ndarray:
    """Return Faure's permutation for all digits [2]_; it keeps 0.

    From the identity for b = 2, the permutation of 2b is twice the permutation of b, then the same plus 1;
    for odd b = 2c + 1, the entries of the permutation of 2c that reach c increase by one, and c becomes the
    middle.
    """
    return _every_digit(_faure_permutation(base))


def faure_lemieux(bases: tuple[int, ...]) -> list[np.ndarray]:
    """Return the multiples f a mod b of each base [3]_."""
    factors = [int(factor) for (factor,) in rows("sequences", "faure_lemieux.txt")]
    return [
        _every_digit(factor * np.arange(base) % base)
        for base, factor in zip(bases, factors[: len(bases)], strict=True)
    ]


def tables(permutations: list[np.ndarray]) -> Array:
    """Return the look-up tables of all bases, one after the other."""
    return jnp.asarray(
        np.concatenate([t for p in permutations for t in reflection_tables(p.astype(np.uint32))])
    )


def random_permutations(lengths: np.ndarray, key: Array) -> Array:
    """Draw independent uniform permutations of the given lengths: uint32, one after the other."""
    # One sort for all: numbers in random order within each permutation.
    which = np.repeat(np.arange(len(lengths), dtype=np.uint32), lengths)
    digit = np.arange(len(which)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    return _shuffled(key, jnp.asarray(which), jnp.asarray(digit.astype(np.uint32)))


@jax.jit
def _shuffled(key: Array, which: Array, digit: Array) -> Array:
    random = draws.bits(key, (2, len(which)), jnp.uint32)
    return jax.lax.sort((which, random[0], random[1], digit), num_keys=3)[3]


def random_tables(bases: tuple[int, ...], key: Array) -> Array:
    """Return the look-up tables of independent uniform permutations of each digit of each base."""
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

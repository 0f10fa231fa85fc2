"""Words of 32 bits: reversal, carry-free products in log steps, hashes, and the conversion to floats.

A coordinate in base 2 is a ``uint32`` fraction: bit 31 is the first digit after the binary point.
A *bit-reversed* fraction has the first digit in bit 0. The bits of an index already form one (its van der
Corput radical inverse), and carries run from the first digit to later ones, as Owen scrambling by hashing
requires. So generators and scramblings work on bit-reversed words, and :func:`reverse` is applied once, at
the end.

Arguments and results are uint32 Arrays of one shape, unless a function says otherwise. The thesis is
L. Gruenschloss, "Motion Blur", 2008.
"""

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

F = TypeVar("F", bound=Callable[..., Any])


def traced_once(function: F) -> F:
    """Trace a function of arrays once for their shapes; programs that call it reuse its operations.

    Tracing is the Python part of a first call: about 0.1 ms per operation, and a tenth of that if reused.
    Called only with NumPy arrays, the function computes in NumPy.
    """
    once = jax.jit(function, inline=True)

    @functools.wraps(function)
    def call(*args: Any) -> Any:
        return (once if any(isinstance(each, Array) for each in args) else function)(*args)

    return cast(F, call)


def below_one(dtype: DTypeLike) -> np.ndarray:
    """Return the largest number below 1 of a floating dtype."""
    return np.nextafter(np.ones((), dtype), np.zeros((), dtype))


def _word(value: int) -> np.uint32:
    return np.uint32(value)


@traced_once
def reverse(word: Array) -> Array:
    """Reverse the order of the 32 bits.

    Examples
    --------
    >>> print(reverse(jnp.uint32(1)))
    2147483648
    """
    word = (word << 16) | (word >> 16)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        word = ((word & _word(mask)) << shift) | ((word >> shift) & _word(mask))
    return word


@traced_once
def pascal(reversed_bits: Array) -> Array:
    """Multiply a bit-reversed fraction by Pascal's triangle modulo 2, in five steps.

    This is the generator matrix of the second component of the Sobol' sequence, its own inverse
    (thesis, Eq. 5.14 and Remark 2). It is a Kronecker power of ((1, 1), (0, 1)), hence a
    product of five sparse factors.

    ``reversed_bits``: the digits ``d_0, d_1, ...`` of the index in bits 0, 1, ... Returns the bit-reversed
    product: its first row in bit 0.
    """
    for shift, mask in ((16, 0xFFFF0000), (8, 0xFF00FF00), (4, 0xF0F0F0F0), (2, 0xCCCCCCCC), (1, 0xAAAAAAAA)):
        reversed_bits = reversed_bits ^ ((reversed_bits & _word(mask)) >> shift)
    return reversed_bits


@traced_once
def gray_decode(word: Array) -> Array:
    """Replace bit ``k`` by the parity of the bits ``k`` and above.

    On a bit-reversed fraction this is the product with the upper triangular matrix of ones, the
    Larcher-Pillichshammer generator matrix (thesis, Eq. 5.15).
    """
    for shift in (1, 2, 4, 8, 16):
        word = word ^ (word >> shift)
    return word


def gray_encode(word: Array) -> Array:
    """Invert :func:`gray_decode` (the bidiagonal inverse matrix of Eq. 5.25)."""
    return word ^ (word >> 1)


def high_product(a: Array, b: Array) -> Array:
    """Return the upper word of the product of two words.

    ``jax.lax.mulhi`` does the same, but XLA for CPUs cannot compile it for several devices (jax 0.10).
    """
    with jax.enable_x64(True):
        product = a.astype(jnp.uint64) * b.astype(jnp.uint64)
        return (product >> np.uint64(32)).astype(jnp.uint32)


_SPREADING = ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555))
_GATHERING = ((1, 0x33333333), (2, 0x0F0F0F0F), (4, 0x00FF00FF), (8, 0x0000FFFF))


@traced_once
def spread(word: Array) -> Array:
    """Move bit ``k`` to bit ``2 k``, for the lower 16 bits."""
    for shift, mask in _SPREADING:
        word = (word | (word << shift)) & _word(mask)
    return word


@traced_once
def gather(word: Array) -> Array:
    """Move bit ``2 k`` to bit ``k``; drop the odd bits."""
    word = word & _word(0x55555555)
    for shift, mask in _GATHERING:
        word = (word | (word >> shift)) & _word(mask)
    return word


@traced_once
def hash_word(word: Array) -> Array:
    """Mix a word: a bijection of 32-bit words, with all output bits dependent on all input bits.

    Notes
    -----
    C. Wellons' ``triple32``, found by a search for low avalanche bias (0.0209 per mille, against
    0.17 for the two-round ``lowbias32``).
    """
    word = (word ^ (word >> 17)) * _word(0xED5AD4BB)
    word = (word ^ (word >> 11)) * _word(0xAC4C1B51)
    word = (word ^ (word >> 15)) * _word(0x31848BAB)
    return word ^ (word >> 14)


@traced_once
def hash_pair(one: Array, other: Array) -> Array:
    """Mix two words into one: a bijection of each of them while the other is fixed.

    Both are mixed before they are combined. If a mixed word were combined with a raw one, ranges of the raw
    one would give shifted copies of each other wherever the mixed words are close.

    ``one``, ``other``: broadcast together; for another hash of the same pairs, xor each with a separate
    random word.
    """
    # The odd factor distinguishes (a, b) from (b, a).
    return hash_word(hash_word(one) * _word(0x9E3779B9) + hash_word(other))


def _masked_sum(word: Array, summand: Array, mask: Array) -> Array:
    """Replace the bits of a mask by those of the sum with an odd number."""
    return word ^ ((word ^ (word + (summand | _word(1)))) & mask)


@traced_once
def owen_hash(reversed_bits: Array, seed: Array) -> Array:
    """Owen-scramble bit-reversed fractions in base 2.

    Digit ``k`` is flipped by a hash of the digits before it: sums and products carry only towards higher
    bits, so the map is a nested permutation for every seed [1]_.

    ``seed``: broadcastable to ``reversed_bits``: one well mixed word per realisation and coordinate.

    Notes
    -----
    At each level of the tree, count the flips of all nodes: the parity of a composition is the sum of the
    parities of its steps. A sum or a product with an odd number has the same parity at all levels but the
    first. So hashes made of these and of fixed steps [2]_ cannot reach all permutations of three digits. The
    sum under a mask has the mask's bits as parities, which makes them independent. The rotations and the
    order of the steps were searched for uniform permutations of four digits.

    References
    ----------
    .. [1] S. Laine, T. Karras, "Stratified Sampling for Stochastic Transparency", 2011.
    .. [2] N. Vegdahl, "Building a Better LK Hash", 2021.
    """

    def rotated(count: int) -> Array:
        return (seed << count) | (seed >> (32 - count))

    word = ((reversed_bits ^ rotated(1)) + rotated(5)) * (rotated(17) | _word(1))
    word = _masked_sum(word, rotated(21), rotated(24))
    word = _masked_sum(word, rotated(12), rotated(8))
    word = word ^ (word * (rotated(29) & _word(0xFFFFFFFE)))
    return _masked_sum(word * (rotated(1) | _word(1)), rotated(4), rotated(17))


def to_unit(bits: Array, dtype: DTypeLike = jnp.float32) -> Array:
    """Convert fixed-point fractions to floats in [0, 1), rounding down.

    Rounding down keeps every point in its elementary interval and never gives 1, unlike rounding to nearest
    for fractions of ``0xffffff80`` and above.

    ``dtype``: float32, which keeps the upper 24 bits, or float64, which does not need ``jax_enable_x64``.

    Examples
    --------
    >>> print(to_unit(jnp.uint32(0x80000000)), to_unit(jnp.uint32(0xFFFFFFFF)) < 1)
    0.5 True
    """
    if dtype == jnp.float32:
        # 24 bits fit a signed word, which CPUs convert faster than an unsigned one.
        return (bits >> 8).astype(jnp.int32).astype(jnp.float32) * np.float32(2.0**-24)
    if dtype == jnp.float64:
        with jax.enable_x64(True):
            return jnp.asarray(bits).astype(jnp.float64) * np.float64(2.0**-32)
    raise ValueError(f"dtype must be float32 or float64, got {dtype!r}")

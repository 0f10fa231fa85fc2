"""Maps shared by all points: digital shifts, rotations, permutations of digits, and Matousek's matrices."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from qmcjax.core import checks, draws
from qmcjax.core.bits import reverse
from qmcjax.core.digits import base_of, cell_fraction, digit_spans, joined, permuted_spans, table_starts, word
from qmcjax.core.draws import fractions_or_key, plus_modulo_1
from qmcjax.core.jax_internals import alike
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.digital import Digital
from qmcjax.sequences._digital.halton import random_tables
from qmcjax.sequences._protocol.base import DigitSequence, PointByPoint, Sequence, with_digits
from qmcjax.sequences._protocol.binary import BinarySequence, Dims, as_binary
from qmcjax.sequences._protocol.plug_in import SequenceLike, as_sequence
from qmcjax.sequences._scrambling.mapped import Mapped, ScrambledDigits, of_dims


@frozen_pytree
class Flips:
    """Flips of digits by one word per coordinate."""

    shifts: Array
    """uint32 (dims,): fractions, the flip of the first digit in bit 31."""

    called = "digital_shift"

    def word(self, word: Array, dims: Dims) -> Array:
        return word ^ of_dims(self.shifts, dims, word)

    inverse = word

    def bit_reversed(self, bits: Array, dims: Dims) -> Array:
        return bits ^ reverse(of_dims(self.shifts, dims, bits))


def digital_shift(sequence: BinarySequence, key: Array | int) -> Mapped:
    """Shift a sequence in base 2 digitally: add a random vector over F2, without carries.

    Every (t,m,s)-net remains a (t,m,s)-net, each point is uniform in the unit cube, and the coordinates are
    shifted independently. The exclusive or of two points does not change.

    Parameters
    ----------
    sequence : BinarySequence, with ``bits``
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4, "Scrambling".

    Examples
    --------
    >>> from qmcjax import sequences
    >>> bits = digital_shift(sequences.sobol(1), key=1).bits(jnp.arange(2, dtype=jnp.uint32))
    >>> print(bits[0] ^ bits[1])
    [2147483648]
    """
    sequence = as_binary("sequence", sequence)
    return Mapped(sequence, Flips(draws.bits(checks.prng_key("key", key), (sequence.dims,), jnp.uint32)))


@frozen_pytree
class Offsets:
    """Addition of one fraction per coordinate, modulo 1, in wrapping integer arithmetic."""

    offsets: Array
    """uint32 (dims,): fractions."""

    called = "rotate"

    def word(self, word: Array, dims: Dims) -> Array:
        return word + of_dims(self.offsets, dims, word)


@frozen_pytree
class Rotated(PointByPoint):
    """Any sequence plus one fraction per coordinate, modulo 1, rounded once in float64."""

    sequence: Sequence
    offsets: Array
    """uint32 (dims,): fractions."""

    called = "rotate"

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        return self.sequence.rotated_coordinate(index, dim, self.offsets[dim], dtype)

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        with jax.enable_x64(True):
            values = self.sequence.coordinates(index, dims, jnp.float64)
            return plus_modulo_1(values, of_dims(self.offsets, dims, values), dtype)


def rotate(
    sequence: SequenceLike, offset_or_key: ArrayLike | None = None, *, key: Array | int | None = None
) -> Mapped | Rotated:
    """Shift all points of a sequence by one vector on the torus: the Cranley-Patterson rotation.

    This preserves toroidal distances, but not elementary intervals: if those matter, use
    :func:`digital_shift` or :func:`owen`.

    Parameters
    ----------
    sequence : Sequence
        In base 2 the sum is exact. For other sequences it is computed in float64 and rounded once, but never
        to 1.
    offset_or_key : float or uint32 ArrayLike, shape (dims,); or jax.random.key, or int in [0, 2**32)
        Floats in [0, 1), rounded down to 32-bit fractions, or these fractions. A key draws them at random. A
        new offset or key does not recompile.
    key : jax.random.key, or int in [0, 2**32), instead of ``offset_or_key``

    Returns
    -------
    Mapped or Rotated
        The first if ``sequence`` has exact ``bits``; it has them, too.

    References
    ----------
    .. [1] R. Cranley, T. N. L. Patterson, "Randomization of Number Theoretic Methods for Multiple
       Integration", SIAM J. Numer. Anal. 13, 1976.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.5.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> print(rotate(sequences.sobol(2), [0.75, 0.5]).points(2))
    [[0.75 0.5 ]
     [0.25 0.  ]]
    """
    sequence = as_sequence("sequence", sequence)
    if (offset_or_key is None) == (key is None):
        given = "neither" if key is None else "both"
        raise TypeError(f"either offset_or_key or key must be given, got {given}")
    if key is None:
        offsets = fractions_or_key("offset_or_key", offset_or_key, (sequence.dims,))
    else:
        offsets = draws.bits(checks.prng_key("key", key), (sequence.dims,), jnp.uint32)
    if isinstance(sequence, BinarySequence):
        return Mapped(sequence, Offsets(offsets))
    return Rotated(sequence, offsets)


@frozen_pytree
class PermutedDigits(ScrambledDigits):
    """A sequence with one permutation per digit, also of the zeros after the last digit."""

    tables: Array
    """uint16: the concatenated reflection tables of all coordinates."""
    tails: Array
    """uint32 (dims,): the image of the zeros, as a fraction in base 2."""

    called = "digit_scramble"

    def _scrambled(self, index: Array, dims: np.ndarray | Array, dtype: DTypeLike) -> Array:
        base = base_of(self.sequence.bases, dims)
        start = jnp.asarray(word(table_starts(self.sequence.bases)))[dims]
        numbers = permuted_spans(self.sequence.spans(index, dims), base, self.tables, start)
        leading, last = joined(numbers, base)
        return cell_fraction(leading, last, self.tails[dims], base, dtype, digit_spans(base)[-1])


def digit_scramble(sequence: BinarySequence | DigitSequence, key: Array | int) -> Mapped | PermutedDigits:
    """Permute the digits of a sequence by one uniform random permutation per digit and coordinate.

    This permutes elementary intervals: every (t,m,s)-net remains a (t,m,s)-net, and the stratification of the
    Halton sequence is preserved. Each point is uniform in the unit cube, and the coordinates are scrambled
    independently. But all points share the permutations: the difference of two points after their common
    digits is not random enough for the variances of :func:`owen`.

    Parameters
    ----------
    sequence : sequence in base 2, or Halton, Faure or van der Corput sequence
        In base 2 the permutations are the identity and the flip: the result equals that of
        :func:`digital_shift` with the same key.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Mapped or PermutedDigits
        The first in base 2, with exact ``bits``. In other bases all K = ``digit_count(b)`` digits of an index
        are permuted, and the infinitely many zeros after them become one random number per coordinate. Values
        are rounded as by :func:`owen`.

    References
    ----------
    .. [1] J. Matousek, "On the L2-discrepancy for anchored boxes", J. Complexity 14, 1998.
    .. [2] A. B. Owen, "A randomized Halton algorithm in R", 2017.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = digit_scramble(sequences.halton(2), key=1).points(3)
    >>> print(sorted((points[:, 1] * 3).astype(int).tolist()))
    [0, 1, 2]
    >>> sobol = sequences.sobol(2)
    >>> print(digit_scramble(sobol, key=1) == sequences.digital_shift(sobol, key=1))
    True
    """
    if isinstance(sequence, BinarySequence):
        return digital_shift(sequence, key)
    sequence = with_digits("sequence", sequence)
    bases = sequence.bases
    tables_key, tails_key = draws.split(checks.prng_key("key", key))
    tails = draws.bits(tails_key, (len(bases),), jnp.uint32)
    return PermutedDigits(sequence, random_tables(bases, tables_key), tails)


@frozen_pytree
class LinearMatrix:
    """The product of the digits with one matrix per coordinate."""

    columns: Array
    """uint32 (dims, 32): column k of L_j, its first row in bit 0; lower unit-triangular."""

    called = "linear_matrix_scramble"
    linear = True

    def bit_reversed(self, bits: Array, dims: Dims) -> Array:
        return _product(of_dims(self.columns, dims, bits), bits)


@jax.jit
def _product(columns: Array, reversed_bits: Array) -> Array:
    """Xor the columns that the digits select: (..., 32), (...) -> (...)."""

    def add(k: Array, product: Array) -> Array:
        digit = (reversed_bits >> k) & np.uint32(1)
        column = jax.lax.dynamic_index_in_dim(columns, k, axis=-1, keepdims=False)
        # 0 - 1 wraps to all ones: a mask.
        return product ^ ((np.uint32(0) - digit) & column)

    zeros, _ = alike((jnp.zeros_like(reversed_bits), columns))
    return jax.lax.fori_loop(np.uint32(0), np.uint32(32), add, zeros)


def _triangular(key: Array, dims: int) -> Array:
    """Draw lower unit-triangular matrices as bit-reversed columns: column k has bit k, random bits above."""
    coins = draws.bits(key, (dims, 32), jnp.uint32)
    unit = np.uint32(1) << np.arange(32, dtype=np.uint32)
    above = ~((unit - np.uint32(1)) | unit)
    return (coins & above[None, :]) | unit[None, :]


def linear_matrix_scramble(sequence: BinarySequence, key: Array | int) -> Mapped:
    """Scramble a sequence in base 2 linearly: random lower triangular matrices and a digital shift.

    Digit ``k`` is flipped by a random linear function of the digits before it and a random bit. This is a
    nested permutation, so every (t,m,s)-net remains a (t,m,s)-net. Each point is uniform in the unit cube,
    the coordinates are scrambled independently, and means of square integrable functions have the same
    variance as with Owen scrambling, with far fewer random numbers.

    Parameters
    ----------
    sequence : BinarySequence
        With ``bits``. For a :class:`Digital` sequence the generator matrices are multiplied, at no cost per
        point.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Mapped, the digital shift of the linearly scrambled sequence

    References
    ----------
    .. [1] J. Matousek, "On the L2-discrepancy for anchored boxes", J. Complexity 14, 1998.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = linear_matrix_scramble(sequences.sobol(2), key=1).points(4)
    >>> print(sorted((points[:, 1] * 4).astype(int).tolist()))
    [0, 1, 2, 3]
    """
    sequence = as_binary("sequence", sequence)
    matrices_key, shift_key = draws.split(checks.prng_key("key", key))
    columns = _triangular(matrices_key, sequence.dims)
    if isinstance(sequence, Digital):
        return digital_shift(
            Digital(reverse(_product(columns[:, None], reverse(sequence.matrices)))), shift_key
        )
    return digital_shift(Mapped(sequence, LinearMatrix(columns)), shift_key)

"""Digit scrambling: a random permutation for each digit of each coordinate, whatever comes before."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.digits import base_of, cell_fraction, digit_spans, word
from qmcjax.core.permuted_digits import joined, permuted_spans, table_starts
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._halton.digit_permutations import random_tables
from qmcjax.sequences._protocol.binary import BinarySequence
from qmcjax.sequences._protocol.digit_sequence import DigitSequence, with_digits
from qmcjax.sequences._scrambling.digital_shift import DigitalShift, digital_shift
from qmcjax.sequences._scrambling.scrambled_digits import ScrambledDigits


@pytree
@dataclass(frozen=True, eq=False, repr=False)
class PermutedDigits(ScrambledDigits):
    """A sequence whose digits go through permutations, one a digit, and so do the zeros behind them."""

    sequence: DigitSequence
    tables: Array
    """uint16: the reflection tables of all coordinates, one after the other."""
    tails: Array
    """uint32 (dims,): what becomes of the zeros, as a fraction in base 2."""

    called = "digit_scramble"

    def _scrambled(self, index: Array, dims: np.ndarray | Array, dtype: DTypeLike) -> Array:
        base = base_of(self.sequence.bases, dims)
        start = jnp.asarray(word(table_starts(self.sequence.bases)))[dims]
        numbers = permuted_spans(self.sequence.spans(index, dims), base, self.tables, start)
        leading, last = joined(numbers, base)
        return cell_fraction(leading, last, self.tails[dims], base, dtype, digit_spans(base)[-1])


def digit_scramble(
    sequence: BinarySequence | DigitSequence, key: Array | int
) -> DigitalShift | PermutedDigits:
    """Permute the digits of a sequence, by one uniform random permutation a digit and coordinate.

    Elementary intervals are permuted: every (t,m,s)-net stays one, and so does the Halton sequence's
    stratification. Each point is uniform on the unit cube, the coordinates are scrambled independently.
    But a permutation is the same for all points: how two points differ behind their common digits is not
    random enough for the variances of :func:`owen`.

    Parameters
    ----------
    sequence : sequence in base 2, or Halton, Faure or van der Corput sequence
        Of the two permutations of {0, 1} one is the identity and one the flip: in base 2 this is the
        digital shift, the very object that :func:`digital_shift` makes from the same key.
    key : jax.random.key, or int in [0, 2**32)
        A new key gives a new scrambling and compiles nothing anew.

    Returns
    -------
    DigitalShift or PermutedDigits
        The first in base 2, with exact ``bits``. In other bases all K = ``digit_count(b)`` digits of
        an index are permuted, and the infinitely many zeros behind become one random number a coordinate.
        Values are rounded as by :func:`owen`.

    Raises
    ------
    TypeError
        If ``sequence`` has no digits or ``key`` is no key.

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
    >>> print(digit_scramble(sobol, key=1).shifts == sequences.digital_shift(sobol, key=1).shifts)
    [ True  True]
    """
    if isinstance(sequence, BinarySequence):
        return digital_shift(sequence, key)
    sequence = with_digits("sequence", sequence)
    bases = sequence.bases
    tables_key, tails_key = jax.random.split(checks.prng_key("key", key))
    tails = jax.random.bits(tails_key, (len(bases),), jnp.uint32)
    return PermutedDigits(sequence, random_tables(bases, tables_key), tails)

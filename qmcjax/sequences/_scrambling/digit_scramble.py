"""Digit scrambling: a random permutation for each digit of each coordinate."""

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, draws
from qmcjax.core.digits import base_of, cell_fraction, digit_spans, word
from qmcjax.core.permuted_digits import joined, permuted_spans, table_starts
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._halton.digit_permutations import random_tables
from qmcjax.sequences._protocol.binary import BinarySequence
from qmcjax.sequences._protocol.digit_sequence import DigitSequence, with_digits
from qmcjax.sequences._scrambling.digital_shift import DigitalShift, digital_shift
from qmcjax.sequences._scrambling.scrambled import ScrambledDigits


@frozen_pytree
class PermutedDigits(ScrambledDigits):
    """A sequence with one permutation per digit, also of the zeros after the last digit."""

    tables: Array
    """uint16: the reflection tables of all coordinates, one after the other."""
    tails: Array
    """uint32 (dims,): the image of the zeros, as a fraction in base 2."""

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
    """Permute the digits of a sequence, by one uniform random permutation per digit and coordinate.

    Elementary intervals are permuted: every (t,m,s)-net stays one, and so does the stratification of the
    Halton sequence. Each point is uniform on the unit cube, the coordinates are scrambled independently. But
    the permutations are the same for all points: the difference of two points after their common digits is
    not random enough for the variances of :func:`owen`.

    Parameters
    ----------
    sequence : sequence in base 2, or Halton, Faure or van der Corput sequence
        In base 2 the permutations are the identity and the flip: this is the same object as from
        :func:`digital_shift` with the same key.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    DigitalShift or PermutedDigits
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
    >>> print(digit_scramble(sobol, key=1).shifts == sequences.digital_shift(sobol, key=1).shifts)
    [ True  True]
    """
    if isinstance(sequence, BinarySequence):
        return digital_shift(sequence, key)
    sequence = with_digits("sequence", sequence)
    bases = sequence.bases
    tables_key, tails_key = draws.split(checks.prng_key("key", key))
    tails = draws.bits(tails_key, (len(bases),), jnp.uint32)
    return PermutedDigits(sequence, random_tables(bases, tables_key), tails)

"""Owen scrambling by hashing, in base 2; for other bases see ``owen_base_b``."""

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import owen_hash
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.binary import BinarySequence
from qmcjax.sequences._protocol.digit_sequence import DigitSequence, with_digits
from qmcjax.sequences._protocol.fraction import Fraction
from qmcjax.sequences._scrambling.owen_base_b import OwenDigits, owen_digits
from qmcjax.sequences._scrambling.scrambled import Scrambled, of_dims


@frozen_pytree
class Owen(Scrambled):
    """A sequence with a nested random permutation of each coordinate."""

    seeds: Array
    """uint32 (dims,)."""

    called = "owen"

    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return fraction.mapped(bit_reversed=lambda bits: owen_hash(bits, of_dims(self.seeds, dims, bits)))


def owen(sequence: BinarySequence | DigitSequence, key: Array | int) -> Owen | OwenDigits:
    """Owen-scramble a sequence by a hash with the nested structure.

    Every (t,m,s)-net stays one, and so does the stratification of the Halton sequence. Each point is uniform
    on the unit cube, and the coordinates are scrambled independently.

    Parameters
    ----------
    sequence : sequence in base 2, or Halton, Faure or van der Corput sequence
        Digits are scrambled in their base.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Owen or OwenDigits
        The first in base 2, with exact ``bits``. In other bases the zeros after the digits of an index are
        scrambled as well, down to the resolution of float64. Values of float64 are rounded to nearest and lie
        in the elementary intervals of the scrambled digits. Values of float32 are these, rounded down, except
        where that would leave an interval of length b**-k > 2**-24.

    Notes
    -----
    In base 2, the hash is nearly, but not exactly, uniform over all nested permutations. Tests over many
    keys, which common hashes of this kind fail, find no bias of a digit's flip, no empty interval, no
    dependence between the flips at any two or three nodes, nor between two points after the digit where they
    part, and all permutations of any four consecutive digits. Parities of many flips are not uniform: of four
    digits after the first, the parity of all twelve flips of the last two is even with probability 0.44 or
    0.56 instead of 0.5, and other parities deviate less. A seed has 32 bits: only few permutations of five or
    more digits occur. Where that matters, use :func:`owen_exact`.

    In base b, any two points are distributed as after nested uniform scrambling, up to the quality of a
    32-bit hash, so variances of means are the same [3]_. Three or more points are not: the permutations at
    all nodes of a coordinate come from one random table of nested permutations of several digits, by shifts
    of its argument. Where that matters, use :func:`owen_exact`. This is not a linear scrambling, where
    factors depend only on the place of a digit; the base may be composite.

    References
    ----------
    .. [1] A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1, "Full Owen-Scrambling".
    .. [3] A. B. Owen, "Variance with alternative scramblings of digital nets", 2003.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = sequences.owen(sequences.sobol(2), key=1).points(4)
    >>> print(sorted((points[:, 0] * 4).astype(int).tolist()))
    [0, 1, 2, 3]
    >>> points = sequences.owen(sequences.halton(2), key=1).points(9)
    >>> print(sorted((points[:, 1] * 9).astype(int).tolist()))
    [0, 1, 2, 3, 4, 5, 6, 7, 8]
    """
    if not isinstance(sequence, BinarySequence):
        return owen_digits(with_digits("sequence", sequence), checks.prng_key("key", key))
    seeds = draws.bits(checks.prng_key("key", key), (sequence.dims,), jnp.uint32)
    return Owen(sequence, seeds)

"""The digital shift: every coordinate xor a random word."""

from typing import Any

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.cells import Flipped
from qmcjax.sequences._protocol.binary import BinarySequence, as_binary
from qmcjax.sequences._protocol.fraction import Fraction
from qmcjax.sequences._scrambling.scrambled import Scrambled, of_dims


@frozen_pytree
class DigitalShift(Scrambled):
    """A sequence with digits flipped by one word per coordinate."""

    shifts: Array
    """uint32 (dims,): fractions, the flip of the first digit in bit 31."""

    called = "digital_shift"

    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return fraction.mapped(
            lambda word: word ^ of_dims(self.shifts, dims, word),
            lambda bits: bits ^ reverse(of_dims(self.shifts, dims, bits)),
        )

    def inverted(self, log_side: int) -> Any:
        """Return an object that finds points from their cells, which the shift permutes."""
        return Flipped(self.sequence.inverted(log_side), self.shifts)


def digital_shift(sequence: BinarySequence, key: Array | int) -> DigitalShift:
    """Shift a sequence in base 2 digitally: add a random vector over F2, without carries.

    Every (t,m,s)-net stays one, each point is uniform on the unit cube, and the coordinates are
    shifted independently; two points keep the exclusive or of their digits.

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
    return DigitalShift(sequence, draws.bits(checks.prng_key("key", key), (sequence.dims,), jnp.uint32))

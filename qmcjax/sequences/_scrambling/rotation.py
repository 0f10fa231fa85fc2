"""The Cranley-Patterson rotation: a shift on the torus."""

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from qmcjax.core.fractions import fractions_or_key, plus_modulo_1
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import PointByPoint, Sequence
from qmcjax.sequences._protocol.binary import BinarySequence
from qmcjax.sequences._protocol.fraction import Fraction
from qmcjax.sequences._protocol.plug_in import as_sequence
from qmcjax.sequences._scrambling.scrambled import Scrambled, of_dims


@frozen_pytree
class RotatedBinary(Scrambled):
    """A sequence in base 2 plus one fraction per coordinate, modulo 1: sums of integers that wrap."""

    offsets: Array
    """uint32 (dims,): fractions."""

    called = "rotate"

    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return fraction.mapped(lambda word: word + of_dims(self.offsets, dims, word))


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


def rotate(sequence: Sequence, offset_or_key: ArrayLike) -> RotatedBinary | Rotated:
    """Shift all points of a sequence by one vector on the torus: the Cranley-Patterson rotation.

    Toroidal distances are preserved, elementary intervals are not: where these matter, use
    :func:`digital_shift` or :func:`owen`.

    Parameters
    ----------
    sequence : Sequence
        In base 2 the sum is exact. For any other sequence it is computed in float64 and rounded once, but
        never to 1.
    offset_or_key : float or uint32 ArrayLike, shape (dims,); or jax.random.key, or int in [0, 2**32)
        Floats in [0, 1), rounded down to 32-bit fractions; or these fractions. A key draws them at random. A
        new offset or key does not recompile.

    Returns
    -------
    RotatedBinary or Rotated
        The first has exact ``bits``, if ``sequence`` has.

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
    offsets = fractions_or_key("offset_or_key", offset_or_key, (sequence.dims,))
    if isinstance(sequence, BinarySequence):
        return RotatedBinary(sequence, offsets)
    return Rotated(sequence, offsets)

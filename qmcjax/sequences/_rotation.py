"""The Cranley-Patterson rotation: a shift on the torus."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike, DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import reverse
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._base import BinarySequence, PointByPoint, Sequence
from qmcjax.sequences._scrambled import Scrambled, along_last

_BELOW_ONE = {np.dtype(np.float32): 1 - 2.0**-24, np.dtype(np.float64): 1 - 2.0**-53}


@pytree
@dataclass(frozen=True)
class RotatedBinary(Scrambled):
    """A sequence in base 2 plus one fraction a coordinate, modulo 1: sums of integers that wrap."""

    sequence: BinarySequence
    offsets: Array
    """uint32 (dims,): fractions."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        return reverse(self.word(index, dim))

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        return self.sequence.word(index, dim) + self.offsets[dim]

    def _bit_reversed(self, index: Array, dims: tuple[int, ...]) -> Array:
        return reverse(self._words(index, dims))

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self.sequence._words(index, dims) + along_last(self.offsets, dims, index)


@pytree
@dataclass(frozen=True)
class Rotated(PointByPoint):
    """Any sequence plus one fraction a coordinate, modulo 1, rounded once in float64."""

    sequence: Sequence
    offsets: Array
    """uint32 (dims,): fractions."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.sequence.dims

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices, in their shape."""
        with jax.enable_x64(True):
            value = self.sequence.coordinate(index, dim, jnp.float64)
            return wrapped(value, self.offsets[dim], dtype)

    def _values(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        with jax.enable_x64(True):
            values = self.sequence._values(index, dims, jnp.float64)
            return wrapped(values, along_last(self.offsets, dims, index), dtype)


def wrapped(value: Array, offset: Array, dtype: DTypeLike) -> Array:
    """Return value + offset modulo 1; the comparison and the complement of the offset are exact."""
    fraction = offset.astype(jnp.float64) * np.float64(2.0**-32)
    complement = np.float64(1) - fraction
    total = jnp.where(value < complement, value + fraction, value - complement).astype(dtype)
    return jnp.minimum(total, jnp.asarray(_BELOW_ONE[np.dtype(dtype)], dtype))


def rotate(sequence: Sequence, offset: ArrayLike) -> RotatedBinary | Rotated:
    """Shift a sequence on the torus, the same way for all its points.

    Toroidal distances stay as they are, elementary intervals do not: where these matter, take
    :func:`digital_shift` or :func:`owen`.

    Parameters
    ----------
    sequence : Sequence
        In base 2 the sum is one of integers and exact. Any other sequence is added to in float64
        and rounded once, but never to 1.
    offset : float or uint32 ArrayLike, shape (dims,)
        Floats in [0, 1), rounded down to 32-bit fractions; or these fractions. A new offset
        compiles nothing anew.

    Returns
    -------
    RotatedBinary or Rotated
        The first has exact ``bits``, if ``sequence`` has.

    Raises
    ------
    ValueError
        If ``sequence`` is none, or ``offset`` has another shape or dtype or leaves [0, 1).

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
    if not isinstance(sequence, Sequence):
        raise ValueError(f"sequence must be a Sequence, got {sequence!r}")
    offsets = _fractions(offset, sequence.dims)
    if isinstance(sequence, BinarySequence):
        return RotatedBinary(sequence, offsets)
    return Rotated(sequence, offsets)


def _fractions(offset: ArrayLike, dims: int) -> Array:
    """Return 32-bit fractions, rounded down: products with 2**32 are exact in either precision."""
    array = offset if isinstance(offset, Tracer) else np.asarray(offset)
    if array.dtype not in (np.float32, np.float64, np.uint32) or array.shape != (dims,):
        raise ValueError(
            f"offset must be floats in [0, 1) or uint32 fractions of shape ({dims},), "
            f"got {array.dtype} {array.shape}"
        )
    if array.dtype == np.uint32:
        return jnp.asarray(array)
    if not isinstance(array, Tracer):
        outside = ~((array >= 0) & (array < 1))
        if outside.any():
            raise ValueError(
                f"offset must be in [0, 1), got {float(array[outside][0])!r} in {array.tolist()}"
            )
    with checks.precision(array.dtype):
        return (jnp.asarray(array) * jnp.asarray(2.0**32, array.dtype)).astype(jnp.uint32)

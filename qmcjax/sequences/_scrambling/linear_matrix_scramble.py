"""Linear scrambling: the digits of every coordinate times a random triangular matrix over F2."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import reverse
from qmcjax.core.jax_internals import alike
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.digital import Digital
from qmcjax.sequences._protocol.binary import BinarySequence, Fraction, as_binary
from qmcjax.sequences._scrambling.scrambled import Scrambled, of_dims
from qmcjax.sequences._scrambling.shifts import DigitalShift, digital_shift


@frozen_pytree
class Linear(Scrambled):
    """A sequence whose digits are multiplied by one matrix per coordinate."""

    columns: Array
    """uint32 (dims, 32): column k of L_j, its first row in bit 0; lower unit-triangular."""

    called = "linear_matrix_scramble"

    def mapped(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return fraction.mapped(bit_reversed=lambda bits: _product(of_dims(self.columns, dims, bits), bits))

    @property
    def linear(self) -> BinarySequence | None:
        """The sequence itself, if the underlying one is linear."""
        linear = self.sequence.linear
        return self if linear is self.sequence else linear

    def of_linear(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return fraction if self.linear is self else super().of_linear(fraction, dims)


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


def linear_matrix_scramble(sequence: BinarySequence, key: Array | int) -> DigitalShift:
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
    DigitalShift, the digital shift of the linearly scrambled sequence

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
    return digital_shift(Linear(sequence, columns), shift_key)

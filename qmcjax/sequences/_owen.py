"""Owen scrambling in base 2 by hashing."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax import checks
from qmcjax.bits import owen_hash
from qmcjax.pytrees import pytree
from qmcjax.sequences._base import BinarySequence, binary
from qmcjax.sequences._scrambled import Scrambled, along_last


@pytree
@dataclass(frozen=True)
class Owen(Scrambled):
    """A sequence whose coordinates go through nested random permutations, one each."""

    sequence: BinarySequence
    seeds: Array
    """uint32 (dims,)."""

    def mirror(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        return owen_hash(self.sequence.mirror(index, dim), self.seeds[dim])

    def _mirrors(self, index: Array, dims: tuple[int, ...]) -> Array:
        return owen_hash(self.sequence._mirrors(index, dims), along_last(self.seeds, dims, index))


def owen(sequence: BinarySequence, key: Array | int) -> Owen:
    """Owen-scramble a sequence in base 2 by a hash with the nested structure.

    Every (t,m,s)-net stays one, each point is uniform on the unit cube, and the coordinates are
    scrambled independently. The hash is close to, but not, uniform over all nested permutations.

    Parameters
    ----------
    sequence : BinarySequence
        Any sequence that has ``bits``.
    key : jax.random.key, or int in [0, 2**32)
        A new key gives a new scrambling and compiles nothing anew.

    Returns
    -------
    Owen

    Raises
    ------
    ValueError
        If ``sequence`` is not in base 2 or ``key`` is no key.

    References
    ----------
    .. [1] A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.3.1, "Full Owen-Scrambling".

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = sequences.owen(sequences.sobol(2), key=1).points(4)
    >>> print(sorted((points[:, 0] * 4).astype(int).tolist()))
    [0, 1, 2, 3]
    """
    binary("sequence", sequence)
    seeds = jax.random.bits(checks.prng_key("key", key), (sequence.dims,), jnp.uint32)
    return Owen(sequence, seeds)

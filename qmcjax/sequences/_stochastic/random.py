"""Random points at random access: uniform, and stratified on a grid."""

from dataclasses import field

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.binary import BinarySequence, WordFirst


def _draw(index: Array, seeds: Array) -> Array:
    """Return one random word per index, by a bijection selected by a pair of seeds."""
    return hash_word(hash_word(index ^ seeds[0]) + seeds[1])


@frozen_pytree
class Uniform(BinarySequence):
    """Independent uniform points: a hash of the index."""

    seeds: Array
    """uint32 (dims, 2)."""

    called = "uniform"

    @property
    def dims(self) -> int:
        return self.seeds.shape[0]

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate: a reversed random word is as random."""
        return _draw(index, self.seeds[dim])


@frozen_pytree
class Jittered(WordFirst):
    """One uniform point in each cell of a regular grid."""

    side: int = field(metadata={"static": True})
    seeds: Array
    """uint32 (dims, 2)."""

    called = "jittered"
    reported = ("side", "dims")

    @property
    def dims(self) -> int:
        return self.seeds.shape[0]

    @property
    def size(self) -> int:
        return self.side**self.dims

    def word(self, index: Array, dim: int) -> Array:
        cell = index // np.uint32(self.side**dim) % np.uint32(self.side)
        return _divided(cell, _draw(index, self.seeds[dim]), self.side)

    def points_per_cell(self, log_side: int) -> int:
        if self.dims != 2 or self.side % 2**log_side:
            raise ValueError(
                f"side must be a multiple of {2**log_side} and dims 2 to jitter a raster of "
                f"{2**log_side} x {2**log_side} cells, got side={self.side}, dims={self.dims}"
            )
        return (self.side >> log_side) ** 2

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of a point from its cell."""
        within = np.uint32(self.side >> log_side)
        row, column = sample // within, sample % within
        return (y * within + row) * np.uint32(self.side) + x * within + column


def _divided(cell: Array, fraction: Array, side: int) -> Array:
    """Return (cell * 2**32 + fraction) // side, in words: the upper word, then the remainders."""
    quotient, remainder = divmod(2**32, side)
    divisor = np.uint32(side)
    carried = cell * np.uint32(remainder)
    lower = (carried % divisor + fraction % divisor) // divisor
    return cell * np.uint32(quotient % 2**32) + carried // divisor + fraction // divisor + lower


def _seeds(key: Array | int, dims: int) -> Array:
    return draws.bits(checks.prng_key("key", key), (dims, 2), jnp.uint32)


def uniform(dims: int, key: Array | int) -> Uniform:
    """Make independent uniform random points, each a hash of its index.

    Parameters
    ----------
    dims : int, in [1, 65536]
    key : jax.random.key, or int in [0, 2**32)

    Returns
    -------
    Uniform
        Unbounded: within one coordinate the 2**32 values do not repeat.

    Examples
    --------
    >>> print(uniform(3, key=0).points(2).shape)
    (2, 3)
    """
    return Uniform(_seeds(key, checks.integer("dims", dims, 1, 2**16)))


def jittered(side: int, dims: int, key: Array | int) -> Jittered:
    """Make one uniform random point in each cell of a regular grid.

    Parameters
    ----------
    side : int, number of cells per side, in [1, 65536]
    dims : int, at least 1, with ``side**dims`` at most 2**32
    key : jax.random.key, or int in [0, 2**32)

    Returns
    -------
    Jittered
        ``side**dims`` points; the cell of the first coordinate varies fastest.

    References
    ----------
    .. [1] R. L. Cook, "Stochastic Sampling in Computer Graphics", 1986.

    Examples
    --------
    >>> print((jittered(2, 2, key=0).points(4) * 2).astype(int))
    [[0 0]
     [1 0]
     [0 1]
     [1 1]]
    """
    side = checks.integer("side", side, 1, 2**16)
    dims = checks.integer("dims", dims, 1, 2**16)
    if side**dims > 2**32:
        raise ValueError(f"side**dims must be at most 2**32, got side={side}, dims={dims}")
    return Jittered(side, _seeds(key, dims))

"""Random points with random access: uniform, jittered on a grid, and Latin hypercubes."""

import math
from dataclasses import field
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.binary import BinarySequence


def drawn(index: Array, seeds: Array) -> Array:
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
        """Return one coordinate: reversing a random word leaves it random."""
        return drawn(index, self.seeds[dim])


@frozen_pytree
class Jittered(BinarySequence):
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
        return _divided(cell, drawn(index, self.seeds[dim]), self.side)

    def points_per_cell(self, log_side: int) -> int:
        if self.dims != 2 or self.side % 2**log_side:
            raise ValueError(
                f"side must be a multiple of {2**log_side} and dims 2 to jitter a raster of "
                f"{2**log_side} x {2**log_side} cells, got side={self.side}, dims={self.dims}"
            )
        return (self.side >> log_side) ** 2

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
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
    """Make independent uniform random points by hashing the index.

    Parameters
    ----------
    dims : int, in [1, 65536]
    key : jax.random.key, or int in [0, 2**32)

    Returns
    -------
    Uniform
        Unbounded: the 2**32 values of one coordinate do not repeat.

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


def rounds(n: int) -> int:
    """Return the number of rotations for statistically uniform permutations."""
    return 16 if n < 1024 else 8


@frozen_pytree
class LatinHypercube(BinarySequence):
    """One uniform point in each of n equal intervals, in each coordinate."""

    n: int = field(metadata={"static": True})
    seeds: Array
    """uint32 (dims, 2 + rounds): seeds of the position within the interval, and of the permutation."""

    called = "latin_hypercube"

    @property
    def dims(self) -> int:
        return self.seeds.shape[0]

    @property
    def size(self) -> int:
        return self.n

    def word(self, index: Array, dim: int) -> Array:
        seeds = self.seeds[dim]
        jitter = drawn(index, seeds)
        stratum = permute(index, self.n, seeds[2:])
        return fraction_within(stratum, self.n, jitter)


def first_fraction(stratum: Array, n: int) -> Array:
    """Return the smallest 32-bit fraction that is not below stratum / n."""
    return ((stratum << np.uint64(32)) + np.uint64(n - 1)) // np.uint64(n)


def fraction_within(stratum: Array, n: int, part: Array) -> Array:
    """Return the 32-bit fraction at a part, itself a fraction, of one of n strata."""
    with jax.enable_x64(True):
        first = first_fraction(stratum.astype(jnp.uint64), n)
        count = first_fraction(stratum.astype(jnp.uint64) + np.uint64(1), n) - first
        return (first + (count * part.astype(jnp.uint64) >> np.uint64(32))).astype(jnp.uint32)


@partial(jax.jit, static_argnames="n")
def permute(index: Array, n: int, seeds: Array) -> Array:
    """Permute the numbers below n, with random access.

    A number is a column and a row of a grid of at least n cells. Rows and columns are alternately rotated by
    hashes of their numbers: a Feistel network with sums. A number outside the n cells is permuted again until
    it returns (cycle walking), so the map is a bijection.

    ``index``: uint32 Array, shape (...): below n. ``n``: in [1, 2**32]. ``seeds``: uint32 Array, shape
    (rounds,): an even number. Returns uint32 Array, shape (...).
    """
    columns, rows = _grid(n)

    def once(number: Array) -> Array:
        column, row = number % np.uint32(columns), number // np.uint32(columns)
        for k in range(0, seeds.shape[0], 2):
            column = (column + hash_word(row ^ seeds[k]) % np.uint32(columns)) % np.uint32(columns)
            row = (row + hash_word(column ^ seeds[k + 1]) % np.uint32(rows)) % np.uint32(rows)
        return row * np.uint32(columns) + column

    number = once(index)
    if columns * rows == n:
        return number

    def outside(number: Array) -> Array:
        return number >= np.uint32(n)

    return jax.lax.while_loop(
        lambda number: jnp.any(outside(number)),
        lambda number: jnp.where(outside(number), once(number), number),
        number,
    )


def _grid(n: int) -> tuple[int, int]:
    """Return the columns and rows of a nearly square grid of n or slightly more cells.

    A single row would only be rotated, so there are at least two if n > 2.
    """
    root = math.isqrt(n - 1) + 1
    widths = range(root, max(min(n // 2, 2 * root), root) + 1)
    columns = min(widths, key=lambda width: -(-n // width) * width)
    return columns, -(-n // columns)


def latin_hypercube(n: int, dims: int, key: Array | int) -> LatinHypercube:
    """Make a Latin hypercube sample: n points with each coordinate stratified into n equal intervals.

    Parameters
    ----------
    n : int, number of points, in [1, 2**32]
    dims : int, in [1, 65536]
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    LatinHypercube
        Stratified exactly in ``bits`` and in float64. float32 is rounded down to 24 bits, which is exact for
        powers of two up to 2**24.

    References
    ----------
    .. [1] M. D. McKay, R. J. Beckman, W. J. Conover, "A Comparison of Three Methods for Selecting
       Values of Input Variables in the Analysis of Output from a Computer Code", Technometrics 21, 1979.

    Examples
    --------
    >>> points = latin_hypercube(5, 2, key=0).points(5)
    >>> print(sorted((points[:, 1] * 5).astype(int).tolist()))
    [0, 1, 2, 3, 4]
    """
    n = checks.integer("n", n, 1, 2**32)
    dims = checks.integer("dims", dims, 1, 2**16)
    seeds = draws.bits(checks.prng_key("key", key), (dims, 2 + rounds(n)), jnp.uint32)
    return LatinHypercube(n, seeds)

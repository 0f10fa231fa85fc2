"""Correlated multi-jittered points, for any number of them."""

import math
from dataclasses import field

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.binary import BinarySequence
from qmcjax.sequences._stochastic.random import drawn, fraction_within, permute, rounds


@frozen_pytree
class MultiJitter(BinarySequence):
    """One point in each cell of a grid, in each column's substratum, and in each of n rows."""

    n: int = field(metadata={"static": True})
    jitter: Array
    """uint32 (2, 2): seeds of the places within the strata of each coordinate."""
    seeds: Array
    """uint32 (3, rounds): seeds of the permutations of the points, of columns, and of substrata."""

    called = "multi_jitter"

    @property
    def dims(self) -> int:
        return 2

    @property
    def size(self) -> int:
        return self.n

    def word(self, index: Array, dim: int) -> Array:
        columns = math.isqrt(self.n)
        rows = -(-self.n // columns)
        stratum, count = permute(index, self.n, self.seeds[0]), self.n
        if dim == 0:
            column = permute(stratum % np.uint32(columns), columns, self.seeds[1])
            row = permute(stratum // np.uint32(columns), rows, self.seeds[2])
            stratum, count = column * np.uint32(rows) + row, columns * rows
        return fraction_within(stratum, count, drawn(index, self.jitter[dim]))


def multi_jitter(n: int, key: Array | int) -> MultiJitter:
    """Make n correlated multi-jittered points in two dimensions.

    The points are jittered on a grid of ``isqrt(n)`` columns, and each coordinate is a Latin hypercube: y has
    one point in each of n strata; x has at most one in each of its strata, as many as the grid has cells. All
    columns have the same order of substrata, which keeps points apart.

    Parameters
    ----------
    n : int, number of points, in [1, 2**31]
        If the last row of the grid is not full, a few strata of x are empty.
    key : jax.random.key, or int in [0, 2**32)

    Returns
    -------
    MultiJitter
        In random order: each point is uniform over keys. Its first points are not stratified.

    References
    ----------
    .. [1] A. Kensler, "Correlated Multi-Jittered Sampling", Pixar Technical Memo 13-01, 2013.

    Examples
    --------
    >>> points = multi_jitter(6, key=1).points(6)
    >>> print(sorted((points[:, 1] * 6).astype(int).tolist()))
    [0, 1, 2, 3, 4, 5]
    """
    n = checks.integer("n", n, 1, 2**31)
    words = draws.bits(checks.prng_key("key", key), (4 + 3 * rounds(n),), jnp.uint32)
    return MultiJitter(n, words[:4].reshape(2, 2), words[4:].reshape(3, -1))

"""A sampler's coordinates in pairs, padded with more pairs on demand."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.bits import hash_pair, owen_hash, reverse
from qmcjax.samplers import as_sampler, independent
from qmcjax.sequences import sobol

_TOGETHER = 4
"""Number of the sampler's pairs that one program computes."""


class PaddedPairs:
    """Pairs of coordinates (2 k, 2 k + 1): the sampler's, followed by padding.

    A padding pair has the first points of the Sobol' sequence, Owen-scrambled with one key per pixel and
    pair, in an order shuffled per pixel: otherwise the same half of all pairs would contain the same samples
    [1]_. An odd last coordinate of the sampler is left out.

    References
    ----------
    .. [1] T. Kollig, A. Keller, "Efficient Multidimensional Sampling", 2002, Sect. 3.
    """

    def __init__(self, sampler: Any, key: Any) -> None:
        self.sampler = as_sampler("sampler", sampler)
        if self.sampler.dims < 2:
            raise ValueError(
                f"sampler must have at least the two coordinates of a pixel, got {self.sampler.dims}"
            )
        self.key = checks.prng_key("key", key)

    def group(self, pair: int) -> tuple[int, int]:
        """Return the first pair of the group that is computed with a given pair, and the group's size."""
        own = self.sampler.dims // 2
        if pair >= own:
            return pair, 1
        first = pair - pair % _TOGETHER
        return first, min(_TOGETHER, own - first)

    def coordinates(self, pairs: tuple[int, int], x: Array, y: Array, sample: Array) -> NDArray[np.float32]:
        """Return the coordinates of a group of pairs, shape (2 * count, samples)."""
        first, count = pairs
        if first >= self.sampler.dims // 2:
            return np.asarray(_padding(self.key, np.uint32(first), x, y, sample))
        dims = tuple(range(2 * first, 2 * (first + count)))
        values = np.asarray(_of_sampler(self.sampler, x, y, sample, dims))
        if not np.all((values >= 0) & (values < 1)):
            at = int(np.argmin(((values >= 0) & (values < 1)).all(axis=0)))
            raise ValueError(
                f"sampler must return points in [0, 1), got {values[:, at].tolist()} in pixel "
                f"({int(x[at])}, {int(y[at])}), sample {int(sample[at])}"
            )
        return values


@partial(jax.jit, static_argnames="dims")
def _of_sampler(sampler: Any, x: Array, y: Array, sample: Array, dims: tuple[int, ...]) -> Array:
    return jnp.moveaxis(sampler(x, y, sample, dims, jnp.float32), -1, 0)


@jax.jit
def _padding(key: Array, pair: Array, x: Array, y: Array, sample: Array) -> Array:
    of_points, of_numbers = jax.random.split(jax.random.fold_in(key, pair))
    seed = pixel_seeds(of_numbers, x, y)
    # Nested from the highest bit on: aligned blocks of 2**k numbers stay together, and so do (0,k,2)-nets.
    number = reverse(owen_hash(reverse(sample), seed))
    points = independent(sobol(2), of_points)(x, y, number, (0, 1), jnp.float32)
    return jnp.moveaxis(points, -1, 0)


def pixel_seeds(key: Array, x: Array, y: Array) -> Array:
    """Return one random word per pixel."""
    words = jax.random.bits(key, (2,), jnp.uint32)
    return hash_pair(x ^ words[0], y ^ words[1])

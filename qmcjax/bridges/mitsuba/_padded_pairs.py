"""A sampler's coordinates in pairs, padded with more pairs on demand."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.bridges._padding import padding_pair, padding_pixel
from qmcjax.core import draws
from qmcjax.samplers import Sampler

_TOGETHER = 4
"""Number of the sampler's pairs that one program computes."""


class PaddedPairs:
    """Pairs of coordinates (2 k, 2 k + 1): the sampler's, followed by padding.

    An odd last coordinate of the sampler is left out.
    """

    def __init__(self, sampler: Sampler, key: Any) -> None:
        self.sampler = sampler
        self.words = draws.bits(key, (2,), jnp.uint32)

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
            return np.asarray(_padding(self.words, np.uint32(first), x, y, sample))
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
def _padding(words: Array, pair: Array, x: Array, y: Array, sample: Array) -> Array:
    return jnp.moveaxis(padding_pair(padding_pixel(words, x, y), pair, sample), -1, 0)

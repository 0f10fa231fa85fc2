"""Pairs of coordinates beyond those of a sampler: one rule for all bridges."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import draws
from qmcjax.core.bits import hash_pair, hash_word, owen_hash, pascal, reverse, to_unit
from qmcjax.samplers import Sampler

_STEPS = [np.uint32(k * 0x9E3779B9 % 2**32) for k in range(3)]


def padding_pixel(words: Array, x: Array, y: Array) -> Array:
    """Return the random word shared by all padded pairs of a pixel; two ``words`` are the key."""
    return hash_pair(x ^ words[0], y ^ words[1])


def padding_pair(pixel: Array, pair: Array, sample: Array) -> Array:
    """Return one pair of coordinates of samples of some pixels.

    A pair has the first points of the two-dimensional Sobol' sequence, Owen-scrambled with one key per pixel
    and pair. Their order is shuffled per pixel and pair as well: otherwise the same half of all pairs would
    contain the same samples [1]_. The shuffle is nested, so aligned blocks of 2**k samples remain
    (0,k,2)-nets.

    ``pixel`` is from :func:`padding_pixel`, and ``pair`` the number of the pair. Returns float32, shape
    (..., 2), in [0, 1).

    References
    ----------
    .. [1] T. Kollig, A. Keller, "Efficient Multidimensional Sampling", 2002, Sect. 3.
    """
    key = hash_pair(pixel, pair)
    of_number, of_first, of_second = (hash_word(key + step) for step in _STEPS)
    number = reverse(owen_hash(reverse(sample), of_number))
    first, second = owen_hash(number, of_first), owen_hash(pascal(number), of_second)
    return jnp.stack([to_unit(reverse(first)), to_unit(reverse(second))], axis=-1)


_TOGETHER = 4
"""Number of the sampler's pairs that one program computes."""


class PaddedPairs:
    """Pairs of coordinates (2 k, 2 k + 1): the sampler's, followed by padding.

    An odd last coordinate of the sampler is omitted.
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

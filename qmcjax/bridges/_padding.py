"""Pairs of coordinates beyond those of a sampler: one rule for all bridges."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import hash_pair, hash_word, owen_hash, pascal, reverse, to_unit

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


class Padding(NamedTuple):
    """Pairs from a number on, like a sampler: of the same key, two ``words``, as those of other numbers."""

    words: Array
    first: Array

    def __call__(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return coordinates for x, y and sample of three axes each; ``dims`` are a number of pairs."""
        pairs = self.first + jnp.arange(len(dims) // 2, dtype=jnp.uint32).reshape(1, 1, 1, -1)
        found = padding_pair(padding_pixel(self.words, x, y)[..., None], pairs, sample[..., None])
        return found.reshape(*found.shape[:3], len(dims)).astype(dtype)

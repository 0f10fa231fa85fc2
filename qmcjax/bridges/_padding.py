"""Pairs of coordinates beyond a sampler's: one rule for all bridges."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.bits import hash_pair, hash_word, owen_hash, pascal, reverse, to_unit

_STEPS = [np.uint32(k * 0x9E3779B9 % 2**32) for k in range(3)]


def padding_pixel(words: Array, x: Array, y: Array) -> Array:
    """Return what all padded pairs of a pixel share: one random word.

    ``words``: uint32 Array, shape (2,): a random key. ``x``, ``y``: uint32 Array, shape (...). Returns uint32
    Array, shape (...).
    """
    return hash_pair(x ^ words[0], y ^ words[1])


def padding_pair(pixel: Array, pair: Array, sample: Array) -> Array:
    """Return one pair of coordinates of samples of some pixels.

    A pair has the first points of the two-dimensional Sobol' sequence, Owen-scrambled with one key per pixel
    and pair. Their order is shuffled per pixel and pair as well: otherwise the same half of all pairs would
    contain the same samples [1]_. The shuffle is nested, so aligned blocks of 2**k samples stay (0,k,2)-nets.

    ``pixel``: uint32 Array, shape (...), from :func:`padding_pixel`. ``pair``: uint32 Array, the number of
    the pair: it may vary. ``sample``: uint32 Array. Returns float32 Array, shape (..., 2), in [0, 1).

    References
    ----------
    .. [1] T. Kollig, A. Keller, "Efficient Multidimensional Sampling", 2002, Sect. 3.
    """
    key = hash_pair(pixel, pair)
    of_number, of_first, of_second = (hash_word(key + step) for step in _STEPS)
    number = reverse(owen_hash(reverse(sample), of_number))
    first, second = owen_hash(number, of_first), owen_hash(pascal(number), of_second)
    return jnp.stack([to_unit(reverse(first)), to_unit(reverse(second))], axis=-1)

"""Errors of the first samples of a sampler, for integrands that are the same in all pixels."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from figures.shared.integrands import integrand_classes, integrands_of_dims
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from qmcjax import samplers

TOGETHER = 64
"""Samples whose values are summed in float32."""

WHITE = 1 / (2 * np.sqrt(np.pi) * 1.5)
"""What the filter leaves of white noise of standard deviation 1."""


def lengths(most: int) -> tuple[int, ...]:
    """Return numbers of samples: all up to 16, then 4 in each octave."""
    octaves = [k << m for m in range(2, 13) for k in (5, 6, 7, 8)]
    return tuple(n for n in (*range(1, 17), *(n for n in octaves if n > 16)) if n <= most)


@partial(jax.jit, static_argnums=(1, 2))
def _sum(sampler: samplers.Sampler, side: int, dims: int, start: Array, stop: Array) -> Array:
    """Return the sums of the values of the integrands over some samples of all pixels."""
    wanted = tuple(range(dims))
    state = sampler.prepare_image(side, side, wanted)

    def add(number: Array, total: Array) -> Array:
        sample = jnp.full((side, side), number, jnp.uint32)
        return total + integrands_of_dims.values(sampler.points(state, sample, wanted, jnp.float32))

    return lax.fori_loop(start, stop, add, jnp.zeros((side, side, len(CLASSES) * COUNT)))


def prefix_errors(
    sampler: samplers.Sampler, side: int, dims: int, counts: tuple[int, ...]
) -> NDArray[np.float64]:
    """Return filtered and RMS errors of the first samples, shape (counts, 2): geometric means over classes.

    Of images without their means, relative to independent samples, one per pixel.
    """
    deviation = integrands_of_dims.moments(dims)[1]
    total, found = np.zeros((side, side, len(deviation))), []
    for start, stop in zip((0, *counts), counts, strict=False):
        for first in range(start, stop, TOGETHER):
            total += np.asarray(_sum(sampler, side, dims, first, min(first + TOGETHER, stop)))
        image = (total - total.mean(axis=(0, 1))) / stop / deviation
        of_classes = integrand_classes.of_classes(image, len(CLASSES)) / [[WHITE], [1]]
        found.append([np.exp(np.mean(np.log(of))) for of in of_classes])
    return np.array(found)

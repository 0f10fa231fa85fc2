"""From a scene and a sampler to an image."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax import _summation, checks
from qmcjax._summation import State
from qmcjax.samplers import completed

__all__ = ["render"]

_MAX_SIDE = 2**16

_CALL = 2**26
"""Samples of the whole image in one call of the compiled program: progress is reported between calls."""


def render(
    scene: Any,
    sampler: Any,
    width: int,
    height: int,
    spp: int,
    *,
    dtype: DTypeLike = jnp.float32,
    progress: Callable[[float], None] | None = None,
) -> Array:
    """Average the samples of each pixel (box filter).

    Memory is proportional to the number of pixels, whatever the number of samples; so it is for
    gradients with respect to the parameters of the scene (``jax.grad``, reverse mode).

    Parameters
    ----------
    scene : Scene
        A function from points, shape (..., len(scene.needs)), to values, shape (...) or (..., 3).
    sampler : Sampler
        A function from pixel and sample to a point.
    width, height : int
        In [1, 65536].
    spp : int
        Samples per pixel, at least 1 and as many as the sampler allows.
    dtype : float32 or float64
        Of points, values and sums. Sums are compensated: they are as good as the values.
    progress : callable, optional
        Called with the finished part in (0, 1], several times in a long run.

    Returns
    -------
    Array of ``dtype``, shape (height, width) or (height, width, 3)
        ``image[y, x]`` is pixel (x, y), which covers [x, x+1)/width times [y, y+1)/height of the unit square.

    Raises
    ------
    ValueError
        If a size is out of range, the sampler was made for another image or number of samples, or it
        has fewer dimensions than the scene needs.

    Examples
    --------
    >>> from qmcjax import orders, render, samplers, scenes, sequences
    >>> sampler = samplers.contiguous(orders.hilbert(64, 64), sequences.sobol(2), spp=16)
    >>> print(render(scenes.checkerboard(), sampler, 64, 64, spp=16).shape)
    (64, 64)
    """
    width = checks.integer("width", width, 1, _MAX_SIDE)
    height = checks.integer("height", height, 1, _MAX_SIDE)
    spp = checks.integer("spp", spp, 1, 2**32 - 1)
    dtype = checks.floating(dtype)
    if sampler.dims < len(scene.needs):
        raise ValueError(
            f"sampler must have the {len(scene.needs)} dimensions that the scene needs {scene.needs}, got "
            f"{sampler.dims}: {scene.needs[sampler.dims :]} are missing"
        )
    sampler.check(width, height, spp)
    sampler, dims = completed(sampler), tuple(range(len(scene.needs)))

    with checks.precision(dtype):
        point = jax.ShapeDtypeStruct((height, width, len(scene.needs)), dtype)
        state = _summation.zeros(jax.eval_shape(scene, point))
        # So many values are added pairwise before they go into the compensated sum: memory traffic is what
        # counts.
        batch = math.gcd(spp, sampler.unrolled(dims))
        # Plug-ins may be dataclasses that JAX takes for one another: see qmcjax.pytrees.
        classes = str(jax.tree.structure((scene, sampler)))
        per_call = max(1, _CALL // (width * height * batch)) * batch
        for first in range(0, spp, per_call):
            count = min(per_call, spp - first)
            first_batch, batches = jnp.uint32(first // batch), jnp.uint32(count // batch)
            state = _accumulate((scene, sampler), state, first_batch, batches, width, height, batch, classes)
            if progress is not None:
                state[0].block_until_ready()
                progress((first + count) / spp)
        return _mean(state, jnp.asarray(spp, dtype))


@partial(jax.jit, static_argnames=("width", "height", "batch", "classes"))
def _accumulate(
    pair: tuple[Any, Any],
    state: State,
    first: Array,
    batches: Array,
    width: int,
    height: int,
    batch: int,
    classes: str,
) -> State:
    """Add ``batches`` times ``batch`` samples of every pixel."""
    del classes  # Part of the cache's key.
    scene, sampler = pair
    dims = tuple(range(len(scene.needs)))
    sampler = sampler.of_pixels(*_pixels(width, height), dims)

    def batch_sum(pair: tuple[Any, Any], k: Array) -> Array:
        # Or else what the samples of a pixel share would be moved out of the loop, once for each of a batch.
        (scene, sampler), k = jax.lax.optimization_barrier((pair, k))
        x, y = _pixels(width, height)
        points = sampler.samples(x, y, k, batch, dims, state[0].dtype)
        return _summation.pairwise([scene(_on_screen(point, x, y)) for point in points])

    return _summation.add_terms(batch_sum, (scene, sampler), state, first, batches)


def _on_screen(point: Array, x: Array, y: Array) -> Array:
    """Take the first two coordinates from the pixel to the screen."""
    dtype = point.dtype
    height, width = x.shape
    below_one = np.nextafter(np.ones((), dtype), np.zeros((), dtype))
    on_screen = [
        # The last pixel's sum may round up to 1.
        jnp.minimum((pixel.astype(dtype) + point[..., j]) * np.asarray(1 / side, dtype), below_one)
        for j, (pixel, side) in enumerate(((x, width), (y, height)))
    ]
    return jnp.stack([*on_screen, *(point[..., j] for j in range(2, point.shape[-1]))], axis=-1)


def _pixels(width: int, height: int) -> tuple[Array, Array]:
    """Return column and row of every pixel."""
    shape = (height, width)
    return jax.lax.broadcasted_iota(jnp.uint32, shape, 1), jax.lax.broadcasted_iota(jnp.uint32, shape, 0)


@jax.jit
def _mean(state: State, spp: Array) -> Array:
    return _summation.value(state) / spp

"""From a scene and a sampler to an image."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.rendering import _accumulation
from qmcjax.rendering._task import Task, check_progress, in_one_pass, refuse, task

__all__ = ["render"]

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
    gradients with respect to the parameters of the scene.

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
        Called with the finished part in (0, 1], several times in a long run; not inside ``jax.jit``.

    Returns
    -------
    Array of ``dtype``, shape (height, width) or (height, width, 3)
        ``image[y, x]`` is pixel (x, y), which covers [x, x+1)/width times [y, y+1)/height of the unit square.

    Raises
    ------
    TypeError
        If an argument is not what it is named for.
    ValueError
        If a size is out of range, the sampler was made for another image or number of samples, it
        has fewer dimensions than the scene needs, or the scene returns a value that is not finite (the
        message names the pixel, the sample and the point).

    Examples
    --------
    >>> from qmcjax import orders, render, samplers, scenes, sequences
    >>> sampler = samplers.contiguous(orders.hilbert(64, 64), sequences.sobol(2), spp=16)
    >>> print(render(scenes.checkerboard(), sampler, 64, 64, spp=16).shape)
    (64, 64)
    """
    wanted = task(scene, sampler, width, height, spp, dtype)
    check_progress(progress, wanted)
    image, finite = _everywhere(wanted, progress)
    if not isinstance(finite, Tracer) and not finite:
        refuse(wanted, image)
    return image


def _everywhere(task: Task, progress: Callable[[float], None] | None) -> tuple[Array, Array]:
    """Take all samples of all pixels, and tell whether the means are finite."""
    scene, sampler, width, height, spp, dtype = task
    sampler, dims = sampler.up_to(spp), tuple(range(len(scene.needs)))
    with checks.precision(dtype):
        # So many values are added pairwise before they go into the compensated sum: memory traffic is what
        # counts.
        batch = in_one_pass(scene, sampler, spp, dims)
        state = _accumulation.zeros(scene, (height, width), dtype)
        per_call = max(1, _CALL // (width * height * batch)) * batch
        for first in range(0, spp, per_call):
            count = min(per_call, spp - first)
            state = _accumulation.accumulate(
                (scene, sampler),
                None,
                state,
                np.uint32(first // batch),
                np.uint32(count // batch),
                width,
                height,
                batch,
                dims,
            )
            if progress is not None:
                state[0].block_until_ready()
                progress((first + count) / spp)
        return _accumulation.mean(state, np.uint32(spp))

"""From a scene and a sampler to an image."""

import math
from collections.abc import Callable
from typing import Any, Literal, overload

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.rendering import _accumulation
from qmcjax.rendering._adaptive import AdaptiveImage, Task, refuse, skipping
from qmcjax.rendering._stopping import PILOT, until
from qmcjax.samplers import Randomized, as_sampler

__all__ = ["AdaptiveImage", "render"]

_MAX_SIDE = 2**16

_CALL = 2**26
"""Samples of the whole image in one call of the compiled program: progress is reported between calls."""


@overload
def render(
    scene: Any,
    sampler: Any,
    width: int,
    height: int,
    spp: int,
    *,
    dtype: DTypeLike = ...,
    progress: Callable[[float], None] | None = ...,
    adaptive: Literal[False] = ...,
) -> Array: ...
@overload
def render(
    scene: Any,
    sampler: Any,
    width: int,
    height: int,
    spp: int,
    *,
    dtype: DTypeLike = ...,
    progress: Callable[[float], None] | None = ...,
    adaptive: Literal[True],
    tolerance: float | None = ...,
    unbiased: bool = ...,
) -> AdaptiveImage: ...
def render(
    scene: Any,
    sampler: Any,
    width: int,
    height: int,
    spp: int,
    *,
    dtype: DTypeLike = jnp.float32,
    progress: Callable[[float], None] | None = None,
    adaptive: bool = False,
    tolerance: float | None = None,
    unbiased: bool = False,
) -> Array | AdaptiveImage:
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
    adaptive : bool
        Skip what the scene does not need. Where ``scene.varies`` proves that it is constant in a pixel, one
        sample is taken; where it proves that it does not depend on time, the lens or any other coordinate,
        that coordinate is not sampled. All other samples are the same as without, and so are the means but
        for rounding. Scenes without ``varies`` are sampled everywhere.
    tolerance : float, optional
        With ``adaptive``: take passes in each pixel until the standard error of it and its neighbours is at
        most this, or until it has ``spp`` samples. ``sampler`` must be made by
        :func:`qmcjax.samplers.randomized`, and at least four passes are taken.
    unbiased : bool
        With ``tolerance``: decide the number of passes of each pixel from four passes that are not part of
        the image. Otherwise a pixel whose first passes happen to agree stops early, and rare bright values
        are underestimated. ``counts`` has the samples of both. The error is then a prediction from four
        passes: a few pixels stay above the tolerance.

    Returns
    -------
    Array of ``dtype``, shape (height, width) or (height, width, 3)
        ``image[y, x]`` is pixel (x, y), which covers [x, x+1)/width times [y, y+1)/height of the unit square.
        With ``adaptive`` an ``AdaptiveImage``: ``image``, ``counts`` (samples taken in each pixel) and
        ``saving`` (the part of all samples that was not taken).

    Raises
    ------
    ValueError
        If a size is out of range, the sampler was made for another image or number of samples, it
        has fewer dimensions than the scene needs, or the scene returns a value that is not finite (the
        message names the pixel, the sample and the point).

    Notes
    -----
    Which pixels are constant is known before any sample is taken, so that ``adaptive`` alone adds no bias.

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
    task = Task(scene, sampler, width, height, spp, checks.floating(dtype))
    if sampler.dims < len(scene.needs):
        raise ValueError(
            f"sampler must have the {len(scene.needs)} dimensions that the scene needs {scene.needs}, got "
            f"{sampler.dims}: {scene.needs[sampler.dims :]} are missing"
        )
    sampler.check(width, height, spp)
    if not adaptive:
        if tolerance is not None or unbiased:
            raise ValueError(f"adaptive must be True for a tolerance or unbiased, got {adaptive}")
        image, finite = _everywhere(task, progress)
        if not isinstance(finite, Tracer) and not finite:
            refuse(task, image)
        return image
    _check_adaptive(task, tolerance, unbiased)
    report = progress or (lambda part: None)
    if tolerance is None:
        result = skipping(task, report)
    else:
        result = until(task, tolerance, unbiased, report)
    if not np.isfinite(result.image).all():
        refuse(task, result.image)
    return result


def _everywhere(task: Task, progress: Callable[[float], None] | None) -> tuple[Array, Array]:
    """Take all samples of all pixels, and tell whether the means are finite."""
    scene, width, height, spp, dtype = task.scene, task.width, task.height, task.spp, task.dtype
    sampler, dims = as_sampler("sampler", task.sampler).up_to(spp), tuple(range(len(scene.needs)))
    with checks.precision(dtype):
        # So many values are added pairwise before they go into the compensated sum: memory traffic is what
        # counts.
        batch = math.gcd(spp, sampler.unrolled(dims))
        classes = str(jax.tree.structure((scene, sampler)))
        state = _accumulation.zeros(scene, (height, width), dtype, classes)
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
                classes,
            )
            if progress is not None:
                state[0].block_until_ready()
                progress((first + count) / spp)
        return _accumulation.mean(state, np.uint32(spp))


def _check_adaptive(task: Task, tolerance: float | None, unbiased: bool) -> None:
    """Raise a ValueError for what an adaptive image cannot be made of."""
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((task.scene, task.sampler))):
        raise ValueError(
            "adaptive=True decides on values, and so is not for jax.jit, jax.vmap or jax.grad, got a tracer"
        )
    if tolerance is None:
        if unbiased:
            raise ValueError(
                "unbiased must be False without a tolerance: then nothing depends on the samples, got True"
            )
        return
    checks.positive("tolerance", tolerance)
    if np.ndim(tolerance):
        raise ValueError(f"tolerance must be one number for all pixels, got {tolerance!r}")
    if not isinstance(task.sampler, Randomized):
        raise ValueError(
            "sampler must be made by samplers.randomized for a tolerance, since errors are estimated from "
            f"independent passes, got {type(task.sampler).__name__}"
        )
    of_pass = task.sampler.spp
    least = (PILOT + unbiased) * of_pass
    if task.spp % of_pass or task.spp < least:
        raise ValueError(
            f"spp must be a multiple of the {of_pass} samples of a pass and at least {least} for a "
            f"tolerance, got {task.spp}"
        )

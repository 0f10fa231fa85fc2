"""Rendering an image without unnecessary samples."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jax.sharding import Mesh
from jax.typing import DTypeLike

from qmcjax.core import checks, devices
from qmcjax.rendering import _tolerances
from qmcjax.rendering._adaptive import AdaptiveImage, skip_constant
from qmcjax.rendering._task import Task, check_progress, task
from qmcjax.rendering.stopping import check_passes, until_tolerance
from qmcjax.samplers import SamplerLike
from qmcjax.scenes import Scene


def render_adaptive(
    scene: Scene,
    sampler: SamplerLike,
    width: int,
    height: int,
    spp: int,
    *,
    dtype: DTypeLike = jnp.float32,
    progress: Callable[[float], None] | None = None,
    tolerance: _tolerances.Tolerance | None = None,
    relative: float | None = None,
    unbiased: bool = False,
    mesh: Mesh | None = None,
) -> AdaptiveImage:
    """Average only the samples that each pixel needs.

    If ``scene.varies`` proves that the scene is constant in a pixel, one sample is taken. If it proves that
    the scene does not depend on a coordinate, such as time or the lens, that coordinate is not sampled. This
    takes a second program: ray-traced scenes (``scene.unrolled`` is 1), whose programs take long to compile,
    are sampled in all coordinates. All other samples are those of :func:`qmcjax.render`, and so are the means
    up to rounding. Scenes without ``varies`` are sampled everywhere.

    Parameters
    ----------
    scene : Scene
    sampler : Sampler
        Made by :func:`qmcjax.samplers.randomized` if there is a ``tolerance`` or it is ``relative``.
    width, height : int, in [1, 65536]
    spp : int, samples per pixel, or the maximum: with a tolerance a multiple of the samples of a pass
    dtype : float32 or float64
    progress : callable, optional, called with the finished part in (0, 1], several times in a long run
    tolerance : float or callable, optional
        Take passes in each pixel until the standard error of it and its neighbours is at most this, or until
        it has ``spp`` samples. At least four passes are taken. Positive. A function is called with the means
        so far and estimates of their variances, float64 ndarrays of the image's shape, and returns the
        largest standard error that is allowed: a number, or one for each pixel or each of its channels.
    relative : float, optional
        The same, as a fraction of the mean of the pixel's brightest channel. Positive. ``tolerance`` is then
        a floor: the larger one of both is allowed, so that dark pixels do not take all samples.
    unbiased : bool
        With a tolerance: decide the number of passes of each pixel from four passes that are not part of the
        image; ``counts`` includes them. The error is then a prediction from four passes: a few pixels remain
        above the tolerance. Otherwise a pixel whose first passes happen to agree stops early, and rare bright
        values are underestimated.
    mesh : jax.sharding.Mesh, optional
        Devices that share the sampled pixels, as for :func:`qmcjax.render`.

    Returns
    -------
    AdaptiveImage
        ``image`` as from :func:`qmcjax.render`, ``counts`` (samples taken in each pixel) and ``saving`` (the
        fraction of samples saved).

    Raises
    ------
    TypeError
        If scene or sampler are traced: stopping depends on values.
    ValueError
        As for :func:`qmcjax.render`.

    Notes
    -----
    Constant pixels are determined before any sample is taken, so skipping samples adds no bias.

    Examples
    --------
    >>> from qmcjax import orders, render_adaptive, samplers, scenes, sequences
    >>> sampler = samplers.contiguous(orders.hilbert(64, 64), sequences.sobol(2), spp=16)
    >>> result = render_adaptive(scenes.disc(), sampler, 64, 64, spp=16)
    >>> print(result.image.shape, result.counts.min(), result.counts.max(), result.saving > 0.8)
    (64, 64) 1 16 True
    """
    wanted = task(scene, sampler, width, height, spp, dtype)
    if wanted.traced:
        raise TypeError(
            "scene and sampler must be known, since render_adaptive decides on values, not inside "
            "jax.jit, jax.vmap or jax.grad, got a tracer"
        )
    check_progress(progress, wanted)
    _check_tolerances(wanted, tolerance, relative, unbiased)
    mesh = devices.validate_mesh(mesh)
    report = progress or (lambda part: None)
    if tolerance is None and relative is None:
        return skip_constant(wanted, mesh, report)
    return until_tolerance(wanted, tolerance, relative, unbiased, mesh, report)


def _check_tolerances(task: Task, tolerance: Any, relative: Any, unbiased: Any) -> None:
    checks.flag("unbiased", unbiased)
    _tolerances.check(tolerance, relative)
    if tolerance is None and relative is None:
        if unbiased:
            raise ValueError(
                "unbiased must be False without a tolerance: then nothing depends on the samples, got True"
            )
        return
    check_passes(task.sampler, task.spp, unbiased)

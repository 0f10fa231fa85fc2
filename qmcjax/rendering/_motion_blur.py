"""Motion blur from images: sliding means of an animation; a moving object in front of a still scene."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import known, require
from qmcjax.rendering._adaptive import AdaptiveImage
from qmcjax.rendering._render_adaptive import render_adaptive
from qmcjax.samplers import SamplerLike
from qmcjax.scenes import Scene, as_scene


def sliding_means(images: Iterable[ArrayLike], count: int) -> Iterator[NDArray[np.float64]]:
    """Yield the mean of the last ``count`` images, for each new image from number ``count`` on.

    If motion blur is the mean of images at consecutive times, each frame after the first needs only one new
    image instead of ``count``.

    Parameters
    ----------
    images : iterable of real ArrayLike
        Finite, all of one shape. A generator is consumed lazily.
    count : int, number of images per frame, in [1, 65536]; this many are kept

    Yields
    ------
    float64 ndarray, shape of the images
        The mean of ``count`` consecutive images, summed from the oldest: it does not depend on earlier
        frames. A running sum would accumulate rounding errors.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.1.3.

    Examples
    --------
    >>> print([frame.tolist() for frame in sliding_means([[0.0], [1.0], [2.0], [6.0]], 3)])
    [[1.0], [3.0]]
    """
    count = checks.integer("count", count, 1, 2**16)
    try:
        new = iter(images)
    except TypeError:
        raise TypeError(f"images must be an iterable of images, got {checks.shown(images)}") from None
    return _means(new, count)


def _means(images: Iterator[Any], count: int) -> Iterator[NDArray[np.float64]]:
    ring: deque[NDArray[np.float64]] = deque(maxlen=count)
    for value in images:
        image = known("images", value)
        if ring and image.shape != ring[0].shape:
            raise ValueError(f"images must have the same shape {ring[0].shape}, got {image.shape}")
        require("images", image, np.isfinite, "finite")
        ring.append(image)
        if len(ring) == count:
            total = np.zeros_like(ring[0])
            for one in ring:
                total += one
            yield total / count


def render_layers(
    moving: Scene,
    still: Scene,
    sampler: SamplerLike,
    width: int,
    height: int,
    spp: int,
    still_spp: int,
    *,
    shade: float = 1.0,
    dtype: DTypeLike = jnp.float32,
) -> AdaptiveImage:
    """Render a moving object in front of a still scene, sampling time only where the object passes.

    Where it passes, ``spp`` samples in time estimate its coverage of the pixel and the shutter interval. The
    scene behind it has ``still_spp`` samples everywhere, and the coverage blends both. So the noise of the
    still scene is the same on and off the path of the object, as in the variance invariant method [1]_. If
    all samples shaded both, it would be lower on the path.

    Parameters
    ----------
    moving : Scene
        Coverage of the object, in [0, 1], with ``varies``; for example :func:`qmcjax.scenes.ball`.
    still : Scene
        The scene behind it, scalar or RGB.
    sampler : Sampler
        Used for both scenes: it must have the dimensions that either needs, and ``max(spp, still_spp)``
        samples per pixel.
    width, height : int, in [1, 65536]
    spp, still_spp : int, samples for each layer
    shade : float
        The value of the object, finite.
    dtype : float32 or float64

    Returns
    -------
    AdaptiveImage
        ``counts`` has the samples of both layers; ``saving`` is relative to ``spp + still_spp`` in every
        pixel.

    Notes
    -----
    The mean of a product is replaced by the product of means. If coverage and still scene are correlated
    within a pixel, the result is off by their covariance over the pixel.

    References
    ----------
    .. [1] D. Neilson, Y.-H. Yang, "Variance invariant adaptive temporal supersampling for motion blurring",
       2003; described in L. Gruenschloss, "Motion Blur", 2008, Sect. 3.1.4.

    Examples
    --------
    >>> from qmcjax import render_layers, samplers, scenes, sequences
    >>> ball = scenes.ball([[0.2, 0.2]], [[0.8, 0.4]], times=[], radius=0.1)
    >>> sampler = samplers.independent(sequences.sobol(3), key=1)
    >>> result = render_layers(ball, scenes.checkerboard(), sampler, 32, 32, spp=64, still_spp=4)
    >>> print(result.image.shape, int(result.counts.min()), int(result.counts.max()))
    (32, 32) 2 68
    """
    moving, still = as_scene("moving", moving), as_scene("still", still)
    if isinstance(shade, bool) or not isinstance(shade, int | float | np.integer | np.floating):
        raise TypeError(f"shade must be a finite number, got {checks.shown(shade)}")
    if not abs(shade) <= np.finfo(np.float32).max:
        raise ValueError(f"shade must be a finite number, got {shade!r}")
    shade = float(shade)
    still_spp = checks.integer("still_spp", still_spp, 1, checks.INDEX_LIMIT - 1)
    cover = render_adaptive(moving, sampler, width, height, spp, dtype=dtype)
    behind = render_adaptive(still, sampler, width, height, still_spp, dtype=dtype)
    counts = cover.counts + behind.counts
    every = width * height * (spp + still_spp)
    with checks.precision(checks.floating(dtype)):
        share = cover.image if behind.image.ndim == 2 else cover.image[..., None]
        image = shade * share + (1 - share) * behind.image
    return AdaptiveImage(image, counts, 1 - int(counts.sum(dtype=np.uint64)) / every)

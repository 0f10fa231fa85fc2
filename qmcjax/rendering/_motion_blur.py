"""Motion blur from images: sliding means of an animation."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import known, require


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

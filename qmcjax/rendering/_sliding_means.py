"""Frames of an animation from the images of those before: a ring buffer (thesis, Sect. 3.1.3)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import known, require


def sliding_means(images: Iterable[ArrayLike], count: int) -> Iterator[NDArray[np.float64]]:
    """Yield the mean of the first images, and then one more for each new image: of the last ones.

    Where motion blur is a mean of images at consecutive times, each frame after the first takes one new image
    in place of ``count``.

    Parameters
    ----------
    images : iterable of real ArrayLike
        All of one shape. They may come from a generator: each is asked for when it is needed.
    count : int
        How many images make a frame, in [1, 65536]; so many are kept.

    Yields
    ------
    float64 array of NumPy, shape of the images
        Each is the mean of ``count`` images in a row, the oldest added first: it does not depend on the
        frames before. Where an image is subtracted from a running sum instead, rounding errors stay in it.

    Raises
    ------
    TypeError
        If ``images`` cannot be iterated over, or an image is none of real numbers.
    ValueError
        If ``count`` is out of range, an image has another shape than those before, or a value that is not
        finite.

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
            raise ValueError(f"images must have one shape, {ring[0].shape}, got {image.shape}")
        require("images", image, np.isfinite, "finite")
        ring.append(image)
        if len(ring) == count:
            total = np.zeros_like(ring[0])
            for one in ring:
                total += one
            yield total / count

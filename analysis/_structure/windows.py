"""How uniform the values of pixels are in all windows of space and time."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import known

WINDOWS = (1, 5, 5), (1, 3, 3), (8, 1, 1), (4, 2, 2), (8, 3, 3)
"""Frames, rows and columns that temporal anti-aliasing and spatial filters average."""

_TOGETHER = 2**22
"""Values sorted at a time, for memory."""


def window_discrepancy(values: ArrayLike, shapes: Sequence[tuple[int, int, int]] = WINDOWS) -> Any:
    """Return the worst circular discrepancy of the values in all windows of an image or animation.

    For n values on a circle of length 1, it is the largest difference, over all arcs, of the part of the
    values on an arc and its length. n equally spaced values have the least, 1 / n.

    Parameters
    ----------
    values : float ArrayLike, shape (height, width) or (frames, height, width), in [0, 1)
        One coordinate of the samples of pixels, or a mask.
    shapes : list or tuple of (int, int, int)
        Frames, rows and columns of the windows, which lie inside the array.

    Returns
    -------
    float64 array, shape (shapes,)
        The worst discrepancy times n: at least 1, up to rounding, and at most n. If JAX traces the values, an
        Array of their dtype, with the derivative of a worst window; all windows are then in memory.

    Notes
    -----
    Exact up to rounding: with values in ascending order from 0 on, the discrepancy is 1 / n plus the largest
    minus the smallest ``i / n - values[i]`` (N. H. Kuiper's statistic). Random values have about 5 in the
    median window of 8 x 3 x 3, and 20 in the worst of some thousand.

    References
    ----------
    .. [1] N. H. Kuiper, "Tests concerning random points on a circle", 1960.

    Examples
    --------
    >>> values = np.arange(64) * 0.618034 % 1
    >>> print(window_discrepancy(values.reshape(1, 64), [(1, 1, 8), (1, 1, 16)]).round(2))
    [1.39 1.89]
    """
    array: Any = values if isinstance(values, Tracer) else known("values", values)
    if array.ndim not in (2, 3):
        raise ValueError(
            f"values must have shape (height, width) or (frames, height, width), got {array.shape}"
        )
    if not isinstance(array, Tracer) and not np.all((array >= 0) & (array < 1)):
        raise ValueError(f"values must be in [0, 1), got {checks.shown(values)}")
    array = array if array.ndim == 3 else array[None]
    if not isinstance(shapes, list | tuple):
        raise TypeError(f"shapes must be triples of frames, rows and columns, got {checks.shown(shapes)}")
    windows = [_window(shape, array.shape) for shape in shapes]
    if isinstance(array, Tracer):
        return jnp.stack([_traced(array, window) for window in windows])
    return np.array([_worst(array, window) for window in windows])


def _window(shape: Any, size: tuple[int, ...]) -> tuple[int, ...]:
    if not isinstance(shape, tuple | list) or len(shape) != 3:
        raise TypeError(f"shapes must be triples of frames, rows and columns, got {checks.shown(shape)}")
    return tuple(checks.integer("shapes", side, 1, most) for side, most in zip(shape, size, strict=True))


def _worst(values: NDArray[np.float64], shape: tuple[int, ...]) -> float:
    windows = sliding_window_view(values, shape)
    n = int(np.prod(shape))
    rows = max(_TOGETHER // (n * windows.shape[2]), 1)
    even, worst = np.arange(n) / n, 0.0
    for t in range(windows.shape[0]):
        for first in range(0, windows.shape[1], rows):
            of_some = np.sort(windows[t, first : first + rows].reshape(-1, n), axis=1)
            ahead = even - of_some
            worst = max(worst, float(np.max(ahead.max(axis=1) - ahead.min(axis=1))))
    return 1 + n * worst


def _traced(values: Array, shape: tuple[int, ...]) -> Array:
    n = int(np.prod(shape))
    windows = sliding_window_view(np.arange(values.size).reshape(values.shape), shape).reshape(-1, n)
    ahead = (np.arange(n) / n).astype(values.dtype)[None] - jnp.sort(values.ravel()[windows], axis=1)
    return 1 + n * jnp.max(ahead.max(axis=1) - ahead.min(axis=1))

"""Bounding boxes of moving objects: over parts of the shutter, and split in time."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees import _structure
from qmcjax.core import checks
from qmcjax.core.parameters import numbers, require


def boxes_during(
    low: ArrayLike, high: ArrayLike, times: ArrayLike, start: Any = None, end: Any = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bounding boxes of moving boxes during a part of the shutter.

    Parameters
    ----------
    low, high : float ArrayLike, shape (k, n, 3)
        Corners at each of the times; they move linearly in between.
    times : float ArrayLike, shape (k,)
        Increasing, two or more.
    start, end : float, optional
        In the range of ``times``, ``start <= end``; by default the whole range. They may be equal.

    Returns
    -------
    low, high : float64 ndarray, shape (n, 3)

    Notes
    -----
    A tree for a part of the shutter (Eq. 4.7) is a tree over these boxes. A ray visits the tree of the part
    that contains its time.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.2.

    Examples
    --------
    >>> low, high = boxes_during([[[0, 0, 0]], [[8, 0, 0]]], [[[1, 1, 1]], [[9, 1, 1]]], [0, 1], 0.25, 0.5)
    >>> print(low, high)
    [[2. 0. 0.]] [[5. 1. 1.]]
    """
    low, high, times = _structure.moving_boxes(low, high, times)
    begin = float(times[0]) if start is None else float(numbers("start", start))
    close = float(times[-1]) if end is None else float(numbers("end", end))
    for name, value in (("start", begin), ("end", close)):
        require(name, value, lambda t: (t >= times[0]) & (t <= times[-1]), f"in [{times[0]}, {times[-1]}]")
    if begin > close:
        raise ValueError(f"start must be at most end, got {begin} and {close}")
    return during(low, high, times, begin, close)


def during(
    low: NDArray, high: NDArray, times: NDArray, start: float, end: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    inside = (times > start) & (times < end)
    span, part = _structure.interval_of_time(times, np.array([start, end]))
    part = part[:, None, None]
    lows, highs = (
        np.concatenate([(1 - part) * a[span] + part * a[span + 1], a[inside]]) for a in (low, high)
    )
    return lows.min(axis=0), highs.max(axis=0)


def split_in_time(
    low: ArrayLike, high: ArrayLike, times: ArrayLike, kappa: Any = 2.0, *, most: int = 16
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Split moving boxes in time into parts with at most 1 / kappa of the area of the whole.

    The shutter is cut into 2, 4, 8, ... equal parts, for each box as few as suffice, but at most ``most``.
    Boxes that are larger than that at a single time are not split: large boxes gain little.

    Parameters
    ----------
    low, high, times
        As for :func:`boxes_during`.
    kappa : float, optional
        At least 1; 1 splits nothing.
    most : int, optional
        Maximum number of parts of a box, in [1, 1024].

    Returns
    -------
    low, high : float64 ndarray, shape (m, 4)
        Boxes with their interval of time as fourth coordinate, for :func:`surface_area_tree`.
    number : int64 ndarray, shape (m,)
        The number of the original box.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.3.1.
    .. [2] J. Olsson, "Ray-Tracing Time-Continuous Animations using 4D KD-Trees", 2007.

    Examples
    --------
    >>> low, high, number = split_in_time([[[0, 0, 0]], [[8, 0, 0]]], [[[1, 1, 1]], [[9, 1, 1]]], [0, 1])
    >>> print(low[:, [0, 3]].tolist(), high[:, [0, 3]].tolist())
    [[0.0, 0.0], [2.0, 0.25], [4.0, 0.5], [6.0, 0.75]] [[3.0, 0.25], [5.0, 0.5], [7.0, 0.75], [9.0, 1.0]]
    """
    low, high, times = _structure.moving_boxes(low, high, times)
    bound = float(numbers("kappa", kappa))
    require("kappa", bound, lambda k: k >= 1, "at least 1")
    limit = checks.integer("most", most, 1, 1024)
    whole = during(low, high, times, float(times[0]), float(times[-1]))
    allowed = _structure.measure(*whole) / bound
    alone = np.any(_structure.measure(low, high) > allowed, axis=0)
    rest = np.flatnonzero(~alone)
    found = [(*_with_times(whole[0][alone], whole[1][alone], times[0], times[-1]), np.flatnonzero(alone))]
    count = 1
    while len(rest):
        cuts = np.linspace(times[0], times[-1], count + 1)
        parts = [during(low[:, rest], high[:, rest], times, start, end) for start, end in pairwise(cuts)]
        fits = np.all([_structure.measure(*part) <= allowed[rest] for part in parts], axis=0) | (
            2 * count > limit
        )
        for part, (start, end) in zip(parts, pairwise(cuts), strict=True):
            found.append((*_with_times(part[0][fits], part[1][fits], start, end), rest[fits]))
        rest, count = rest[~fits], 2 * count
    lows, highs, number = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((lows[:, 3], number))
    return lows[order], highs[order], number[order]


def _with_times(low: NDArray, high: NDArray, start: float, end: float) -> tuple[NDArray, NDArray]:
    """Return boxes with times as fourth coordinate."""
    column = np.ones((len(low), 1))
    return np.concatenate([low, start * column], axis=1), np.concatenate([high, end * column], axis=1)

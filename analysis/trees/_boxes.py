"""Boxes with sides along the axes: still, with an interval of time, or moving; and their measures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import known, require

_LARGEST = 1e75
"""Absolute values up to which areas and their sums stay finite."""


def still_boxes(low: Any, high: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of boxes, (n, 3), or (n, 4) with time as fourth coordinate, or raise."""
    return _validate_corners(
        low, high, "(n, 3) or (n, 4)", lambda s: len(s) == 2 and s[0] > 0 and s[1] in (3, 4)
    )


def moving_boxes(
    low: Any, high: Any, times: Any
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of boxes at some times, (k, n, 3), and the times, (k,), or raise."""
    low, high = _validate_corners(
        low, high, "(k, n, 3)", lambda s: len(s) == 3 and s[0] > 1 and s[1] > 0 and s[2] == 3
    )
    times = known("times", times)
    if times.shape != (len(low),):
        raise ValueError(f"times must have shape ({len(low)},), one for each of the boxes, got {times.shape}")
    require(
        "times", times, lambda t: np.isfinite(t).all() and (t[1:] > t[:-1]).all(), "finite and increasing"
    )
    return low, high, times


def _validate_corners(
    low: Any, high: Any, wanted: str, fits: Any
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = known("low", low), known("high", high)
    for name, array in (("low", low), ("high", high)):
        if not fits(array.shape):
            raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")
        require(name, array, lambda a: abs(a) <= _LARGEST, f"finite, and between -{_LARGEST} and {_LARGEST}")
    if low.shape != high.shape:
        raise ValueError(f"high must have the shape of low, {low.shape}, got {high.shape}")
    if not (low <= high).all():
        raise ValueError(f"high must be at least low, got {int((low > high).sum())} coordinates below it")
    return low, high


def surface_area(low: ArrayLike, high: ArrayLike) -> NDArray[np.float64]:
    """Return the surface areas of boxes: uniform lines hit boxes in proportion to them.

    Parameters
    ----------
    low, high : float ArrayLike, shape (..., 3)
        Their corners, with ``low <= high``.

    Examples
    --------
    >>> print(surface_area([0, 0, 0], [1, 2, 3]))
    22.0
    """
    low, high = _validate_corners(low, high, "(..., 3)", lambda s: len(s) > 0 and s[-1] == 3)
    return area(high - low)


def area(extent: NDArray) -> NDArray[np.float64]:
    """Return the surface areas of boxes by their extents, (..., 3)."""
    x, y, z = extent[..., 0], extent[..., 1], extent[..., 2]
    return 2 * (x * y + y * z + z * x)


def measure(low: NDArray, high: NDArray, times: NDArray | None = None) -> NDArray[np.float64]:
    """Return the measure of rays that hit boxes, up to a factor, for rays uniform in space and time.

    It is the area of still boxes, (..., 3); the area times the duration, (..., 4); or the mean over time of
    the area of moving boxes, (k, ..., 3), with corners that are linear between ``times``.
    """
    extent = high - low
    if times is None:
        return area(extent) if extent.shape[-1] == 3 else area(extent) * extent[..., 3]
    # Areas are quadratic in time between two times, so Simpson's rule is exact.
    ends, middles = area(extent), area(0.5 * (extent[:-1] + extent[1:]))
    parts = (times[1:] - times[:-1]) / (6 * (times[-1] - times[0]))
    return np.asarray(np.tensordot(parts, ends[:-1] + 4 * middles + ends[1:], 1), np.float64)


def flat_rays(
    origin: Any, direction: Any
) -> tuple[tuple[int, ...], NDArray[np.float64], NDArray[np.float64]]:
    """Return the shape of rays, and their origins and directions as (n, 3)."""
    origin, direction = known("origin", origin), known("direction", direction)
    for name, array in (("origin", origin), ("direction", direction)):
        if not array.ndim or array.shape[-1] != 3:
            raise ValueError(f"{name} must have shape (..., 3), got {array.shape}")
        require(name, array, np.isfinite, "finite")
    try:
        shape = np.broadcast_shapes(origin.shape, direction.shape)
    except ValueError:
        raise ValueError(
            f"direction must have a shape that goes with {origin.shape} of origin, got {direction.shape}"
        ) from None
    if not (direction != 0).any(axis=-1).all():
        raise ValueError("direction must have a length above 0 everywhere")
    start, way = (np.broadcast_to(a, shape).reshape(-1, 3) for a in (origin, direction))
    return shape[:-1], start, way


def interval_of_time(times: NDArray | None, when: NDArray) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the interval of ``times`` for each time, clamped, and the position in it."""
    if times is None:
        return np.zeros(len(when), np.int64), np.zeros(len(when))
    span = np.clip(np.searchsorted(times, when, side="right") - 1, 0, len(times) - 2)
    return span, np.clip((when - times[span]) / np.diff(times)[span], 0, 1)


def flat_times(time: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return a time for each ray, (n,)."""
    found = known("time", time)
    require("time", found, np.isfinite, "finite")
    try:
        return np.broadcast_to(found, shape).reshape(-1)
    except ValueError:
        raise ValueError(
            f"time must have a shape that goes with {shape}, got {checks.shown(found.shape)}"
        ) from None

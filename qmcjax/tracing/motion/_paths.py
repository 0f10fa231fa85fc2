"""Paths as tables: a row for each time, and curves as linear segments that end where the direction jumps.

Arrays with a short last axis do not fill SIMD registers, so motions compute with components and stack them at
the end.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, floats, known, numbers, require
from qmcjax.core.pytrees import frozen_pytree

_FEW = 16
"""Up to so many rows, selecting from all is faster than a gather."""


def span(times: Array, time: Array) -> Array:
    """Return the intervals between increasing numbers that contain ``time``; outside, the first or last."""
    inner = times[1:-1]
    if len(inner) >= _FEW:
        return jnp.searchsorted(inner, time, side="right").astype(jnp.int32)
    number = jnp.zeros(time.shape, jnp.int32)
    for j in range(len(inner)):
        number = number + (time >= inner[j]).astype(jnp.int32)
    return number


def interpolate(times: Array, rows: Array, time: Array) -> list[Array]:
    """Return the components of rows (k, d) interpolated linearly between times (k,), and clamped."""
    index = span(times, time)
    (begin,), (end,) = rows_at(times[:-1, None], index), rows_at(times[1:, None], index)
    part = jnp.clip((time - begin) / (end - begin), 0, 1)
    ends = zip(rows_at(rows[:-1], index), rows_at(rows[1:], index), strict=True)
    return [(1 - part) * a + part * b for a, b in ends]


def bounding_box(points: ArrayLike) -> tuple[Array, Array]:
    """Return the box of points (n, d): low and high, (d,)."""
    points = jnp.asarray(points)
    return points.min(axis=0), points.max(axis=0)


def rows_at(table: Array, number: Array) -> list[Array]:
    """Return the components of a row, (rows, d), for each number, (...)."""
    rows, components = table.shape
    if rows > _FEW:
        row = table[number]
        return [row[..., j] for j in range(components)]
    result = []
    for j in range(components):
        value = jnp.broadcast_to(table[0, j], number.shape)
        for k in range(1, rows):
            value = jnp.where(number >= k, table[k, j], value)
        result.append(value)
    return result


Curve = Callable[[Array], Array]


@frozen_pytree
class LinearSegments:
    """Straight lines between points, with a time for each point."""

    times: Any
    """(segments + 1,), increasing."""
    points: Any
    """(segments + 1, d)."""

    def __call__(self, time: ArrayLike) -> Array:
        """Return points (..., d) at times (...), clamped to the first and last, in the dtype of these."""
        time = floats("time", time)
        times, points = cast((self.times, self.points), time.dtype)
        return jnp.stack(interpolate(times, points, time), axis=-1)

    @property
    def knots(self) -> Any:
        """Times between which the path is straight with constant speed."""
        return self.times

    def bounds(self) -> tuple[Array, Array]:
        """Return a box of all points: low and high, (d,)."""
        return bounding_box(self.points)


def linear_segments(times: ArrayLike, points: ArrayLike) -> LinearSegments:
    """Make a path of straight lines, each with constant speed.

    Parameters
    ----------
    times : float ArrayLike, shape (segments + 1,)
        Two or more, increasing.
    points : float ArrayLike, shape (segments + 1, d)
        May be traced.

    Examples
    --------
    >>> path = linear_segments([0, 0.5, 1], [[0.0, 1.0], [1.0, 0.0], [2.0, 1.0]])
    >>> print(path(0.75))
    [1.5 0.5]
    """
    known_times = numbers("times", times, (None,))
    require("times", known_times, lambda t: (np.diff(t) > 0).all() and len(t) > 1, "two or more, increasing")
    return LinearSegments(known_times, numbers("points", points, (known_times.shape[0], None)))


def approximated(curve: Curve, start: float, end: float, segments: int, corners: Any = ()) -> LinearSegments:
    """Approximate a motion by linear segments that end where its direction jumps.

    The ends lie on the curve. Without an end at the jump, a bouncing ball would never touch the floor [1]_.

    Parameters
    ----------
    curve : callable
        From times, shape (n,), to points, shape (n, d).
    start, end : float
        The interval of times, ``start < end``.
    segments : int
        Number of segments, in [1, 65536], larger than the number of corners. Each interval between corners
        gets a share proportional to its length, at least one.
    corners : float ArrayLike, shape (k,), optional
        Times strictly inside the interval where the direction jumps, such as :attr:`Nurbs.corners`.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 2.4, Fig. 2.8.

    Examples
    --------
    >>> corners = [np.pi / 7, 2 * np.pi / 7]
    >>> path = approximated(lambda t: jnp.abs(jnp.sin(7 * t))[:, None], 0.0, 1.0, 8, corners)
    >>> print(path(np.pi / 7).round(6) + 0.0)
    [0.]
    """
    checks.function("curve", curve, "of times")
    interval = np.array([numbers(n, known(n, value)) for n, value in (("start", start), ("end", end))])
    if not interval[0] < interval[1]:
        raise ValueError(f"start must be before end, got {start!r} and {end!r}")
    given = known("corners", corners)
    inside = np.unique(numbers("corners", given, (None,)) if given.shape != (0,) else given)
    if inside.size and not (interval[0] < inside[0] and inside[-1] < interval[1]):
        raise ValueError(f"corners must be inside ({start}, {end}), got {inside.tolist()}")
    segments = checks.integer("segments", segments, inside.size + 1, 2**16)
    ends = np.concatenate([interval[:1], inside, interval[1:]])
    times = [interval[:1]]
    for (a, b), count in zip(pairwise(ends), _shares(np.diff(ends), segments), strict=True):
        times.append(np.linspace(a, b, count + 1)[1:])
    all_times = np.concatenate(times)
    with jax.enable_x64(True):
        points = numbers(
            "curve(times)", known("curve(times)", curve(jnp.asarray(all_times))), (len(all_times), None)
        )
    return linear_segments(all_times, points)


def _shares(lengths: NDArray[np.float64], count: int) -> list[int]:
    """Divide a number in proportion to lengths, at least one each: the next goes where steps are longest."""
    shares = np.ones(len(lengths), int)
    for _ in range(count - len(lengths)):
        shares[np.argmax(lengths / shares)] += 1
    return shares.tolist()

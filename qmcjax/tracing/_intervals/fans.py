"""Rays along lines: across the screen, over a lens, along a light.

The rays of a fan go through one point, its apex, in directions ``d(t)`` linear in t: the eye, a point in
focus, or a shaded point.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._shapes.object import SLACK, Frame, rounding
from qmcjax.tracing._shapes.vectors import Vector, dot, each, largest, minus


class Fan(NamedTuple):
    """Rays from ``apex + begin d(t)`` along ``d(t)``, with d linear in t in [0, 1]: components (n,)."""

    apex: Vector
    first: Vector
    """The direction at t = 0."""
    last: Vector
    begin: Array
    """0 where rays start at the apex, -1 where they meet there at distance 1."""
    time: Array
    slack: Array
    """Units of rounding of the apex: a primitive that contains it is not hit there, if rays start there."""
    limit: Array
    """Rays end at this distance, in units of the direction."""

    @property
    def origin(self) -> Vector:
        """Return the apex."""
        return self.apex

    def direction(self, t: Array) -> Vector:
        """Return the directions at some t."""
        return each(lambda a, b: a + t * (b - a), self.first, self.last)

    def inside(self, frame: Frame | None) -> "Fan":
        """Return the fan in the object space of a frame."""
        if frame is None:
            return self
        apex = frame.inside(minus(self.apex, frame.translation))
        size = (largest(self.apex) + largest(frame.translation)) * jnp.sqrt(
            sum(dot(dual, dual) for dual in frame.duals)
        )
        return self._replace(
            apex=apex, first=frame.inside(self.first), last=frame.inside(self.last), slack=rounding(size)
        )

    def meets(self, low: Vector, high: Vector, limit: Array) -> Array:
        """Return whether any ray may hit boxes, given relative to the apex, up to a limit."""
        enter, leave = self.begin, limit
        for below, above, one, other in zip(low, high, self.first, self.last, strict=True):
            least, most = jnp.minimum(one, other), jnp.maximum(one, other)
            # At the distance s >= 0 coordinates are in [s least, s most], and at s < 0 in [s most, s least].
            reach = jnp.where(self.begin < 0, jnp.maximum(abs(least), abs(most)), 0)
            enter, leave = _cut(enter, leave, below - reach, most)
            enter, leave = _cut(enter, leave, -above - reach, -least)
        return enter <= leave


def _cut(enter: Array, leave: Array, bound: Array, slope: Array) -> tuple[Array, Array]:
    """Keep the distances s where ``slope s >= bound``."""
    s = bound / jnp.where(slope == 0, 1, slope)
    slower = 8 * jnp.finfo(s.dtype).eps * abs(s)
    leave = jnp.where(
        slope < 0, jnp.minimum(leave, s + slower), jnp.where((slope == 0) & (bound > 0), -2, leave)
    )
    return jnp.where(slope > 0, jnp.maximum(enter, s - slower), enter), leave


def eye(origin: Vector, first: Vector, last: Vector, time: Array, limit: Any = jnp.inf) -> Fan:
    """Return the fan of rays that start at one point."""
    slack = SLACK * jnp.finfo(time.dtype).eps * largest(origin)
    limit = jnp.broadcast_to(jnp.asarray(limit, time.dtype), time.shape)
    return Fan(origin, first, last, jnp.zeros_like(time), time, slack, limit)


def lens_fan(first: Vector, last: Vector, focus: Vector, time: Array) -> Fan:
    """Return the fan of rays from points of a line that meet in a point in focus, and go on."""
    fan = eye(focus, minus(focus, first), minus(focus, last), time)
    return fan._replace(begin=fan.begin - 1)

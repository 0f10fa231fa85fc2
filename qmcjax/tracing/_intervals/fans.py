"""Rays along lines: across the screen, over a lens, along a light. And those of all lines side by side.

The rays of a fan go through one point, its apex, in directions ``d(t)`` linear in t: the eye, a point in
focus, or a shaded point. A flat mirror shows what the mirrored fan sees beyond its plane.
"""

from collections.abc import Sequence
from functools import reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._shapes.object import SLACK, Frame, rounding
from qmcjax.tracing._shapes.vectors import Vector, along, dot, each, largest, minus


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
    beside: tuple[Vector, ...] = ()
    """More directions: of a pyramid, whose rays have all directions between these and those of the fan."""
    plane: tuple[Vector, Array] | None = None
    """Rays start where they cross this plane: its normal, ahead, and its height above the apex."""

    @property
    def ends(self) -> tuple[Vector, ...]:
        """Return the directions between which those of all rays are."""
        return self.first, self.last, *self.beside

    @property
    def origin(self) -> Vector:
        """Return the apex."""
        return self.apex

    def direction(self, t: Array) -> Vector:
        """Return the directions at some t."""
        return each(lambda a, b: a + t * (b - a), self.first, self.last)

    def start(self, direction: Vector) -> Vector:
        """Return where rays along some of the directions start."""
        if self.plane is None:
            return along(self.apex, self.begin, direction)
        normal, height = self.plane
        slope = dot(normal, direction)
        return along(self.apex, height / jnp.where(slope == 0, 1, slope), direction)

    def inside(self, frame: Frame | None) -> "Fan":
        """Return the fan in the object space of a frame."""
        if frame is None:
            return self
        apex = frame.inside(minus(self.apex, frame.translation))
        size = (largest(self.apex) + largest(frame.translation)) * jnp.sqrt(
            sum(dot(dual, dual) for dual in frame.duals)
        )
        return self._replace(
            apex=apex,
            first=frame.inside(self.first),
            last=frame.inside(self.last),
            slack=rounding(size),
            beside=tuple(map(frame.inside, self.beside)),
            plane=self.plane and (frame.gradient(self.plane[0]), self.plane[1]),
        )

    def meets(self, low: Vector, high: Vector, limit: Array) -> Array:
        """Return whether any ray may hit boxes, given relative to the apex, up to a limit."""
        stop = limit + self.begin

        def ahead() -> Array:
            return _within(low, high, self.ends, jnp.zeros_like(stop), stop)

        def before() -> Array:
            """Also between the start and the apex, where positions are those of the opposite directions."""
            back = [each(jnp.negative, d) for d in self.ends]
            return ahead() | _within(low, high, back, jnp.maximum(-stop, 0), -self.begin)

        return jax.lax.cond(jnp.any(self.begin < 0), before, ahead)


def _within(low: Vector, high: Vector, ends: Sequence[Vector], enter: Array, leave: Array) -> Array:
    """Return whether rays may be in boxes at distances s >= 0 from ``enter`` to ``leave``."""
    for below, above, *parts in zip(low, high, *ends, strict=True):
        # Coordinates are in [s least, s most].
        enter, leave = _cut(enter, leave, below, reduce(jnp.maximum, parts))
        enter, leave = _cut(enter, leave, -above, -reduce(jnp.minimum, parts))
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


def mirrored(fan: Fan, normal: Vector, level: Array) -> Fan:
    """Return the fan in mirrors, of points x with ``normal x = level``, that its rays meet on their front."""
    height = level - dot(normal, fan.apex)
    apex = along(fan.apex, 2 * height, normal)
    first, last, *beside = (along(d, -2 * dot(normal, d), normal) for d in fan.ends)
    slack = fan.slack + eye(apex, first, last, fan.time).slack
    plane = normal, -height
    return fan._replace(apex=apex, first=first, last=last, slack=slack, beside=tuple(beside), plane=plane)

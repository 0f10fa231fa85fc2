"""The nearest span at each time: Watkins' scan line algorithm with time instead of x (thesis, Fig. 3.2).

Between events, where a span starts or ends, the set of spans is constant. One of them is the nearest up to
the next event if its largest distance is below the smallest one of all others, or if the Bernstein
coefficients of a polynomial have one sign. Otherwise time is bisected, down to rounding. So crossings are
found without roots of polynomials of degree five, and intervals are contiguous for any rounding.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._intervals.candidates import Candidates, RayState
from qmcjax.tracing._intervals.spans import middle, product, restrict

_STEPS = 128
"""Maximum number of steps per interval: a crossing takes about twice as many as a number has digits."""


class Intervals(NamedTuple):
    """Intervals of rays, in order."""

    start: Array
    """(k, n)."""
    end: Array
    number: Array
    """int32: -1 where there is no interval."""
    until: Array
    """(n,): time from which more intervals may follow."""


class _March(NamedTuple):
    time: Array
    """Everything is known up to this time."""
    base: Array
    """Start of the steps that now proceed to ..."""
    event: Array
    """... here, ..."""
    part: Array
    """... and have reached this time; ..."""
    step: Array
    """... the next step has this length: both are multiples of powers of two."""
    used: Array
    """int32: intervals so far."""
    last: Array
    """int32: the primitive of the last interval, if it ends at the current time."""
    going: Array
    found: Intervals


def resolve(state: RayState) -> Intervals:
    """Return the visible candidates over time."""
    spans = state.candidates
    count, rays = spans.start.shape
    closed = jnp.minimum(state.until, state.closed)
    # A span up to the end of the shutter includes that time.
    spans = spans._replace(end=jnp.where(spans.end >= 1, 2, spans.end))
    opened = jnp.broadcast_to(state.opened, (rays,)).astype(closed.dtype)
    none = jnp.full((count, rays), -1, jnp.int32)
    ends = jnp.broadcast_to(state.closed, none.shape).astype(closed.dtype)
    march = _March(
        opened,
        opened,
        _next_event(spans, opened, closed),
        jnp.zeros_like(opened),
        jnp.ones_like(opened),
        jnp.zeros(rays, jnp.int32),
        none[0],
        opened <= closed,
        Intervals(ends, ends, none, opened),
    )
    limit = _STEPS * count

    def go(given: tuple[Array, _March]) -> tuple[Array, _March]:
        return given[0] + 1, _advance(spans, closed, given[1])

    def more(given: tuple[Array, _March]) -> Array:
        return (given[0] < limit) & jnp.any(given[1].going)

    march = jax.lax.while_loop(more, go, (jnp.zeros((), jnp.int32), march))[1]
    return march.found._replace(until=march.time)


def _next_event(spans: Candidates, time: Array, closed: Array) -> Array:
    """Return when the next span starts or ends."""
    events = [jnp.where(a > time[None], a, 2).min(axis=0) for a in (spans.start, spans.end)]
    return jnp.minimum(jnp.minimum(*events), jnp.maximum(closed, time))


def _advance(spans: Candidates, closed: Array, march: _March) -> _March:
    time, found = march.time, march.found
    whole = march.part + march.step >= 1
    inner = march.base + (march.event - march.base) * (march.part + march.step)
    end = jnp.where(whole, march.event, jnp.minimum(inner, march.event))
    there = (spans.start <= time[None]) & (time[None] < spans.end)
    depth, place = spans.depth, jnp.arange(spans.start.shape[0], dtype=jnp.int32)[:, None]
    nearest = jnp.argmin(jnp.where(there, depth.high, jnp.inf), axis=0).astype(jnp.int32)
    mine = place == nearest[None]
    high = jnp.where(there, depth.high, jnp.inf).min(axis=0)
    number = jnp.where(there & mine, spans.number, -1).max(axis=0)
    # Which side of a primitive is nearer does not matter.
    others = jnp.where(there & (spans.number != number[None]), depth.low, jnp.inf).min(axis=0)
    least = jnp.where(there, depth.low, jnp.inf).min(axis=0)
    known = (high <= others) & (least > 0)

    def compared() -> tuple[Array, Array]:
        sure, which = _compare(spans, there, time, end)
        return known | sure, jnp.where(known, number, which)

    unclear = jnp.any(march.going & ~known)
    sure, number = jax.lax.cond(unclear, compared, lambda: (known, number))
    eps = jnp.finfo(time.dtype).eps
    forced = ~sure & (end - time <= 2 * eps)
    done = march.going & (sure | forced)
    # An interval ends: the last one continues, or a new one starts, if there is room.
    new = done & (number >= 0) & (number != march.last)
    full = new & (march.used >= place.shape[0])
    done, new = done & ~full, new & ~full
    used = march.used + new.astype(jnp.int32)
    here = place == used[None] - 1
    seen = here & (done & (number >= 0))[None]
    found = Intervals(
        jnp.where(here & new[None], time[None], found.start),
        jnp.where(seen, end[None], found.end),
        jnp.where(here & new[None], number[None], found.number),
        found.until,
    )
    reached = done & (end >= march.event)
    again = reached | (done & forced)
    part = march.part + march.step
    even = jnp.floor(part / (2 * march.step)) * (2 * march.step) == part
    step = jnp.where(done, jnp.where(even, 2 * march.step, march.step), 0.5 * march.step)
    time = jnp.where(done, end, time)
    return _March(
        time,
        jnp.where(again, end, march.base),
        jnp.where(reached, _next_event(spans, time, closed), march.event),
        jnp.where(again, 0, jnp.where(done, part, march.part)),
        jnp.where(again, 1, step),
        used,
        jnp.where(done, number, march.last),
        march.going & ~full & (time < closed),
        found,
    )


def _compare(spans: Candidates, there: Array, time: Array, end: Array) -> tuple[Array, Array]:
    """Return whether the nearest span is certain from one time to another, and its number."""
    depth = spans.depth
    length = jnp.where(spans.end > spans.start, jnp.minimum(spans.end, 1) - spans.start, 1)
    first, last = (jnp.clip((t[None] - spans.start) / length, 0, 1) for t in (time, end))
    num, den, squared = (restrict(a, first, last) for a in (depth.num, depth.den, depth.squared))
    ends = [jnp.sqrt(jnp.maximum(squared[k], 0)) for k in (0, 2)]
    chord = jnp.stack([depth.side * (ends[0] + (ends[1] - ends[0]) * (k / 3)) for k in range(4)])
    # The root rises above its chord by no more than this, since its square is concave.
    over = jnp.maximum(squared[1] - ends[0] * ends[1], 0)
    least = jnp.minimum(*ends)
    bulge = jnp.sqrt(0.5 * over)
    bulge = jnp.where(least > 0, jnp.minimum(bulge, over / (4 * jnp.where(least > 0, least, 1))), bulge)
    up, down = jnp.where(depth.side > 0, bulge, 0), jnp.where(depth.side < 0, bulge, 0)
    lower, upper = num + chord - down[None], num + chord + up[None]
    # Hits behind the origin do not count.
    error = depth.noise * depth.far
    ahead = (depth.low > 0) | (num.min(axis=0) >= -error)
    behind = ~ahead & (num.max(axis=0) <= error)
    bottom = middle(den)
    bottom = jnp.where(bottom > 0, bottom, depth.noise)
    at = (middle(num) + depth.side * jnp.sqrt(jnp.maximum(middle(squared), 0))) / jnp.where(
        bottom > 0, bottom, 1
    )
    at = jnp.clip(at, depth.low, depth.high)
    present = there & ~behind & (at > 0)
    at = jnp.where(present, at, jnp.inf)
    nearest = (
        jnp.arange(at.shape[0], dtype=jnp.int32)[:, None] == jnp.argmin(at, axis=0).astype(jnp.int32)[None]
    )

    def of_nearest(a: Array) -> Array:
        mine = nearest.reshape((1,) * (a.ndim - 2) + nearest.shape)
        return jnp.where(mine, a, 0).sum(axis=-2, keepdims=True)

    my_upper, my_den = of_nearest(upper), of_nearest(den)
    difference = product(lower, my_den) - product(jnp.broadcast_to(my_upper, upper.shape), den)
    my_noise, my_far, my_high = (of_nearest(a) for a in (depth.noise, depth.far, depth.high))
    size, my_size = abs(den).max(axis=0), abs(my_den).max(axis=0)
    error = (depth.far + my_far) * (depth.noise * (my_size + my_noise) + my_noise * size)
    farther = (difference.min(axis=0) >= -error) | (my_high <= depth.low)
    number = jnp.where(nearest & present, spans.number, -1).max(axis=0)
    fine = (spans.number == number[None]) | ~there | behind | farther
    sure_of_me = ahead | ~nearest
    some = present.any(axis=0)
    sure = jnp.where(some, (fine & sure_of_me).all(axis=0), (~there | behind).all(axis=0))
    return sure, number

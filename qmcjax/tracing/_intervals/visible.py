"""Exact visibility in time, without samples of it."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import moves_an_edge, numbers, require
from qmcjax.core.pytrees import jit
from qmcjax.tracing._intervals.candidates import background, collected
from qmcjax.tracing._intervals.linear import parts
from qmcjax.tracing._intervals.resolution import Intervals, resolved
from qmcjax.tracing._intervals.spans import ShearedRays
from qmcjax.tracing._search.hits import flat_rays
from qmcjax.tracing._search.intersection import in_dtype
from qmcjax.tracing._search.search import search
from qmcjax.tracing._search.tiles import by_tiles
from qmcjax.tracing._shapes.triangles import sheared
from qmcjax.tracing._shapes.vectors import Vector, components, dot, kept, scaled
from qmcjax.tracing._world.world import World

TILE = 32
"""Rays tested together: a candidate of one of them is tested for all, and all wait for the last."""


class VisibleIntervals(NamedTuple):
    """The visible primitives of rays: ordered intervals of time that do not overlap."""

    start: Array
    """(..., k)."""
    end: Array
    """(..., k)."""
    shape: Array
    """int32 (..., k): the number of the primitive; -1 where an interval is unused: then its start and end are
    the end of the shutter."""
    until: Array
    """(...): everything is known before this time, the end of the shutter unless intervals do not fit."""


def visible_intervals(
    world: World,
    origin: ArrayLike,
    direction: ArrayLike,
    intervals: int = 16,
    *,
    shutter: Any = (0.0, 1.0),
) -> VisibleIntervals:
    """Find the visible primitive of each ray at all times, exactly.

    There is no interval while nothing is hit. Intervals that touch are of different primitives.

    Parameters
    ----------
    world : World
        Moving objects must move linearly: triangles with ``close``; triangles, rectangles and boxes with a
        motion that has ``knots``, times between which it is linear (see `motion.linear_segments` and
        `motion.straightened`); spheres that do not rotate. Still objects may be anything.
    origin, direction : float ArrayLike, shape (..., 3)
        Of rays that do not move. Directions need not be normalized.
    intervals : int, optional
        Maximum number of intervals per ray, in [1, 256]: of candidates, and of visible ones.
    shutter : (float, float), optional
        When it opens and closes, in [0, 1]. If both are equal, the interval of a hit has length 0.

    Returns
    -------
    VisibleIntervals
        Times have the dtype of ``origin``, float32 or float64. Differentiating them raises an error.

    Raises
    ------
    ValueError
        Also if ``intervals`` is too small for a ray. This is not known while a program is traced: then check
        ``until``.

    Notes
    -----
    An edge of a triangle crosses a ray at the roots of a quadratic, which are backward stable: they are exact
    for vertices perturbed by a few units of rounding, so those of an edge that only grazes the ray are less
    accurate. Triangles that share an edge agree on them bit by bit; gaps, of a few units of rounding, occur
    only where a ray goes through a vertex. A ray along the patch that an edge sweeps hits it. Where depths
    cross, times are bisected. Unlike :func:`nearest_hit`, an origin on a moving object hits it.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.2.
    .. [2] G. Watkins, "A real time visible surface algorithm", 1970.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> fall = tracing.motion.affine(None, tracing.motion.linear_segments([0, 1], [[0, 2, 5], [0, -2, 5]]))
    >>> ball = tracing.sphere([0, 0, 0], 1.0, motion=fall)
    >>> wall = tracing.rectangle([-9, -9, 9], [18, 0, 0], [0, 18, 0])
    >>> seen = visible_intervals(tracing.world([ball, wall]), [0.0, 0, 0], [0.0, 0, 1], 4)
    >>> print(seen.start.round(2), seen.end.round(2), seen.shape)
    [0.   0.25 0.75 1.  ] [0.25 0.75 1.   1.  ] [ 1  0  1 -1]
    """
    count = checks.integer("intervals", intervals, 1, 256)
    times = numbers("shutter", shutter, (2,))
    require("shutter", times, lambda s: (s >= 0) & (s <= 1) & (s[0] <= s[1]), "(open, close) in [0, 1]")
    shape, (origin, direction) = flat_rays(world, origin, direction)
    found = _visible(world, origin, direction, jnp.asarray(times).astype(origin.dtype), count)
    if not isinstance(found.until, Tracer):
        short = int(jnp.sum(found.until < jnp.asarray(times[1]).astype(origin.dtype)))
        if short:
            raise ValueError(f"intervals must be more than {count} for {short} of {found.until.size} rays")
    start, end, number = (jnp.moveaxis(a, 0, -1).reshape(*shape, count) for a in found[:3])
    return VisibleIntervals(start, end, number, found.until.reshape(shape))


@jit("count")
def _visible(world: World, origin: Array, direction: Array, shutter: Array, count: int) -> Intervals:
    origin, direction = moves_an_edge("origin", origin), moves_an_edge("direction", direction)
    world = jax.tree.map(lambda leaf: moves_an_edge("world", jnp.asarray(leaf)), world)
    return find_intervals(
        world, components(origin), scaled(components(direction))[1][0], shutter[0], shutter[1], count
    )


def find_intervals(
    world: World, origin: Vector, direction: Vector, opened: Array, closed: Array, count: int
) -> Intervals:
    """Return the visible intervals of rays, components (n,)."""
    world = in_dtype(world, origin[0].dtype)
    taken = parts(world)
    zero = jnp.zeros_like(origin[0])
    number, distance = jnp.full(zero.shape, -1, jnp.int32), jnp.full_like(zero, jnp.inf)
    if taken.still.count:
        distance, number = search(taken.still, origin, direction, zero, distance, False)
        number = jnp.where(number < 0, -1, jnp.asarray(taken.numbers)[number])
    squared = dot(direction, direction)
    good = jnp.isfinite(dot(origin, origin)) & jnp.isfinite(squared) & (squared > 0)
    # Rays without a hit get no distance of sight; not NaN, which would break comparisons.
    distance = jnp.where(good, distance, -jnp.inf)
    origin, direction = kept(good, origin), kept(good, direction)

    def tile(rays: Any) -> tuple[list[Array], list[Array], list[Array], Array]:
        origin, direction, number, distance = rays
        view = ShearedRays(origin, direction, *sheared(direction))
        state = background(number, distance, count, opened, closed)
        for batch in taken.moving:
            state = collected(state, batch, view)
        found = resolved(state)
        return list(found.start), list(found.end), list(found.number), found.until

    start, end, number, until = by_tiles(tile, (origin, direction, number, distance), TILE)
    return Intervals(jnp.stack(start), jnp.stack(end), jnp.stack(number), until)

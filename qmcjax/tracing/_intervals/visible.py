"""Exact visibility in time, without sampling, for worlds that move linearly."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import moves_an_edge, numbers, require
from qmcjax.core.plug_ins import unwrap
from qmcjax.core.pytrees import jit
from qmcjax.tracing._intervals.candidates import Batch, background, collect
from qmcjax.tracing._intervals.resolution import Intervals, resolve
from qmcjax.tracing._intervals.spans import Balls, Polygons, ShearedRays
from qmcjax.tracing._shapes.object import Frame, Object, Shape
from qmcjax.tracing._shapes.primitives import Box, Rectangle, Sphere
from qmcjax.tracing._shapes.triangles import Tree, Triangles, shear_maps
from qmcjax.tracing._shapes.vectors import Vector, components, dot, keep, plus, scaled, stacked
from qmcjax.tracing._world.world import World
from qmcjax.tracing.motion import Affine
from qmcjax.tracing.search.hits import flat_rays
from qmcjax.tracing.search.intersection import in_dtype, search
from qmcjax.tracing.search.program import boxes_of, map_tiles

_FACES = np.array(
    [[0, 2, 6, 4], [1, 3, 7, 5], [0, 4, 5, 1], [2, 6, 7, 3], [0, 1, 3, 2], [4, 5, 7, 6]], np.int32
)
"""Corners of the faces of a box; corner k is at the high side of axis j if bit j of k is 1."""


class SplitWorld(NamedTuple):
    """A world split into its parts."""

    still: World
    numbers: np.ndarray
    """int32: numbers in the world of the still primitives."""
    moving: list[Batch]


def split_world(world: World) -> SplitWorld:
    """Split a world, or raise a TypeError if visibility in time is not exact."""
    still, still_numbers = [], [np.zeros(0, np.int32)]
    kinds: dict[Any, list[Batch]] = {}
    for place, (item, start) in enumerate(world.numbered()):
        for shape, first in item.numbered(start):
            numbers = np.arange(first, first + shape.count, dtype=np.int32)
            if item.motion is None and not shape.moving:
                still.append(Object((shape,), None, item.material))
                still_numbers.append(numbers)
                continue
            rows = _linear_rows(place, item, shape)
            # Segments of a motion follow one another, each with all primitives.
            each = np.repeat(numbers, len(_FACES)) if isinstance(shape, Box) else numbers
            batch = Batch(rows, jnp.asarray(np.tile(each, rows.begin.shape[0] // len(each))))
            kind: Any = rows.vertices.shape[2] if isinstance(rows, Polygons) else None
            if isinstance(shape, Triangles) and shape.tree is not None:
                batch, kind = _with_tree(batch, shape.tree), (kind, first)
            kinds.setdefault(kind, []).append(batch)
    together = [jax.tree.map(lambda *a: jnp.concatenate(a), *batches) for batches in kinds.values()]
    return SplitWorld(World(tuple(still), ()), np.concatenate(still_numbers), together)


def _linear_rows(place: int, item: Object, shape: Shape) -> Polygons | Balls:
    """Return the linear segments of a moving shape."""
    motion = unwrap(item.motion)
    dtype = jax.tree.leaves(shape.alone())[0].dtype
    knots = np.zeros(0) if motion is None else getattr(motion, "knots", None)
    if knots is None:
        raise TypeError(
            f"the motion of object {place} must be linear between known times, its `knots`, as those of "
            "tracing.motion.affine(matrix, tracing.motion.linear_segments(times, points)) and "
            f"tracing.motion.straightened(motion, times) are, got {checks.shown(motion)}"
        )
    slides = motion is None or isinstance(motion, Affine)
    if not isinstance(shape, Triangles | Rectangle | Box | Sphere):
        wanted = "triangles, rectangles, boxes or spheres"
    elif isinstance(shape, Sphere) and not slides:
        wanted = "triangles, rectangles or boxes, where it turns or changes its shape,"
    elif shape.moving and not slides:
        wanted = "triangles without `close`, where it turns or changes its shape,"
    else:
        inner = jnp.clip(jnp.sort(jnp.asarray(knots).astype(dtype)), 0, 1)
        moments = jnp.concatenate([jnp.zeros(1, dtype), inner, jnp.ones(1, dtype)])
        frame = item.frame(moments)
        return (
            _balls(shape, frame, moments) if isinstance(shape, Sphere) else _polygons(shape, frame, moments)
        )
    raise TypeError(
        f"what moves must be {wanted} for visibility in time, got {type(shape).__name__} in object {place}"
    )


def _with_tree(batch: Batch, tree: Tree) -> Batch:
    assert isinstance(batch.rows, Polygons)
    tree = jax.tree.map(lambda a: a.astype(jnp.int32), tree)
    vertices = batch.rows.vertices
    ends = vertices.reshape(-1, tree.order.shape[0], 2, 3, 3)[:, tree.order]
    boxes = [boxes_of(ends[segment, :, end], tree) for segment in range(len(ends)) for end in range(2)]
    low, high = (jnp.stack([box[:, part] for box in boxes]) for part in (slice(3), slice(3, 6)))
    return batch._replace(tree=tree, boxes=jnp.concatenate([low.min(axis=0), high.max(axis=0)], axis=1))


def _segments(points: Array) -> Array:
    """Return the first and the last of points (moments, n, ...) in each segment: (segments n, 2, ...)."""
    pairs = jnp.stack([points[:-1], points[1:]], axis=2)
    return pairs.reshape(-1, *pairs.shape[2:])


def _spans(moments: Array, count: int) -> tuple[Array, Array]:
    return jnp.repeat(moments[:-1], count), jnp.repeat(moments[1:], count)


def _outside(frame: Frame | None, points: Array) -> Array:
    """Return points of an object, (moments, ..., 3), in the world."""
    if frame is None:
        return points
    shape = (-1, *(1,) * (points.ndim - 2))
    there: Frame = jax.tree.map(lambda a: a.reshape(shape), frame)
    return stacked(plus(there.outside(components(points)), there.translation))


def _polygons(shape: Triangles | Rectangle | Box, frame: Frame | None, moments: Array) -> Polygons:
    if isinstance(shape, Triangles):
        corners = [shape.at(time).vertices for time in moments]
    elif isinstance(shape, Rectangle):
        base, u, v = shape.corner, shape.edge_u, shape.edge_v
        corners = [jnp.stack([base, base + u, base + u + v, base + v], axis=1)] * len(moments)
    else:
        ends = jnp.stack([shape.low, shape.high])
        all_corners = jnp.stack(
            [jnp.stack([ends[k >> j & 1, :, j] for j in range(3)], axis=-1) for k in range(8)], axis=1
        )
        corners = [all_corners[:, _FACES].reshape(-1, 4, 3)] * len(moments)
    points = jnp.stack(corners)
    return Polygons(*_spans(moments, points.shape[1]), _segments(_outside(frame, points)))


def _balls(shape: Sphere, frame: Frame | None, moments: Array) -> Balls:
    centers = jnp.broadcast_to(shape.center, (len(moments), *shape.center.shape))
    inverse = jnp.eye(3, dtype=moments.dtype)
    if frame is not None:
        inverse = jnp.stack([stacked(dual)[0] for dual in frame.duals])
    rows = inverse[None] / shape.radius[:, None, None]
    rows = jnp.tile(rows, (len(moments) - 1, 1, 1))
    return Balls(*_spans(moments, shape.count), _segments(_outside(frame, centers)), rows)


TILE = 32
"""Rays tested together: a candidate of one ray is tested for all, and all wait for the slowest."""


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
    """(...): everything before this time is known; the end of the shutter unless intervals do not fit."""


def visible_intervals(
    world: World,
    origin: ArrayLike,
    direction: ArrayLike,
    intervals: int = 16,
    *,
    shutter: Any = (0.0, 1.0),
) -> VisibleIntervals:
    """Find the visible primitive of each ray at all times, exactly.

    There is no interval while nothing is hit. Adjacent intervals belong to different primitives.

    Parameters
    ----------
    world : World
        Moving objects must move linearly: triangles with ``close``; triangles, rectangles and boxes with a
        motion that has ``knots``, times between which it is linear (see `motion.linear_segments` and
        `motion.straightened`); spheres that do not rotate. Still objects may have any shape.
    origin, direction : float ArrayLike, shape (..., 3)
        Of rays that do not move. Directions need not be normalized.
    intervals : int, optional
        Maximum number of intervals per ray, in [1, 256], for candidates and for visible ones.
    shutter : (float, float), optional
        When it opens and closes, in [0, 1]. If both are equal, the interval of a hit has length 0.

    Returns
    -------
    VisibleIntervals
        Times have the dtype of ``origin``, float32 or float64. Differentiating them raises an error.

    Raises
    ------
    ValueError
        Also if ``intervals`` is too small for a ray. While a program is traced this is unknown: check
        ``until`` then.

    Notes
    -----
    An edge of a triangle crosses a ray at the roots of a quadratic. These are backward stable: they are exact
    for vertices perturbed by a few units of rounding, so they are less accurate if the edge only grazes the
    ray. Triangles that share an edge agree on them bit by bit; gaps, of a few units of rounding, occur only
    where a ray goes through a vertex. A ray along the patch that an edge sweeps hits it. Where depths cross,
    times are bisected. Unlike in :func:`nearest_hit`, a ray that starts on a moving object hits it.

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
    taken = split_world(world)
    zero = jnp.zeros_like(origin[0])
    number, distance = jnp.full(zero.shape, -1, jnp.int32), jnp.full_like(zero, jnp.inf)
    if taken.still.count:
        distance, number = search(taken.still, origin, direction, zero, distance, False)
        number = jnp.where(number < 0, -1, jnp.asarray(taken.numbers)[number])
    squared = dot(direction, direction)
    good = jnp.isfinite(dot(origin, origin)) & jnp.isfinite(squared) & (squared > 0)
    # Rays without a hit have no distance of sight, but not NaN, which would break comparisons.
    distance = jnp.where(good, distance, -jnp.inf)
    origin, direction = keep(good, origin), keep(good, direction)

    def tile(rays: Any) -> Intervals:
        origin, direction, number, distance = rays
        view = ShearedRays(origin, direction, *shear_maps(direction))
        state = background(number, distance, count, opened, closed)
        for batch in taken.moving:
            state = collect(state, batch, view)
        return resolve(state)

    return map_tiles(tile, (origin, direction, number, distance), TILE)

"""Worlds split into still and linearly moving primitives, for which visibility in time is exact."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.plug_ins import unwrap
from qmcjax.tracing._intervals.spans import Balls, Polygons
from qmcjax.tracing._search.walk import boxes_of
from qmcjax.tracing._shapes.flat import Box, Rectangle
from qmcjax.tracing._shapes.object import Frame, Object
from qmcjax.tracing._shapes.round import Sphere
from qmcjax.tracing._shapes.shape_batches import Shape
from qmcjax.tracing._shapes.triangle_tree import Tree
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import components, plus, stacked
from qmcjax.tracing._world.world import World
from qmcjax.tracing.motion import Affine

_FACES = np.array(
    [[0, 2, 6, 4], [1, 3, 7, 5], [0, 4, 5, 1], [2, 6, 7, 3], [0, 1, 3, 2], [4, 5, 7, 6]], np.int32
)
"""Corners of the faces of a box; corner k is at the high side of axis j if bit j of k is 1."""


class Batch(NamedTuple):
    """Linearly moving primitives of one kind, one linear segment per row."""

    rows: Polygons | Balls
    numbers: Array
    """int32 (rows,): of the primitives in the world."""
    tree: Tree | None = None
    """Of the rows of one segment: the other segments repeat this order."""
    boxes: Array | None = None
    """(nodes, 6): low and high, of all times."""


class Parts(NamedTuple):
    """A world split into its parts."""

    still: World
    numbers: np.ndarray
    """int32: numbers in the world of the still primitives."""
    moving: list[Batch]


def parts(world: World) -> Parts:
    """Split a world, or raise a TypeError where visibility in time is not exact."""
    still, still_numbers = [], [np.zeros(0, np.int32)]
    kinds: dict[Any, list[Batch]] = {}
    for place, (item, start) in enumerate(world.numbered()):
        for shape, before in zip(item.shapes, item.starts, strict=True):
            numbers = np.arange(start + before, start + before + shape.count, dtype=np.int32)
            if item.motion is None and not shape.moving:
                still.append(Object((shape,), None, item.material))
                still_numbers.append(numbers)
                continue
            rows = _moved(place, item, shape)
            # Segments of a motion follow one another, each with all primitives.
            each = np.repeat(numbers, len(_FACES)) if isinstance(shape, Box) else numbers
            batch = Batch(rows, jnp.asarray(np.tile(each, rows.begin.shape[0] // len(each))))
            kind: Any = rows.vertices.shape[2] if isinstance(rows, Polygons) else None
            if isinstance(shape, Triangles) and shape.tree is not None:
                batch, kind = _with_tree(batch, shape.tree), (kind, start + before)
            kinds.setdefault(kind, []).append(batch)
    together = [jax.tree.map(lambda *a: jnp.concatenate(a), *batches) for batches in kinds.values()]
    return Parts(World(tuple(still), ()), np.concatenate(still_numbers), together)


def _moved(place: int, item: Object, shape: Shape) -> Polygons | Balls:
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

"""Conservative tests of whether time, lens and lights matter, by bounding boxes of all that rays may meet.

Rays of a box of points form a beam from a box of origins, the lens, through a box in the plane of focus. At
the fraction t of the way they are in a box with sides linear in t up to that plane, and beyond it: circles of
confusion. The same applies to shafts from a light to visible points, in which objects cast shadows.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.plug_ins import unwrap
from qmcjax.tracing._light.interaction import surface_kinds
from qmcjax.tracing._shapes.object import Object, Shape
from qmcjax.tracing._shapes.primitives import Plane
from qmcjax.tracing._shapes.vectors import along, components, plus, scaled, stacked
from qmcjax.tracing._world.lights import Environment
from qmcjax.tracing._world.world import Camera, World

_FAR = 1e15
"""Replaces infinity: its square is finite in float32."""

_SLACK = 1e-5
"""Relative enlargement of boxes, to cover rounding."""

_FEW = 16
"""Shapes of up to so many primitives have one box per primitive."""


class Seen(NamedTuple):
    """Objects that boxes of points may meet."""

    anything: Array
    objects: Array
    """Any object that is not a light."""
    moves: Array
    """Anything that depends on time in direct light."""
    mirrors: Array
    """Objects that may have a mirror."""


class _Regions(NamedTuple):
    """Regions of space: boxes, and in them a slab where the product with a normal is in an interval."""

    low: Array
    """(n, 3)."""
    high: Array
    normal: Array
    """(n, 3)."""
    least: Array
    """(n,)."""
    most: Array


class _Shaft(NamedTuple):
    """Boxes with corners a + b t, (..., 3)."""

    low: Array
    low_slope: Array
    high: Array
    high_slope: Array


def find_seen(world: World, camera: Camera, low: Array, high: Array) -> Seen:
    """Return what rays between opposite corners of screen boxes, (..., 2), may meet at any time."""
    dtype = low.dtype
    moving = [item for item in world.objects if item.moves]
    none = jnp.zeros(low.shape[:-1], bool)
    if not world.parts:
        return Seen(none, none, none, none)
    regions, flags = [], []
    for number, item in enumerate(world.parts):
        of_item, is_object = _regions(item, dtype), number < len(world.objects)
        flag = is_object, item.moves or item.recolors, is_object and surface_kinds(item)[0].mirror is not None
        regions.append(of_item)
        flags.append(np.broadcast_to(np.array(flag), (of_item.low.shape[0], 3)))
    blockers = [_regions(item, dtype) for item in moving]
    lights = [light_box(light, dtype) for light in world.lights if not isinstance(light, Environment)]
    everywhere = len(lights) < len(world.lights)
    beams = _beams(camera, low, high)

    def visit(total: Seen, one: Any) -> tuple[Seen, None]:
        region, (is_object, changes, mirror) = one
        met, shadowed = none, none
        for beam, start, end in beams:
            first, last = _within(beam, region, start, end)
            here = first <= last
            met = met | here
            if blockers and everywhere:
                shadowed = shadowed | here
            for light in lights if blockers else ():
                shaft = _between(light, _seen_box(beam, region, first, last))
                for blocker in blockers:
                    for j in range(blocker.low.shape[0]):
                        between = _within(shaft, jax.tree.map(lambda a, j=j: a[j], blocker), 0.0, 1.0)
                        shadowed = shadowed | (here & (between[0] <= between[1]))
        moves = (met & changes) | (shadowed & is_object)
        new = Seen(met, met & is_object, moves, met & mirror)
        return jax.tree.map(jnp.logical_or, total, new), None

    together = jax.tree.map(lambda *parts: jnp.concatenate(parts), *regions)
    flags = jnp.asarray(np.concatenate(flags))
    marks = flags[:, 0], flags[:, 1], flags[:, 2]
    return jax.lax.scan(visit, Seen(none, none, none, none), (together, marks))[0]


def _beams(camera: Camera, low: Array, high: Array) -> list[tuple[_Shaft, float, float]]:
    """Return the beams up to the plane of focus and beyond it, with the intervals of their t."""
    sides = (low[..., 0], high[..., 0]), (low[..., 1], high[..., 1])
    views = [camera.view(x, y) for x in sides[0] for y in sides[1]]
    view, dtype = views[0], low.dtype
    origin = jnp.broadcast_to(stacked(view.origin), (*low.shape[:-1], 3))
    # The plane of a pinhole is at the distance 1.
    focus = jnp.ones((), dtype) if camera.aperture is None else view.focus
    corners = [stacked(along(view.origin, focus, view.seen)) for view in views]
    near, far = jnp.min(jnp.stack(corners), axis=0), jnp.max(jnp.stack(corners), axis=0)
    reach = jnp.zeros_like(origin)
    if camera.aperture is not None:
        aperture = jnp.asarray(camera.aperture).astype(dtype)
        across = stacked(plus(_squares(view.right), _squares(view.upward)))
        reach = jnp.broadcast_to(aperture * jnp.sqrt(across), reach.shape)
    slack = _SLACK * jnp.max(abs(origin) + jnp.maximum(abs(near), abs(far)), axis=-1, keepdims=True) / 16
    start = origin - reach - slack, origin + reach + slack
    end = near - slack, far + slack
    # Beyond the plane, 1 - t is below 0: the sides swap.
    return [
        (_Shaft(start[0], end[0] - start[0], start[1], end[1] - start[1]), 0.0, 1.0),
        (_Shaft(start[1], end[0] - start[1], start[0], end[1] - start[0]), 1.0, _FAR),
    ]


def _squares(vector: Any) -> Any:
    return tuple(a * a for a in vector)


def _regions(item: Object, dtype: Any) -> _Regions:
    """Return regions that contain the primitives of an object at all times."""
    boxes = [_extent(item, shape, dtype) for shape in item.shapes]
    low, high = (jnp.clip(jnp.concatenate(side), -_FAR, _FAR) for side in zip(*boxes, strict=True))
    size = jnp.max(abs(low) + abs(high), axis=1, keepdims=True)
    slack = jnp.where(size < _FAR, _SLACK * size, 0)
    slabs = [_slab(item, shape, len(box[0]), dtype) for shape, box in zip(item.shapes, boxes, strict=True)]
    return _Regions(low - slack, high + slack, *(jnp.concatenate(part) for part in zip(*slabs, strict=True)))


def _slab(item: Object, shape: Shape, count: int, dtype: Any) -> tuple[Array, Array, Array]:
    """Return normals and slabs: those of planes, all of space for other shapes."""
    if not isinstance(shape, Plane) or item.motion is not None or count < shape.count:
        return jnp.zeros((count, 3), dtype), jnp.full(count, -1, dtype), jnp.ones(count, dtype)
    axis = stacked(scaled(components(shape.axis))[1][0])
    normal, point = (jnp.broadcast_to(part, (count, 3)).astype(dtype) for part in (axis, shape.point))
    height, size = jnp.sum(normal * point, axis=1), jnp.sum(abs(normal * point), axis=1)
    return normal, height - _SLACK * size, height + _SLACK * size


def _extent(item: Object, shape: Shape, dtype: Any) -> tuple[Array, Array]:
    """Return boxes of primitives, (n, 3), or one for all of them."""
    low, high = (side.astype(dtype) for side in shape.extent())
    if item.motion is None and low.shape[0] <= _FEW:
        return low, high
    low, high = low.min(axis=0), high.max(axis=0)
    if item.motion is not None:
        reach = getattr(unwrap(item.motion), "reach", None)
        anywhere = jnp.full_like(low, -jnp.inf), jnp.full_like(low, jnp.inf)
        low, high = anywhere if reach is None else reach(low, high)
    return low[None], high[None]


def light_box(light: Any, dtype: Any) -> tuple[Array, Array]:
    """Return the corners of the bounding box of a light with a position."""
    item = light.object()
    if item is None:
        place = jnp.asarray(light.position, dtype)
        return place, place
    low, high = item.shapes[0].bounds(0)
    return low[0].astype(dtype), high[0].astype(dtype)


def _between(light: tuple[Array, Array], box: tuple[Array, Array]) -> _Shaft:
    light = jnp.broadcast_to(light[0], box[0].shape), jnp.broadcast_to(light[1], box[0].shape)
    return _Shaft(light[0], box[0] - light[0], light[1], box[1] - light[1])


def _seen_box(beam: _Shaft, region: _Regions, first: Array, last: Array) -> tuple[Array, Array]:
    """Return the bounding box of a beam in a region, between two parts of the way."""
    first, last = first[..., None], last[..., None]
    lows = [beam.low + beam.low_slope * t for t in (first, last)]
    highs = [beam.high + beam.high_slope * t for t in (first, last)]
    low, high = (jnp.broadcast_to(side, lows[0].shape) for side in (region.low, region.high))
    return jnp.maximum(jnp.minimum(*lows), low), jnp.minimum(jnp.maximum(*highs), high)


def _within(shaft: _Shaft, region: _Regions, start: float, end: float) -> tuple[Array, Array]:
    """Return the first and last t in [start, end] where the boxes may meet the region; reversed if none."""
    first = jnp.full(shaft.low_slope.shape[:-1], start, shaft.low.dtype)
    last = jnp.full_like(first, end)

    def cut(first: Array, last: Array, value: Any, slope: Any, most: Any) -> tuple[Array, Array]:
        """Keep where value + slope t <= most."""
        room = most - value
        t = room / jnp.where(slope == 0, 1, slope)
        never = (slope == 0) & (room < 0)
        last = jnp.where(slope > 0, jnp.minimum(last, t), jnp.where(never, -1, last))
        return jnp.where(slope < 0, jnp.maximum(first, t), first), last

    for j in range(3):
        low, high = shaft.low[..., j], shaft.high[..., j]
        first, last = cut(first, last, low, shaft.low_slope[..., j], region.high[j])
        first, last = cut(first, last, -high, -shaft.high_slope[..., j], -region.low[j])
    normal = jnp.broadcast_to(region.normal, shaft.low.shape)
    up = normal > 0
    lows = jnp.where(up, shaft.low, shaft.high), jnp.where(up, shaft.low_slope, shaft.high_slope)
    highs = jnp.where(up, shaft.high, shaft.low), jnp.where(up, shaft.high_slope, shaft.low_slope)
    (low, low_slope), (high, high_slope) = (
        tuple(jnp.sum(normal * part, axis=-1) for part in parts) for parts in (lows, highs)
    )
    first, last = cut(first, last, low, low_slope, region.most)
    return cut(first, last, -high, -high_slope, -region.least)

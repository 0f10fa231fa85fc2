"""Triangles, still or with moving vertices, and surface area heuristic (SAH) trees over them.

A tree stores no boxes: a program computes them from its vertices, in its precision. Minima and maxima are
exact, so vertices replaced by hand or by an optimiser are hit at their new positions; only the search may
become slower.
"""

from dataclasses import field
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.object import Rays, Shape, rounding
from qmcjax.tracing._shapes.vectors import (
    Vector,
    components,
    cross,
    dot,
    duals,
    largest,
    length,
    minus,
    plus,
    scaled,
    shares,
    times,
)

WORTHWHILE = 48
"""Number of triangles above which compiled traversal of their tree is faster than a loop over all."""

LEAF = 4
"""Maximum number of triangles in a leaf; at least 2, so that there are fewer nodes than triangles."""

_BINS = 16

_DEEP = 32
"""Depth from which nodes are split in halves: no path has more than about 64 nodes."""

_STEP = 1.0
"""Cost of visiting both children, in triangle tests."""


_STEPS = 2.0**30
"""Steps along a mesh in which the builder takes coordinates."""


@frozen_pytree
class Tree:
    """A binary tree in depth-first order: the children of a node are the next node and that node's skip.

    Unused nodes are at the end: the sizes of arrays depend only on the number of triangles. The first skip is
    the number of nodes.
    """

    order: Any
    """int32 (n,): numbers of triangles; those below a node are contiguous."""
    skip: Any
    """int32 (n,): the next node that is not below this one; for a leaf, the next node."""
    start: Any
    """int32 (n,): start of a node's triangles. They end where those of ``skip`` start."""


def build_tree(vertices: Any, close: Any = None) -> Tree:
    """Return the tree of two triangles or more, (n, 3, 3); moving ones are taken half-way.

    All nodes of a level are split at once, each along the axis and at the one of 15 planes with the smallest
    sum of surface area times number of triangles [1]_.

    References
    ----------
    .. [1] I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007.
    """
    middle = vertices if close is None else 0.5 * (np.asarray(vertices) + np.asarray(close))
    corners = np.asarray(middle, np.float64)
    # In whole numbers, lest last bits of coordinates, which depend on the processor, decide between equals.
    corners = np.rint((corners - corners.min()) * (_STEPS / np.ptp(corners)))
    return build_box_tree(corners.min(axis=1), corners.max(axis=1), LEAF)


def build_box_tree(low: NDArray, high: NDArray, most: int) -> Tree:
    """Return the tree of boxes, (n, 3), with up to ``most`` in a leaf, and at least half as many."""
    count = len(low)
    order = np.arange(count)
    start, stop, parent = np.zeros(1, np.int64), np.full(1, count), np.full(1, -1)
    levels: list[tuple[NDArray, NDArray, NDArray]] = []  # starts, parents in the level above, whether split
    while len(start):
        split, side = _sides(low[order], high[order], start, stop, len(levels) >= _DEEP, most)
        levels.append((start, parent, split))
        start, stop = start[split], stop[split]
        # A stable sort by node and side; triangles of leaves stay.
        rows = _runs(start, stop)
        node = np.repeat(np.arange(len(start)), stop - start)
        middle = stop - np.bincount(node, side, len(start)).astype(np.int64)
        seconds = np.cumsum(side) - side
        seconds -= seconds[(np.cumsum(stop - start) - (stop - start))[node]]
        order[np.where(side, middle[node] + seconds, rows - seconds)] = order[rows]
        parent = np.repeat(np.flatnonzero(split), 2)
        start, stop = np.stack([start, middle], 1).reshape(-1), np.stack([middle, stop], 1).reshape(-1)
    return _depth_first(order, levels)


def _runs(start: NDArray, stop: NDArray) -> NDArray:
    """Return all numbers of some ranges, concatenated."""
    length = stop - start
    before = np.cumsum(length) - length
    return np.arange(length.sum()) + np.repeat(start - before, length)


def _sides(
    low: NDArray, high: NDArray, start: NDArray, stop: NDArray, halved: bool, most: int
) -> tuple[NDArray, NDArray]:
    """Return which nodes are split, and which of their triangles go to the second child."""
    length = stop - start
    fewest = max(most // 2, 1)
    split = length >= 2 * fewest
    rows = _runs(start[split], stop[split])
    length = length[split]
    if not len(rows):
        return split, np.zeros(0, bool)
    first, node = np.cumsum(length) - length, np.repeat(np.arange(len(length)), length)
    low, high = low[rows], high[rows]
    center = low + high
    least = np.minimum.reduceat(center, first)
    extent = np.maximum.reduceat(center, first) - least
    scale = _BINS * (1 - 1e-9) / np.where(extent > 0, extent, 1)
    place = ((center - least[node]) * scale[node]).astype(np.int64)
    boxes = np.concatenate([low.T, -high.T])
    cost, axis, plane = np.full(len(length), np.inf), np.zeros(len(length), int), np.zeros(len(length), int)
    for j in range(3):
        costs = _costs(boxes, node, place[:, j], len(length), fewest)
        best = costs.argmin(axis=0)
        here = np.take_along_axis(costs, best[None], 0)[0]
        better = here < cost
        cost, axis, plane = (np.where(better, a, b) for a, b in ((here, cost), (j, axis), (best, plane)))
    whole = _area(np.minimum.reduceat(boxes, first, axis=1))
    side = np.take_along_axis(place, axis[node][:, None], 1)[:, 0] > plane[node]
    # Without a plane, or too deep: in halves along the longest axis.
    some = np.flatnonzero((halved | np.isinf(cost))[node])
    of_some = node[some]
    ranked = some[np.lexsort((center[some, extent.argmax(axis=1)[of_some]], of_some))]
    side[ranked] = some - first[of_some] >= length[of_some] // 2
    worth = (length > most) | (_STEP * whole + cost < length * whole)
    split[split] = worth
    return split, side[worth[node]]


def _costs(boxes: NDArray, node: NDArray, place: NDArray, nodes: int, fewest: int) -> NDArray:
    """Return area times boxes behind each plane of all nodes; infinite if a side has too few.

    The bin is the first axis: numbers of one bin of all nodes are contiguous.
    """
    key = place * nodes + node
    counts = np.bincount(key, minlength=_BINS * nodes).reshape(_BINS, nodes)
    least = np.full((len(boxes), _BINS * nodes), np.inf)
    for bins, values in zip(least, boxes, strict=True):
        np.minimum.at(bins, key, values)
    least = least.reshape(-1, _BINS, nodes)
    total = np.zeros((_BINS - 1, nodes))
    for planes, step in ((total, 1), (total[::-1], -1)):
        box, behind = np.full((len(boxes), nodes), np.inf), np.zeros(nodes, np.int64)
        for plane, some, count in zip(planes, np.moveaxis(least, 1, 0)[::step], counts[::step], strict=False):
            np.minimum(box, some, out=box)
            behind += count
            plane += np.where(behind >= fewest, behind * _area(box), np.inf)
    return total


def _area(box: NDArray) -> NDArray:
    """Return half the surface of boxes, from low and negated high corners; 0 for empty boxes."""
    x, y, z = np.maximum(-box[3:] - box[:3], 0)
    return x * y + y * z + z * x


def _depth_first(order: NDArray, levels: list[tuple[NDArray, NDArray, NDArray]]) -> Tree:
    """Return the tree of nodes by levels, with children in pairs in the order of their parents."""
    below: list[NDArray] = []
    size = np.zeros(0, np.int64)
    for _, _, split in reversed(levels):
        own = np.ones(len(split), np.int64)
        own[split] += size.reshape(-1, 2).sum(axis=1)
        below.insert(0, own)
        size = own
    count, used = len(order), int(below[0][0])
    room = max(count, used + 1)
    skip, start = np.full(room, used, np.int32), np.full(room, count, np.int32)
    number = np.zeros(1, np.int64)
    for (starts, parent, _), sizes in zip(levels, below, strict=True):
        if parent[0] >= 0:
            number = number[parent] + 1
            number[1::2] += sizes[::2]
        skip[number], start[number] = number + sizes, starts
    return Tree(order.astype(np.int32), skip, start)


class _Sheared(NamedTuple):
    """Linear maps from the directions of rays to (0, 0, 1)."""

    rays: Rays
    x: Vector
    y: Vector
    z: Vector


@frozen_pytree
class Triangles(Shape):
    """Triangles with normals along (b - a) x (c - a). u and v are the weights of b and c."""

    vertices: Any
    """(n, 3, 3): triangle, vertex a, b or c, coordinate; when the shutter opens."""
    close: Any
    """(n, 3, 3): when it closes; None for still triangles. Vertices move on straight lines between."""
    tree: Any = field(default=None, metadata={"derived": True})
    """A tree over many triangles; None if a loop over all of them is as fast."""

    @property
    def moving(self) -> bool:
        return self.close is not None

    def at(self, time: Any) -> "Triangles":
        if self.close is None:
            return self
        return Triangles((1 - time) * self.vertices + time * self.close, None, self.tree)

    def alone(self) -> "Triangles":
        return Triangles(self.vertices, self.close)

    def _corners(self, number: Any, time: Any) -> list[Vector]:
        corners = [components(self.vertices[number, j]) for j in range(3)]
        if self.close is None:
            return corners
        ends = [components(self.close[number, j]) for j in range(3)]
        return [plus(times(1 - time, a), times(time, b)) for a, b in zip(corners, ends, strict=True)]

    def prepare(self, rays: Rays) -> _Sheared:
        return _Sheared(rays, *shear_maps(rays.direction))

    def distance(self, number: Any, prepared: _Sheared) -> Array:
        """Return distances by three signed areas in the plane perpendicular to the ray.

        For a shared edge, the sign of its area follows from a comparison of the same two rounded products.
        Rounding keeps their order, but may make them equal; then the ray hits both triangles. So every hit of
        the mesh with the sheared vertices in exact arithmetic is a hit here [1]_.

        References
        ----------
        .. [1] S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", 2013.
        """
        rays = prepared.rays
        corners = self._corners(number, rays.time)
        size = largest(corners[0]) + largest(corners[1]) + largest(corners[2])
        slack = rays.slack + rounding(size)
        a, b, c = (minus(corner, rays.origin) for corner in corners)
        off = ~_origin_on(a, minus(corners[1], corners[0]), minus(corners[2], corners[0]), slack)
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (
            (dot(prepared.x, v), dot(prepared.y, v), dot(prepared.z, v)) for v in (a, b, c)
        )
        # Not the signs of differences: one that becomes a fused multiply-add can be above 0 for the triangles
        # on both sides of the edge.
        pairs = (cx * by, cy * bx), (ax * cy, ay * cx), (bx * ay, by * ax)
        left, right = True, True
        for one, other in pairs:
            left, right = left & (one >= other), right & (one <= other)
        u, v, w = (one - other for one, other in pairs)
        total = u + v + w
        distance = (u * az + v * bz + w * cz) / jnp.where(total == 0, 1, total)
        # For a triangle seen edge-on the areas are rounding; the distance remains that of a vertex.
        distance = jnp.maximum(distance, jnp.minimum(jnp.minimum(az, bz), cz))
        distance = jnp.minimum(distance, jnp.maximum(jnp.maximum(az, bz), cz))
        return jnp.where((left | right) & off & (total != 0) & (distance > 0), distance, jnp.inf)

    def surface(self, number: Any, point: Vector, time: Any) -> tuple[Array, Vector]:
        a, b, c = self._corners(number, time)
        normal = cross(*scaled(minus(b, a), minus(c, a))[1])
        return dot(minus(point, a), normal), normal

    def coordinates(self, number: Any, point: Vector, time: Any) -> tuple[Array, Array]:
        a, b, c = self._corners(number, time)
        scale, (one, other) = scaled(minus(b, a), minus(c, a))
        start = times(scale, minus(point, a))
        u, v = shares(start, one, other)
        return jnp.clip(u, 0, 1), jnp.clip(v, 0, 1)

    def bounds(self, time: float) -> tuple[Array, Array]:
        corners = self.vertices
        if self.close is not None:
            corners = (1 - time) * corners + time * self.close
        return corners.min(axis=1), corners.max(axis=1)


def shear_maps(direction: Vector) -> tuple[Vector, Vector, Vector]:
    """Return maps of space, by rows, from directions to (0, 0, 1).

    They keep one or two coordinates, along the largest component of the direction: coefficients of zero and
    one make exact products.
    """
    x, y, z = direction
    along_z = (abs(z) >= abs(x)) & (abs(z) >= abs(y))
    along_x = ~along_z & (abs(x) >= abs(y))
    along_y = ~along_z & ~along_x

    def chosen(first: Any, second: Any, third: Any) -> Array:
        return jnp.where(along_x, first, jnp.where(along_y, second, third))

    most = chosen(x, y, z)
    inverse = 1 / jnp.where(most == 0, 1, most)
    one = jnp.ones_like(x)
    zero = jnp.zeros_like(x)
    shear_x, shear_y = -chosen(y, z, x) * inverse, -chosen(z, x, y) * inverse
    return (
        (chosen(shear_x, zero, one), chosen(one, shear_x, zero), chosen(zero, one, shear_x)),
        (chosen(shear_y, one, zero), chosen(zero, shear_y, one), chosen(one, zero, shear_y)),
        (chosen(inverse, zero, zero), chosen(zero, inverse, zero), chosen(zero, zero, inverse)),
    )


def _origin_on(corner: Vector, one: Vector, other: Vector, slack: Any) -> Array:
    """Return whether origins are on triangles.

    Being near their planes is not enough: a ray in the plane of a triangle that starts beside it would miss
    it, and then slip through the silhouette of a mesh.
    """
    scale, (one, other) = scaled(one, other)
    corner, slack, normal = times(scale, corner), scale * slack, cross(one, other)
    p, q = duals(one, other)
    u, v = -dot(corner, p), -dot(corner, q)
    wider = slack * (length(p) + length(q))
    height = dot(normal, corner)
    near = (u >= -wider) & (v >= -wider) & (u + v <= 1 + wider)
    return near & (height * height <= slack * slack * dot(normal, normal))

"""Tree traversal as a JAX program: the rays of a tile step from node to node together."""

from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._search.tiles import by_tiles
from qmcjax.tracing._shapes.shape_batches import Rays, rounding
from qmcjax.tracing._shapes.triangle_tree import Tree
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import components, each, minus

TILE = 1024
"""Rays that traverse together on a processor: they wait for the slowest of them."""


def walk(shape: Triangles, rays: Rays, limit: Array, any_hit: bool) -> tuple[Array, Array]:
    """Return the distances of hits before the limits, and the rows of the triangles; -1 without a hit."""
    tree = jax.tree.map(lambda a: a.astype(jnp.int32), shape.tree)
    ends = [shape.vertices] if shape.close is None else [shape.vertices, shape.close]
    ends = [vertices[tree.order] for vertices in ends]
    boxes = jnp.concatenate([boxes_of(vertices, tree) for vertices in ends], axis=1)
    sorted_faces = Triangles(ends[0], None if shape.close is None else ends[1])
    largest = 2 * jnp.max(jnp.stack([jnp.max(abs(vertices)) for vertices in ends]))
    used = tree.skip[0]
    stop = tree.start[jnp.minimum(tree.skip, shape.count - 1)]

    def tile(given: tuple[Rays, Array]) -> tuple[Array, Array]:
        rays, limit = given
        prepared = sorted_faces.prepare(rays)
        wider = rays.slack + rounding(largest)
        below, above = each(lambda a: a - wider, rays.origin), each(lambda a: a + wider, rays.origin)
        inverse = each(lambda d: 1 / d, rays.direction)
        slower = 1 + 8 * jnp.finfo(limit.dtype).eps

        def meets(node: Array, limit: Array) -> Array:
            box = boxes[node]
            if len(ends) == 2:
                time = rays.time[:, None]
                box = (1 - time) * box[:, :6] + time * box[:, 6:]
            enter, leave = jnp.zeros_like(limit), limit * slower
            low, high = minus(components(box[:, :3]), above), minus(components(box[:, 3:]), below)
            for one, other, factor in zip(low, high, inverse, strict=True):
                one, other = one * factor, other * factor
                near, far = jnp.minimum(one, other), jnp.maximum(one, other)
                # NaN, of a ray in the plane of a face, is inside.
                enter, leave = jnp.where(near > enter, near, enter), jnp.where(far < leave, far, leave)
            return (enter <= leave * slower) & (leave > 0)

        def step(state: Any) -> Any:
            """Process the current node, or the triangle of a leaf, and go to the next one.

            The node is part of the state: XLA would compute it again for each result that uses it.
            """
            node, row, inside, distance, limit, place = state
            skip, last = tree.skip[node], stop[node]
            leaf, tested, more = skip == node + 1, row >= 0, row + 1 < last
            closer = tested & (distance < limit)
            limit = jnp.where(closer, -jnp.inf if any_hit else distance, limit)
            place = jnp.where(closer, row, place)
            enters = ~tested & inside
            next_node = jnp.where(
                enters, jnp.where(leaf, node, node + 1), jnp.where(tested & more, node, skip)
            )
            next_row = jnp.where(
                tested, jnp.where(more, row + 1, -1), jnp.where(enters & leaf, tree.start[node], -1)
            )
            seen = jnp.minimum(next_node, shape.count - 1)
            return (
                next_node,
                next_row,
                meets(seen, state[4]) & (next_node < used),
                sorted_faces.distance(jnp.maximum(next_row, 0), prepared),
                limit,
                place,
            )

        # All rays enter the root, except those that can hit nothing.
        inside = jnp.isfinite(rays.slack) & (limit > 0)
        none = jnp.full(limit.shape, -1, jnp.int32)
        state = jnp.zeros_like(none), none, inside, limit, limit, none
        *_, limit, place = jax.lax.while_loop(lambda state: jnp.any(state[0] < used), step, state)
        return limit, jnp.where(place < 0, -1, tree.order[place])

    return by_tiles(tile, (rays, limit), TILE)


def boxes_of(vertices: Array, tree: Tree) -> Array:
    """Return the bounding boxes of all nodes, low and high, shape (n, 6).

    The triangles of a node are one run; its minimum is that of two overlapping runs of a power of 2.
    """
    count = vertices.shape[0]
    levels = [jnp.concatenate([vertices.min(axis=1), -vertices.max(axis=1)], axis=1)]
    for k in range(count.bit_length() - 1):
        half = levels[-1]
        levels.append(jnp.minimum(half, jnp.concatenate([half[2**k :], half[-(2**k) :]])))
    least = jnp.stack(levels).reshape(-1, 6)
    start = jnp.minimum(tree.start, count - 1)
    stop = tree.start[jnp.minimum(tree.skip, count - 1)]
    level = 31 - jax.lax.clz(jnp.maximum(stop - start, 1))
    last = jnp.maximum(stop - jnp.left_shift(1, level), 0)
    found = jnp.minimum(least[level * count + start], least[level * count + last])
    return jnp.concatenate([found[:, :3], -found[:, 3:]], axis=1)

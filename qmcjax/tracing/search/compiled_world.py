"""Ray intersection as a call from a program to loops compiled by Numba.

The call uses ``buffer_callback``, which passes the memory of the program. ``jax.pure_callback`` copies to a
device: that waits for a thread, and deadlocks if all threads run programs that wait for such calls (seen in
JAX 0.10 on one core, and where devices share a program).

A call builds the trees: those of meshes get boxes for the current vertices, and primitives without a tree get
one. The next call reuses them if it gets the same
numbers. Rays are searched in pieces, by threads as they become free. OpenMP threads, the default of Numba,
get equal parts: on a loaded CPU all wait for the slowest in a busy loop, eight times as long as one thread
takes.
"""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.experimental.buffer_callback import buffer_callback
from numpy.typing import NDArray

from qmcjax.tracing._shapes.object import Frame
from qmcjax.tracing._shapes.primitives import Box, Cylinder, Disc, Plane, Rectangle, Sphere
from qmcjax.tracing._shapes.shape_batches import SLACK, Shape
from qmcjax.tracing._shapes.triangles import Triangles, build_box_tree
from qmcjax.tracing._shapes.vectors import Vector
from qmcjax.tracing._world.world import World, merge_kinds


@cache
def _helpers() -> tuple[int, ThreadPoolExecutor | None]:
    """Return the number of helper threads, and the pool."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return count - 1, ThreadPoolExecutor(count - 1, "qmcjax") if count > 1 else None


def share_work(work: Callable[[Any], None], pieces: Iterable[Any]) -> None:
    """Do all pieces of work, which release the GIL, in this thread and in others as they become free."""
    pieces = list(pieces)
    left = iter(pieces)  # The next of a list is one step for all threads.

    def some() -> None:
        for piece in left:
            work(piece)

    count, pool = _helpers()
    helping = [pool.submit(some) for _ in pieces[1 : count + 1]] if pool is not None else []
    some()
    for helper in helping:
        # A helper that has not started would find nothing to do.
        if not helper.cancel():
            helper.result()


KINDS = (Plane, Rectangle, Disc, Box, Sphere, Cylinder, Triangles)
"""Shapes that the loops support, in the order of their numbers there."""


_RUN = 2048
"""Rays per piece of work of a thread."""


class _Plan(NamedTuple):
    """The structure of a world, known before its numbers."""

    frames: list[int]
    """For each space the index of its frame; -1 for the still space."""
    kinds: NDArray[np.int32]
    """All primitives without a tree, in the order of their numbers."""
    numbers: NDArray[np.int32]
    members: list[NDArray[np.int64]]
    """The primitives of each space."""
    meshes: list[tuple[int, int]]
    """The space of each mesh with a tree, and the number of its first triangle."""


class _CachedTrees:
    """The trees of a world, cached for the next call, since a program often passes the same numbers again."""

    def __init__(self, plan: _Plan) -> None:
        self._plan = plan
        self._last: Any = None

    def __call__(self, shapes: Any, number: np.dtype, unit: Any) -> Any:
        given, last = jax.tree.leaves(shapes), self._last
        if last is None or not all(map(np.array_equal, last[0], given)):
            last = self._last = [a.copy() for a in given], _build(self._plan, shapes, number, unit)
        return last[1]


def search(
    world: World,
    frames: Sequence[Frame | None],
    origin: Vector,
    direction: Vector,
    time: Array,
    limit: Array,
    any_hit: bool,
) -> tuple[Array, Array]:
    """Return distances and numbers of the nearest hits before limits; the limits and -1 without a hit."""
    plan, shapes = _plan_world(world)
    # Passed separately: one array of all takes XLA twice as long.
    moving = [(frame.duals, frame.translation) for frame in frames if frame is not None]
    result = jax.ShapeDtypeStruct(limit.shape, limit.dtype), jax.ShapeDtypeStruct(limit.shape, jnp.int32)
    call = buffer_callback(partial(_fill, _CachedTrees(plan), any_hit), result, vmap_method="expand_dims")
    return call(*jax.lax.stop_gradient((shapes, moving, (*origin, *direction, time, limit))))


def _plan_world(world: World) -> tuple[_Plan, Any]:
    """Return the plan of a world, and its numbers."""
    frames: list[int] = []
    moving = 0
    batches, meshes, given = [], [], []
    for item, number in world.numbered():
        frame = -1 if item.motion is None else moving
        moving += item.motion is not None
        if frame not in frames:
            frames.append(frame)
        space = frames.index(frame)
        for shape, first in item.numbered(number):
            if not isinstance(shape, Triangles) or shape.tree is None:
                batches.append((shape, space, first))
            else:
                meshes.append((space, first))
                ends = [] if shape.close is None else [shape.close]
                tree = [
                    part.astype(jnp.int32) for part in (shape.tree.order, shape.tree.skip, shape.tree.start)
                ]
                given.append(([shape.vertices, *ends], tree))
    rows, kinds, names, spaces = [], [], [], []
    for shape, places in merge_kinds([shape for shape, _, _ in batches]):
        rows.append(_shape_numbers(shape))
        for place in places:
            one, space, number = batches[place]
            kinds.append(np.full(one.count, KINDS.index(type(shape)) + shape.moving, np.int32))
            names.append(np.arange(number, number + one.count, dtype=np.int32))
            spaces.append(np.full(one.count, space))
    kinds, names, spaces = (
        np.concatenate([np.zeros(0, np.int32), *parts]) for parts in (kinds, names, spaces)
    )
    members = [np.flatnonzero(spaces == space) for space in range(len(frames))]
    primitives = [jnp.concatenate(rows)] if rows else []
    return _Plan(frames, kinds, names.astype(np.int32), members, meshes), (primitives, given)


def _shape_numbers(shape: Shape) -> Array:
    """Return the numbers of primitives, 9, those at the end of the shutter, and their boxes: (n, 24)."""
    parts = [part.reshape(shape.count, -1) for part in jax.tree.leaves(shape)]
    numbers = jnp.concatenate(parts, axis=1)
    numbers = jnp.pad(numbers, ((0, 0), (0, 18 - numbers.shape[1])))
    return jnp.concatenate([numbers, *shape.extent()], axis=1)


def _fill(trees: _CachedTrees, any_hit: bool, context: Any, out: Any, *given: Any) -> None:
    shapes, frames, rays = jax.tree.map(np.asarray, given)
    frames = jax.tree.leaves(frames)
    for to, result in zip(out, _search_worlds(trees, shapes, frames, rays, any_hit), strict=True):
        np.asarray(to)[...] = result


def _search_worlds(
    trees: _CachedTrees, shapes: Any, frames: Any, rays: Any, any_hit: bool
) -> tuple[Any, Any]:
    """Search in one world, or in several under vmap."""
    primitives, meshes = shapes
    leading = [a.shape[:-2] for a in primitives]
    for ends, tree in meshes:
        leading += [a.shape[:-3] for a in ends] + [a.shape[:-1] for a in tree]
    worlds = np.broadcast_shapes(*leading)
    mapped = np.broadcast_shapes(worlds, *(a.shape[:-1] for a in (*frames, *rays)))

    def at(a: Any, axes: int, index: Any) -> Any:
        return np.broadcast_to(a, mapped + a.shape[a.ndim - axes :])[index]

    def world(index: Any) -> Any:
        return [at(a, 2, index) for a in primitives], [
            ([at(a, 3, index) for a in ends], [at(a, 1, index) for a in tree]) for ends, tree in meshes
        ]

    if max(worlds, default=1) == 1:
        # All rays at once.
        frames, rays = (
            [np.broadcast_to(a, (*mapped, a.shape[-1])).reshape(-1) for a in given]
            for given in (frames, rays)
        )
        results = [_search_world(trees, world((0,) * len(mapped)), frames, rays, any_hit)]
    else:
        results = [
            _search_world(
                trees,
                world(index),
                [at(a, 1, index) for a in frames],
                [at(a, 1, index) for a in rays],
                any_hit,
            )
            for index in np.ndindex(mapped)
        ]
    distance, row = (np.stack(a).reshape(*mapped, -1) for a in zip(*results, strict=True))
    return distance, row


def _search_world(trees: _CachedTrees, shapes: Any, frames: Any, rays: Any, any_hit: bool) -> tuple[Any, Any]:
    from qmcjax.tracing.search import compiled_loops as loops  # Only where numba is installed.

    number, count = rays[-1].dtype, len(rays[-1])
    unit = number.type(SLACK * np.finfo(number).eps)
    world = trees(shapes, number, unit)
    distances, numbers = np.empty(count, number), np.empty(count, np.int32)

    def run(first: int) -> None:
        these = slice(first, first + _RUN)
        frame, given = np.empty((len(frames), len(distances[these])), number), tuple(a[these] for a in rays)
        for to, part in zip(frame, frames, strict=True):
            to[:] = part[these]
        scratch = (
            np.empty(loops.STACK, np.int64),
            np.empty(loops.STACK, number),
            np.empty((1, loops.WIDTH), number),
        )
        loops.search(world, frame, given, unit, any_hit, scratch, distances[these], numbers[these])

    share_work(run, range(0, count, _RUN))
    return distances, numbers


def _build(plan: _Plan, shapes: Any, number: np.dtype, unit: Any) -> Any:
    """Return the ``World`` of compiled loops."""
    from qmcjax.tracing.search import compiled_nodes as wide
    from qmcjax.tracing.search.compiled_tests import MOVING, TRIANGLE, WIDTH

    given, meshes = shapes
    moves = [len(ends) == 2 for ends, _ in meshes]
    counts = [ends[0].shape[0] for ends, _ in meshes]
    alone, size = len(plan.kinds), len(plan.kinds) + sum(counts)
    nodes = np.empty((wide.NODE * size, wide.WIDTH), number)
    blocks = np.empty((wide.BLOCK * sum(counts), wide.WIDTH), number)
    closed, last = (np.empty_like(a if any(moves) else a[:1]) for a in (blocks, nodes))
    spaces, roots, sizes = np.empty((len(plan.members), 6), np.int64), [], []
    world = wide.World(
        rows=np.empty((alone, WIDTH), number),
        # A space without moving primitives gets one row that no primitive uses.
        ends=np.empty((alone if MOVING in plan.kinds else 1, WIDTH), number),
        codes=np.empty(alone, np.int8),
        numbers=np.empty(alone, np.int32),
        blocks=blocks,
        closed=closed,
        faces=np.empty(sum(counts) * wide.WIDTH, np.int32),
        nodes=nodes,
        last=last,
        links=nodes.view(np.int32 if number == np.float32 else np.int64),
        spaces=spaces,
        trees=np.empty((len(plan.members) + len(meshes), 3), np.int64),
        slacks=np.empty(len(plan.members) + len(meshes), number),
    )
    first = node = block = 0
    for place, members in enumerate(plan.members):
        begin, tree, stop = first, len(roots), first + len(members)
        if len(members):
            primitives = wide.Primitives(np.ascontiguousarray(given[0]), plan.kinds, plan.numbers)
            run, inside, parts = _primitive_tree(primitives.given[:, 18:], members)
            root = node
            largest, node = wide.insert_primitives(primitives, run, parts, unit, first, node, world)
            if inside:
                roots.append((wide.NODE * root, 0, 0))
                sizes.append(unit * 2 * largest)
            begin, first = first + inside, stop
        for (space, start), moving, (vertices, tree_of) in zip(plan.meshes, moves, meshes, strict=True):
            if space != place:
                continue
            corners = [np.ascontiguousarray(a).reshape(-1, 9) for a in vertices]
            close = corners[1] if moving else np.empty((0, 9), number)
            mesh = wide.Mesh(corners[0], close, *map(np.ascontiguousarray, tree_of))
            roots.append((wide.NODE * node, 1, int(moving)))
            before = block
            largest, block, node = wide.build_mesh_tree(mesh, world, block, node)
            world.faces[wide.WIDTH * before : wide.WIDTH * block] += start
            sizes.append(unit * 2 * largest)
        triangles = bool((plan.kinds[members] >= TRIANGLE).any()) or any(
            space == place for space, _ in plan.meshes
        )
        spaces[place] = plan.frames[place], begin, stop, tree, len(roots), triangles
    world.trees[: len(roots)], world.slacks[: len(sizes)] = np.reshape(roots, (-1, 3)), sizes
    return world


def _primitive_tree(bounds: NDArray, members: NDArray) -> tuple[NDArray, int, tuple[NDArray, NDArray]]:
    """Return primitives in the order of a tree over those with finite boxes, their number, and the tree."""
    finite = np.isfinite(bounds[members]).all(axis=1)
    inside, outside = members[finite], members[~finite]
    if not len(inside):
        return outside, 0, (np.zeros(1, np.int32), np.zeros(1, np.int32))
    boxes = np.asarray(bounds[inside], np.float64)
    tree = build_box_tree(boxes[:, :3], boxes[:, 3:], 1)
    return np.concatenate([inside[tree.order], outside]), len(inside), (tree.skip, tree.start)

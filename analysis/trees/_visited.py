"""Counts of the tree nodes that rays visit, for all rays at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees._structure import (
    Tree,
    flat_rays,
    flat_times,
    interval_of_time,
    node_depths,
    validate_tree,
)
from qmcjax.core import checks
from qmcjax.core.parameters import known, require

Distances = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.float64]]
Visit = Callable[[NDArray[np.int64], NDArray[np.int64]], object]


def nodes_visited(
    tree: Tree,
    origin: ArrayLike,
    direction: ArrayLike,
    distance: Distances | None = None,
    *,
    time: ArrayLike | None = None,
    nearest_first: bool = True,
    visit: Visit | None = None,
) -> NDArray[np.int64]:
    """Count the nodes, including leaves, whose boxes rays enter during traversal: int64 (...).

    If both children are hit, the one whose box the ray enters first is visited first [1]_, [2]_. Boxes behind
    the nearest hit are skipped.

    Parameters
    ----------
    tree : Tree
    origin, direction : float ArrayLike, shape (..., 3)
        Directions need not be normalized.
    distance : callable, optional
        Returns distances of hits in leaves, in units of the directions' lengths, inf without a hit: from
        numbers of rays in flattened order and numbers of leaves, both int64 (m,), to float (m,). See
        :func:`triangle_distances`. Without it nothing is hit, and all nodes in front of the origin count.
    time : float ArrayLike, shape (...), optional
        Times of the rays, required for trees of boxes that move or have an interval of time.
    nearest_first : bool, optional
        False: of two children that are hit, the first is the one that comes first in the direction of the
        ray, along the axis on which their centres are farthest apart.
    visit : callable, optional
        Called at each step of the traversal with numbers of rays in flattened order and the node that each
        of them visits, both int64 (m,). A ray's nodes come in the order of its visits.

    References
    ----------
    .. [1] T. Kay, J. Kajiya, "Ray Tracing Complex Scenes", 1986.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.3.

    Examples
    --------
    >>> from analysis.trees import surface_area_tree
    >>> tree = surface_area_tree([[0, 0, 0], [2, 0, 0]], [[1, 1, 1], [3, 1, 1]])
    >>> print(nodes_visited(tree, [[0.5, 0.5, -1], [-1, 0.5, 0.5]], [[0, 0, 1], [1, 0, 0]]))
    [2 3]
    """
    validate_tree(tree)
    checks.flag("nearest_first", nearest_first)
    if distance is not None:
        checks.function("distance", distance, "of numbers of rays and of leaves", 2)
    if visit is not None:
        checks.function("visit", visit, "of numbers of rays and of nodes", 2)
    shape, start, toward = flat_rays(origin, direction)
    timed = tree.times is not None or tree.low.shape[-1] == 4
    if timed and time is None:
        raise TypeError("time must be given for boxes that move or exist for a part of the time, got None")
    when = flat_times(time, shape) if timed else np.zeros(len(start))
    if not len(start):
        return np.zeros(shape, np.int64)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        inverse = 1 / toward
        inverse[np.isinf(inverse)] = np.inf
        first = None if nearest_first else _along_axes(tree, inverse)
        return _count(tree, start, inverse, when, distance, first, visit).reshape(shape)


def _along_axes(tree: Tree, inverse: NDArray) -> Callable[[NDArray, NDArray], NDArray[np.bool_]]:
    """Return a function that tells whether rays come to the first child of nodes first, by an axis."""
    center = tree.low[..., :3] + tree.high[..., :3]
    center = center if tree.times is None else center.mean(axis=0)
    apart = center[tree.children[:, 1]] - center[tree.children[:, 0]]
    axis = abs(apart).argmax(axis=1)
    sign = np.take_along_axis(apart, axis[:, None], axis=1)[:, 0] < 0

    def first(rays: NDArray, nodes: NDArray) -> NDArray[np.bool_]:
        at = nodes - tree.size
        return (inverse[rays, axis[at]] < 0) == sign[at]

    return first


def _count(
    tree: Tree,
    start: NDArray,
    inverse: NDArray,
    when: NDArray,
    distance: Distances | None,
    is_first: Callable[[NDArray, NDArray], NDArray[np.bool_]] | None,
    visit: Visit | None,
) -> NDArray[np.int64]:
    rays = len(start)
    count, limit = np.zeros(rays, np.int64), np.full(rays, np.inf)
    room = int(node_depths(tree).max()) + 1
    waiting, entry = np.zeros((rays, room), np.int32), np.zeros((rays, room))
    top = np.zeros(rays, np.int64)
    root = 2 * tree.size - 2
    enters = _entries(tree, start, inverse, when)
    everybody = np.arange(rays)
    active = everybody[enters(everybody, np.full(rays, root)) < np.inf]
    node = np.full(len(active), root)
    while len(active):
        count[active] += 1
        if visit is not None:
            visit(active, node)
        leaf = node < tree.size
        if distance is not None and leaf.any():
            here = active[leaf]
            limit[here] = np.minimum(limit[here], _validate_distances(distance(here, node[leaf]), len(here)))
        inside, below = active[~leaf], tree.children[node[~leaf] - tree.size]
        first, second = enters(np.tile(inside, 2), below.T.ravel()).reshape(2, -1)
        nearer = first <= second if is_first is None else is_first(inside, node[~leaf])
        near, far = np.where(nearer, first, second), np.where(nearer, second, first)
        both = np.maximum(first, second) < limit[inside]
        ahead = np.where(nearer, below[:, 0], below[:, 1])
        rest = np.where(nearer, below[:, 1], below[:, 0])
        some = inside[both]
        waiting[some, top[some]], entry[some, top[some]] = rest[both], far[both]
        top[some] += 1
        goes = np.minimum(first, second) < limit[inside]
        on, next_node = inside[goes], np.where(near < limit[inside], ahead, rest)[goes]
        # The others pop from their stacks, until a node is not behind their hit.
        back = np.concatenate([active[leaf], inside[~goes]])
        taken, nodes = [on], [next_node]
        while len(back := back[top[back] > 0]):
            top[back] -= 1
            good = entry[back, top[back]] < limit[back]
            taken.append(back[good])
            nodes.append(waiting[back[good], top[back[good]]])
            back = back[~good]
        active, node = np.concatenate(taken), np.concatenate(nodes).astype(np.int64)
    return count


def _entries(
    tree: Tree, start: NDArray, inverse: NDArray, when: NDArray
) -> Callable[[NDArray, NDArray], NDArray[np.float64]]:
    """Return a function for the distances at which rays enter the boxes of nodes: inf without a hit."""
    span, part = interval_of_time(tree.times, when)
    along_sides = np.isinf(inverse).any()

    def corners(rays: NDArray, nodes: NDArray) -> tuple[NDArray, NDArray]:
        if tree.times is None:
            return tree.low[nodes], tree.high[nodes]
        early, share = span[rays], part[rays, None]
        low, high = (
            (1 - share) * a[early, nodes] + share * a[early + 1, nodes] for a in (tree.low, tree.high)
        )
        return low, high

    def entries(rays: NDArray, nodes: NDArray) -> NDArray[np.float64]:
        low, high = corners(rays, nodes)
        one, other = ((a[:, :3] - start[rays]) * inverse[rays] for a in (low, high))
        if along_sides:  # In the plane of a side, 0 times infinity: such a ray touches the box.
            one, other = np.where(np.isnan(one), -np.inf, one), np.where(np.isnan(other), np.inf, other)
        near = np.maximum(np.minimum(one, other).max(axis=1), 0)
        hit = near <= np.maximum(one, other).min(axis=1)
        if low.shape[1] == 4:
            hit &= (low[:, 3] <= when[rays]) & (when[rays] <= high[:, 3])
        return np.where(hit, near, np.inf)

    return entries


def _validate_distances(found: Any, count: int) -> NDArray[np.float64]:
    """Return the checked result of a user's ``distance``."""
    found = known("the result of distance", found)
    if found.shape != (count,):
        raise ValueError(f"distance must return distances of shape ({count},), got {found.shape}")
    require("the result of distance", found, lambda d: ~np.isnan(d), "no NaN")
    return found


def triangle_distances(
    vertices: ArrayLike,
    origin: ArrayLike,
    direction: ArrayLike,
    *,
    times: ArrayLike | None = None,
    time: ArrayLike | None = None,
    number: ArrayLike | None = None,
) -> Distances:
    """Return the function ``distance`` of :func:`nodes_visited` for triangles.

    Parameters
    ----------
    vertices : float ArrayLike, shape (n, 3, 3) or (k, n, 3, 3)
        Axes are triangle, vertex and coordinate; for moving triangles, at each of ``times``, linear in
        between.
    origin, direction : float ArrayLike, shape (..., 3)
        Of rays.
    times : float ArrayLike, shape (k,), optional
        Increasing, two or more, for moving triangles.
    time : float ArrayLike, shape (...), optional
        Times of the rays, for moving triangles.
    number : int ArrayLike, shape (m,), optional
        The triangle in each leaf; leaf i has triangle i by default.

    References
    ----------
    .. [1] T. Moeller, B. Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", 1997.

    Examples
    --------
    >>> distance = triangle_distances([[[0, 0, 5], [1, 0, 5], [0, 1, 5]]], [0.2, 0.2, 0], [0, 0, 1])
    >>> print(distance(np.array([0]), np.array([0])))
    [5.]
    """
    moving = times is not None
    corners = known("vertices", vertices)
    axes = 4 if moving else 3
    if corners.ndim != axes or corners.shape[-2:] != (3, 3) or 0 in corners.shape:
        wanted = "(k, n, 3, 3)" if moving else "(n, 3, 3)"
        raise ValueError(f"vertices must have shape {wanted}, got {corners.shape}")
    require("vertices", corners, np.isfinite, "finite")
    shape, start, toward = flat_rays(origin, direction)
    numbers = None
    if number is not None:
        numbers = checks.known_array("number", number, np.integer, "integers")
        last = corners.shape[-3] - 1
        require("number", numbers, lambda a: (a >= 0) & (a <= last), f"in [0, {last}]")
    span, part = np.zeros(0, np.int64), np.zeros(0)
    if times is not None:
        knots = known("times", times)
        if knots.shape != (len(corners),) or len(knots) < 2:
            raise ValueError(f"times must have shape ({len(corners)},), and two or more, got {knots.shape}")
        require("times", knots, lambda t: np.isfinite(t).all() and (t[1:] > t[:-1]).all(), "increasing")
        if time is None:
            raise TypeError("time must be given for triangles that move, got None")
        span, part = interval_of_time(knots, flat_times(time, shape))

    def distances(rays: NDArray[np.int64], leaves: NDArray[np.int64]) -> NDArray[np.float64]:
        at = leaves if numbers is None else numbers[leaves]
        if moving:
            early, share = span[rays], part[rays, None, None]
            found = (1 - share) * corners[early, at] + share * corners[early + 1, at]
        else:
            found = corners[at]
        return _distances(found, start[rays], toward[rays])

    return distances


def _distances(corners: NDArray, start: NDArray, way: NDArray) -> NDArray[np.float64]:
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    across = np.cross(way, c - a)
    scale = np.sum((b - a) * across, axis=1)
    inverse = 1 / np.where(scale == 0, 1, scale)
    u = np.sum((start - a) * across, axis=1) * inverse
    beside = np.cross(start - a, b - a)
    v = np.sum(way * beside, axis=1) * inverse
    distance = np.sum((c - a) * beside, axis=1) * inverse
    hit = (scale != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    return np.where(hit, distance, np.inf)

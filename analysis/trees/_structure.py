"""Axis-aligned boxes, and binary trees of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import known, require
from qmcjax.core.pytrees import pytree

_LARGEST = 1e75
"""Largest absolute value for which areas and their sums are finite."""


def still_boxes(low: Any, high: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of boxes, (n, 3), or (n, 4) with time as fourth coordinate, or raise."""
    return _validate_corners(
        low, high, "(n, 3) or (n, 4)", lambda s: len(s) == 2 and s[0] > 0 and s[1] in (3, 4)
    )


def moving_boxes(
    low: Any, high: Any, times: Any
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of boxes at some times, (k, n, 3), and the times, (k,), or raise."""
    low, high = _validate_corners(
        low, high, "(k, n, 3)", lambda s: len(s) == 3 and s[0] > 1 and s[1] > 0 and s[2] == 3
    )
    times = known("times", times)
    if times.shape != (len(low),):
        raise ValueError(f"times must have shape ({len(low)},), one for each of the boxes, got {times.shape}")
    require(
        "times", times, lambda t: np.isfinite(t).all() and (t[1:] > t[:-1]).all(), "finite and increasing"
    )
    return low, high, times


def _validate_corners(
    low: Any, high: Any, wanted: str, fits: Any
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = known("low", low), known("high", high)
    for name, array in (("low", low), ("high", high)):
        if not fits(array.shape):
            raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")
        require(name, array, lambda a: abs(a) <= _LARGEST, f"finite, and between -{_LARGEST} and {_LARGEST}")
    if low.shape != high.shape:
        raise ValueError(f"high must have the shape of low, {low.shape}, got {high.shape}")
    if not (low <= high).all():
        raise ValueError(f"high must be at least low, got {int((low > high).sum())} coordinates below it")
    return low, high


def surface_area(low: ArrayLike, high: ArrayLike) -> NDArray[np.float64]:
    """Return the surface areas of boxes, proportional to the probability that a uniform line hits them.

    Parameters
    ----------
    low, high : float ArrayLike, shape (..., 3)
        Their corners, with ``low <= high``.

    Examples
    --------
    >>> print(surface_area([0, 0, 0], [1, 2, 3]))
    22.0
    """
    low, high = _validate_corners(low, high, "(..., 3)", lambda s: len(s) > 0 and s[-1] == 3)
    return area(high - low)


def area(extent: NDArray) -> NDArray[np.float64]:
    """Return the surface areas of boxes by their extents, (..., 3)."""
    x, y, z = extent[..., 0], extent[..., 1], extent[..., 2]
    return 2 * (x * y + y * z + z * x)


def still_measure(extent: NDArray) -> NDArray[np.float64]:
    """Return the areas of boxes by their extents, (..., 3), or areas times durations, (..., 4)."""
    return area(extent) if extent.shape[-1] == 3 else area(extent) * extent[..., 3]


def measure(low: NDArray, high: NDArray, times: NDArray | None = None) -> NDArray[np.float64]:
    """Return the measure of rays that hit boxes, up to a factor, for rays uniform in space and time.

    It is the area of still boxes, (..., 3); the area times the duration, (..., 4); or the mean over time of
    the area of moving boxes, (k, ..., 3), with corners that are linear between ``times``.
    """
    extent = high - low
    if times is None:
        return still_measure(extent)
    # Areas are quadratic in time between two times, so Simpson's rule is exact.
    ends, middles = area(extent), area(0.5 * (extent[:-1] + extent[1:]))
    parts = (times[1:] - times[:-1]) / (6 * (times[-1] - times[0]))
    return np.asarray(np.tensordot(parts, ends[:-1] + 4 * middles + ends[1:], 1), np.float64)


def flat_rays(
    origin: Any, direction: Any
) -> tuple[tuple[int, ...], NDArray[np.float64], NDArray[np.float64]]:
    """Return the shape of rays, and their origins and directions as (n, 3)."""
    origin, direction = known("origin", origin), known("direction", direction)
    for name, array in (("origin", origin), ("direction", direction)):
        if not array.ndim or array.shape[-1] != 3:
            raise ValueError(f"{name} must have shape (..., 3), got {array.shape}")
        require(name, array, np.isfinite, "finite")
    try:
        shape = np.broadcast_shapes(origin.shape, direction.shape)
    except ValueError:
        raise ValueError(
            f"origin and direction must have shapes that broadcast, got {origin.shape} and {direction.shape}"
        ) from None
    if not (direction != 0).any(axis=-1).all():
        raise ValueError("direction must have a length above 0 everywhere")
    start, way = (np.broadcast_to(a, shape).reshape(-1, 3) for a in (origin, direction))
    return shape[:-1], start, way


def interval_of_time(times: NDArray | None, when: NDArray) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the interval of ``times`` for each time, clamped, and the position in it."""
    if times is None:
        return np.zeros(len(when), np.int64), np.zeros(len(when))
    span = np.clip(np.searchsorted(times, when, side="right") - 1, 0, len(times) - 2)
    return span, np.clip((when - times[span]) / np.diff(times)[span], 0, 1)


def flat_times(time: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return a time for each ray, (n,)."""
    found = known("time", time)
    require("time", found, np.isfinite, "finite")
    try:
        return np.broadcast_to(found, shape).reshape(-1)
    except ValueError:
        raise ValueError(
            f"time must have a shape that broadcasts to {shape}, got {checks.shown(found.shape)}"
        ) from None


@pytree
@dataclass(frozen=True, eq=False, repr=False)
class Tree:
    """A binary tree with one box in each leaf.

    Nodes 0 to n - 1 are the leaves, numbered like the boxes they contain. Node n + k has the children
    ``children[k]``, which have smaller numbers; the root is the last node, 2 n - 2.
    """

    reported: ClassVar[tuple[str, ...]] = ("size",)

    children: Any
    """int64 (n - 1, 2)."""
    low: Any
    """Corners of the nodes' boxes, float64: (2 n - 1, 3); (2 n - 1, 4) with an interval of time as fourth
    coordinate; (k, 2 n - 1, 3) if they move."""
    high: Any
    """The opposite corners."""
    times: Any = None
    """(k,): times of moving boxes; in between, corners move linearly. None for others."""

    @property
    def size(self) -> int:
        """Number of leaves."""
        return len(self.children) + 1


def validate_tree(value: Any) -> Tree:
    """Return a tree, or raise a TypeError."""
    if not isinstance(value, Tree):
        raise TypeError(f"tree must be a Tree, got {checks.shown(value)}")
    return value


def depths(children: NDArray) -> NDArray[np.int64]:
    """Return the depths of nodes, by pointer jumping; children may have any numbers."""
    root = 2 * len(children)
    depth = np.ones(root + 1, np.int64)
    above = np.full(root + 1, root)
    depth[root] = 0
    above[children] = np.arange(len(children) + 1, root + 1)[:, None]
    while (above != root).any():
        depth += depth[above]
        above = above[above]
    return depth


def levels(children: NDArray) -> Iterator[NDArray[np.int64]]:
    """Yield the inner nodes of each level, the deepest first."""
    inner = depths(children)[len(children) + 1 :]
    order = np.argsort(-inner, kind="stable")
    yield from np.split(order + len(children) + 1, np.flatnonzero(np.diff(inner[order])) + 1)


def fit(children: NDArray, low: NDArray, high: NDArray, times: NDArray | None = None) -> Tree:
    """Return a tree with the boxes of its leaves, renumbered: children before their parents."""
    count = len(children) + 1
    number = np.arange(2 * count - 1)
    by_level = list(levels(children)) if count > 1 else []
    if by_level:
        inner = np.concatenate(by_level)
        number[inner] = np.arange(count, 2 * count - 1)
        children = number[children[inner - count]]
    room = [np.zeros((*a.shape[:-2], count - 1, a.shape[-1])) for a in (low, high)]
    low, high = (np.concatenate([a, b], axis=-2) for a, b in zip((low, high), room, strict=True))
    for level in by_level:
        first, second = children[number[level] - count].T
        low[..., number[level], :] = np.minimum(low[..., first, :], low[..., second, :])
        high[..., number[level], :] = np.maximum(high[..., first, :], high[..., second, :])
    return Tree(children, low, high, times)


def refitted(tree: Tree, low: ArrayLike, high: ArrayLike, times: ArrayLike | None = None) -> Tree:
    """Refit a tree to other boxes, with the same nodes, in linear time.

    For moving boxes, nodes have boxes at each of their times; at any time in between, the interpolated box of
    a node contains those below it [1]_.

    Parameters
    ----------
    tree : Tree
        With n leaves.
    low, high : float ArrayLike, shape (n, 3), (n, 4) or (k, n, 3)
        Corners of the boxes, as in a :class:`Tree`.
    times : float ArrayLike, shape (k,), optional
        Increasing, for moving boxes.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.2 and 4.2.2.

    Examples
    --------
    >>> from analysis.trees import surface_area_tree
    >>> low, high = np.zeros((2, 3)), np.ones((2, 3))
    >>> moved = [low, low + 4]
    >>> tree = refitted(surface_area_tree(low, high), moved, [high, high + 4], [0.0, 1.0])
    >>> print(tree.low[:, -1].tolist())
    [[0.0, 0.0, 0.0], [4.0, 4.0, 4.0]]
    """
    validate_tree(tree)
    given: Any = still_boxes(low, high) if times is None else moving_boxes(low, high, times)
    if given[0].shape[-2] != tree.size:
        raise ValueError(f"low must have {tree.size} boxes, as many as the tree, got {given[0].shape[-2]}")
    return fit(tree.children, *given)


def summed_area(tree: Tree) -> float:
    """Return the sum of the surface areas of all nodes, leaves included.

    Divided by the area of the root, it is the mean number of nodes hit by uniform lines through the root. For
    moving boxes it is the mean over time, for boxes with an interval of time the sum of areas times
    durations.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.1.

    Examples
    --------
    >>> from analysis.trees import surface_area_tree
    >>> print(summed_area(surface_area_tree([[0, 0, 0], [1, 0, 0]], [[1, 1, 1], [2, 1, 1]])))
    22.0
    """
    validate_tree(tree)
    return float(measure(tree.low, tree.high, tree.times).sum())


def node_depths(tree: Tree) -> NDArray[np.int64]:
    """Return the depth of each node, int64 (2 n - 1,): 0 for the root, leaves first.

    Examples
    --------
    >>> from analysis.trees import surface_area_tree
    >>> tree = surface_area_tree([[0, 0, 0], [1, 0, 0], [9, 0, 0]], [[1, 1, 1], [2, 1, 1], [10, 1, 1]])
    >>> print(node_depths(tree))
    [2 2 1 1 0]
    """
    return depths(validate_tree(tree).children)

"""Binary trees of boxes: their nodes, and measures of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees import _boxes
from qmcjax.core import checks
from qmcjax.core.pytrees import pytree


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
    """Return a tree of the same nodes fitted to other boxes, in linear time.

    Moving boxes give boxes of nodes at each of their times; at any time in between, the interpolated box
    of a node contains those below it [1]_.

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
    given: Any = _boxes.still_boxes(low, high) if times is None else _boxes.moving_boxes(low, high, times)
    if given[0].shape[-2] != tree.size:
        raise ValueError(f"low must have {tree.size} boxes, as many as the tree, got {given[0].shape[-2]}")
    return fit(tree.children, *given)


def summed_area(tree: Tree) -> float:
    """Return the sum of the surface areas of all nodes, leaves included.

    Divided by the area of the root it is the mean number of nodes hit by uniform lines through the root. For
    moving boxes it is the mean over time, for boxes with an interval of time only the sum of areas times
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
    return float(_boxes.measure(tree.low, tree.high, tree.times).sum())


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

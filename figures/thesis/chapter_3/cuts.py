"""Cuts through pairs of gather and light points that have instants of the shutter (thesis, Sect. 3.1.6).

A lamp that moves is one light point per instant, a still one has the same place at all. Each pixel has one
gather point per instant. A node of a tree has a strength at each instant, and a cluster is a pair of nodes:
its value is the sum over instants of the products of strengths, times what one of its pairs transports. No
pair of it transports more than the bound of the cluster, or less than nothing.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.trees import Tree, node_depths


class Gathers(NamedTuple):
    """A binary tree per pixel over its gather points; node k has the children 2 k + 1 and 2 k + 2."""

    low: NDArray[np.float64]
    """(pixels, nodes, 6): of positions and normals."""
    high: NDArray[np.float64]
    strength: NDArray[np.float64]
    """(pixels, nodes, instants)."""


class Lights(NamedTuple):
    """A binary tree over light points."""

    children: NDArray[np.int64]
    """(nodes, 2): -1 of leaves."""
    low: NDArray[np.float64]
    """(nodes, 3)."""
    high: NDArray[np.float64]
    strength: NDArray[np.float64]
    """(nodes, instants)."""
    lamp: NDArray[np.int64]
    """(nodes, instants): the lamp that represents the node at an instant; -1 if none exists."""


class Pairs(NamedTuple):
    """Clusters of pairs, (n,) each."""

    pixel: NDArray[Any]
    gather: NDArray[Any]
    light: NDArray[Any]
    """Numbers of nodes."""
    instant: NDArray[Any]
    """Of the pair that represents the cluster."""
    value: NDArray[Any]
    bound: NDArray[Any]
    """Of the error of the value."""


class Cut(NamedTuple):
    """The clusters of all pixels, what they add up to, and what that costs."""

    pairs: Pairs
    value: NDArray[Any]
    """(pixels,)."""
    bound: NDArray[Any]
    """(pixels,): of the error of the value."""
    cost: NDArray[Any]
    """(pixels,): evaluated pairs."""


def gather_tree(place: NDArray, normal: NDArray, surface: NDArray) -> Gathers:
    """Make trees of gather points, (pixels, instants, 3), sorted by surface, then by time.

    The number of instants is a power of two. Points without a surface, -1, have no strength.
    """
    instants = surface.shape[1]
    order = np.argsort(surface, axis=1, kind="stable")
    points = np.take_along_axis(np.concatenate([place, normal], axis=2), order[..., None], axis=1)
    low = high = points
    strength = np.where((surface >= 0)[..., None], np.eye(instants) / instants, 0.0)
    strength = np.take_along_axis(strength, order[..., None], axis=1)
    levels = [(low, high, strength)]
    while low.shape[1] > 1:
        low, high = np.minimum(low[:, ::2], low[:, 1::2]), np.maximum(high[:, ::2], high[:, 1::2])
        strength = strength[:, ::2] + strength[:, 1::2]
        levels.insert(0, (low, high, strength))
    return Gathers(*(np.concatenate(part, axis=1) for part in zip(*levels, strict=True)))


def light_tree(tree: Tree, strength: NDArray, lamp: NDArray, random: np.random.Generator) -> Lights:
    """Give nodes of a tree of light points strengths, (points, instants), and representatives.

    Representatives are random, as likely as they are strong; that of a node is that of one of its children.
    """
    count = tree.size
    sums = np.concatenate([strength, np.zeros((count - 1, strength.shape[1]))])
    lamps = np.full(sums.shape, -1)
    lamps[:count] = np.where(strength > 0, lamp[:, None], -1)
    depth = node_depths(tree)
    for level in range(depth.max() - 1, -1, -1):
        nodes = count + np.flatnonzero(depth[count:] == level)
        first, second = tree.children[nodes - count].T
        sums[nodes] = sums[first] + sums[second]
        is_first = random.random(sums[nodes].shape) * sums[nodes] < sums[first]
        lamps[nodes] = np.where(is_first, lamps[first], lamps[second])
    children = np.concatenate([np.full((count, 2), -1), tree.children])
    return Lights(children, tree.low, tree.high, sums, lamps)


def transport_bound(
    gathers: Gathers, lights: Lights, pixel: NDArray, gather: NDArray, light: NDArray
) -> NDArray:
    """Return a bound of cosine over squared distance of all pairs below pairs of nodes, unblocked."""
    low, high = gathers.low[pixel, gather], gathers.high[pixel, gather]
    ways = lights.low[light] - high[:, :3], lights.high[light] - low[:, :3]
    products = [way * normal for way in ways for normal in (low[:, 3:], high[:, 3:])]
    along = np.maximum(np.max(products, axis=0).sum(axis=1), 0)
    distance = np.linalg.norm(np.maximum(np.maximum(ways[0], -ways[1]), 0), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.where(along < distance, along / distance, 1)
        return np.where(along > 0, cosine / distance**2, 0)


def find_cut(
    table: NDArray, gathers: Gathers, lights: Lights, tolerance: float, random: np.random.Generator
) -> Cut:
    """Refine clusters until each has a bound of at most ``tolerance`` times the value of its pixel.

    ``table``: what gather points receive from lamps of strength 1, (pixels, instants, lamps).
    """
    pixels = len(table)
    roots = np.arange(pixels), np.zeros(pixels, np.int64), np.full(pixels, len(lights.children) - 1)
    pairs, new = _represent(table, gathers, lights, roots, None, random)
    cost = np.bincount(new, minlength=pixels)
    while True:
        value = np.bincount(pairs.pixel, pairs.value, pixels)
        coarse = pairs.bound > tolerance * value[pairs.pixel]
        if not coarse.any():
            return Cut(pairs, value, np.bincount(pairs.pixel, pairs.bound, pixels), cost)
        parents = Pairs(*(part[coarse] for part in pairs))
        found = [Pairs(*(part[~coarse] for part in pairs))]
        for nodes in _children(gathers, lights, parents):
            finer, new = _represent(table, gathers, lights, nodes, parents, random)
            cost += np.bincount(new, minlength=pixels)
            found.append(finer)
        pairs = Pairs(*(np.concatenate(part) for part in zip(*found, strict=True)))


def _children(gathers: Gathers, lights: Lights, pairs: Pairs) -> list[tuple[NDArray, NDArray, NDArray]]:
    """Return both children of clusters: of the larger node, if it is not a leaf."""
    pixel, gather, light = pairs[:3]
    sizes = [
        np.linalg.norm(high - low, axis=1)
        for low, high in (
            (gathers.low[pixel, gather, :3], gathers.high[pixel, gather, :3]),
            (lights.low[light], lights.high[light]),
        )
    ]
    leaf, other_leaf = _leaves(gathers, lights, gather, light)
    of_gather = ~leaf & (other_leaf | (sizes[0] > sizes[1]))
    return [
        (
            pixel,
            np.where(of_gather, 2 * gather + 1 + k, gather),
            np.where(of_gather, light, lights.children[light, k]),
        )
        for k in range(2)
    ]


def _leaves(gathers: Gathers, lights: Lights, gather: NDArray, light: NDArray) -> tuple[NDArray, NDArray]:
    return gather >= gathers.low.shape[1] // 2, lights.children[light, 0] < 0


def _represent(
    table: NDArray,
    gathers: Gathers,
    lights: Lights,
    nodes: tuple[NDArray, NDArray, NDArray],
    parents: Pairs | None,
    random: np.random.Generator,
) -> tuple[Pairs, NDArray]:
    """Return clusters with representatives, and the pixels of those that had to be evaluated.

    One child of a cluster has its pair, the other a new one at a random instant. Clusters without any pair at
    a common instant are left out.
    """
    weights = gathers.strength[nodes[:2]] * lights.strength[nodes[2]]
    some = weights.any(axis=1)
    pixel, gather, light = (part[some] for part in nodes)
    sums = np.cumsum(weights[some], axis=1)
    weight = sums[:, -1]
    row = np.arange(len(pixel))
    instant = np.argmax(sums > (random.random(len(row)) * weight)[:, None], axis=1)
    kept = np.zeros(len(row), bool)
    if parents is not None:
        before, above = parents.instant[some], parents.light[some]
        kept = (weights[some][row, before] > 0) & (lights.lamp[light, before] == lights.lamp[above, before])
        instant = np.where(kept, before, instant)
    value = weight * table[pixel, instant, lights.lamp[light, instant]]
    leaf, other_leaf = _leaves(gathers, lights, gather, light)
    bound = np.where(leaf & other_leaf, 0, weight * transport_bound(gathers, lights, pixel, gather, light))
    return Pairs(pixel, gather, light, instant, value, bound), pixel[~kept]

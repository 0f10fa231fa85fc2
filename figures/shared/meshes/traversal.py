"""Rays through trees of meshes: how many nodes they visit, what they hit, and where they go on from there."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis import trees


class Rays(NamedTuple):
    origin: NDArray[np.float64]
    direction: NDArray[np.float64]


class Found(NamedTuple):
    visits: NDArray[np.int64]
    """How many nodes each ray visits."""
    distance: NDArray[np.float64]
    """Of the nearest hit, inf if there is none."""
    leaf: NDArray[np.int64]
    """Where that is."""


def traced(
    tree: trees.Tree,
    rays: Rays,
    distance: Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.float64]],
    time: NDArray[np.float64] | None = None,
) -> Found:
    """Send rays through a tree, and note what they hit."""
    nearest, hit = np.full(len(rays.origin), np.inf), np.zeros(len(rays.origin), np.int64)

    def noted(ray: NDArray[np.int64], leaf: NDArray[np.int64]) -> NDArray[np.float64]:
        found = distance(ray, leaf)
        closer = found < nearest[ray]
        nearest[ray[closer]], hit[ray[closer]] = found[closer], leaf[closer]
        return found

    return Found(trees.nodes_visited(tree, *rays, noted, time=time), nearest, hit)


def bounced(triangles: NDArray[np.float64], rays: Rays, found: Found, key: int) -> Rays:
    """Return rays from what was hit, in random directions as a diffuse surface scatters them."""
    hit = np.isfinite(found.distance)
    way = rays.direction[hit]
    a, b, c = np.moveaxis(triangles[found.leaf[hit]], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= -np.sign(np.sum(normal * way, axis=1, keepdims=True))
    # The normal and a point of the unit sphere.
    ball = np.random.default_rng(key).normal(size=way.shape)
    scattered = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
    point = rays.origin[hit] + found.distance[hit, None] * way
    return Rays(point + 1e-6 * np.abs(point).max() * normal, scattered)


def leaf_depths(tree: trees.Tree) -> tuple[int, float]:
    """Return the largest and the mean depth of leaves."""
    depth = trees.node_depths(tree)[: tree.size]
    return int(depth.max()), float(depth.mean())

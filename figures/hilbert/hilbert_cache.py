"""Hilbert paper Sect. 5: misses of a cache for the nodes that rays visit, by the order of the pixels."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures import plot
from figures.making.schema import Claims
from figures.shared import meshes
from figures.shared.sheets.curve_tables import curve_of
from figures.shared.sheets.panels import curve, curves, name_axes, new_figure
from qmcjax import orders, sequences

SIDE = {"draft": 32, "paper": 128}
SIZES = tuple(2**k for k in range(5, 14))
"""Nodes that a cache holds."""
JUDGED = ("64", "256", "1024", "4096")
TILES = (2, 4, 8, 16, 32)
"""Pixels along the sides of tiles, which follow one another in rows, as their pixels do."""
SHOWN, SMALL, LARGE = "rooms, tessellated", 64, 256
"""What is drawn: a mesh, and two caches in the panel of tiles."""
MESHES = (SHOWN, "knots", "terrain")

HILBERT, MORTON, ROWS, RANDOM, NET = "Hilbert", "Morton", "rows", "random", "a net's"
DRAWN = {
    HILBERT: plot.style("Hilbert, Owen"),
    MORTON: plot.style("Z"),
    ROWS: plot.style("raster, Owen"),
    RANDOM: plot.style("random"),
}

NOTE = (
    "Primary rays through {side} x {side} pixels visit the nodes of our trees by the surface area "
    "heuristic, one triangle per leaf, the nearer child first. A cache holds the nodes visited last; a "
    "visit of any other node is a miss. Counts are exact, for one processor that takes the pixels one after "
    "the other; random is one permutation. {visits:.1f} million visits of {nodes} nodes in the rooms. With "
    "rows, most of what a pixel needs was last used in the row above: they miss far more until the cache "
    "holds the nodes of a row, and then least. Tiles of 4 to 16 pixels need no curve and come close to it. "
    "The first visit of each node is a miss in all orders. A net's order, measured only, is that of the "
    "points of Larcher and Pillichshammer's net over the screen."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Trace the primary rays of three meshes, and count misses by order and size of the cache."""
    side = SIDE[quality]
    ways = _orders(side)
    measured: dict[str, dict[str, Any]] = {}
    for done, name in enumerate(MESHES, start=1):
        ray, node = _visits(meshes.made(name, quality), side)
        measured[name] = {"visits": len(node), "nodes": len(np.unique(node))} | {
            way: _percent_missed(node[np.argsort(position[ray], kind="stable")])
            for way, position in ways.items()
        }
        progress(done / len(MESHES))
    of = measured[SHOWN]
    note = NOTE.format(side=side, visits=of["visits"] / 1e6, nodes=of["nodes"])
    return _draw(of, side), {"measured": measured, "claims": _claims(measured), "note": note}


def _orders(side: int) -> dict[str, NDArray[np.int64]]:
    """Return the positions of the pixels, in rows, by the name of their order."""
    made = {HILBERT: orders.hilbert, MORTON: orders.morton, ROWS: orders.raster}
    found = {name: curve_of(order(side, side)).positions.ravel() for name, order in made.items()}
    y, x = np.divmod(np.arange(side**2), side)
    for tile in TILES:
        keys = x % tile, y % tile, x // tile, y // tile
        found[f"tiles of {tile} x {tile}"] = np.argsort(np.lexsort(keys))
    points = np.asarray(sequences.larcher_pillichshammer_net(2 * (side.bit_length() - 1)).points(side**2))
    x, y = (side * points.T).astype(np.int64)
    found[NET] = np.argsort(x + side * y)  # of the one point in each pixel
    return found | {RANDOM: np.random.default_rng(1).permutation(side**2)}


def _visits(mesh: meshes.Mesh, side: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rays and the nodes that they visit: those of each ray in their order."""
    steps: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    rays = meshes.camera_rays(mesh, side)
    tree = trees.surface_area_tree(*meshes.corners(mesh.triangles))
    distance = trees.triangle_distances(mesh.triangles, *rays)
    trees.nodes_visited(tree, *rays, distance, visit=lambda *step: steps.append(step))
    ray, node = (np.concatenate(parts) for parts in zip(*steps, strict=True))
    return ray, node


def _percent_missed(nodes: NDArray[np.int64]) -> dict[str, float]:
    distance = reuse_distances(nodes)
    return {str(size): round(100 * float(np.mean(distance >= size)), 3) for size in SIZES}


def reuse_distances(nodes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how many other nodes were visited since each was visited last, inf if it never was.

    A cache for the last ``size`` nodes misses all whose distance is ``size`` or more.
    """
    count = len(nodes)
    order = np.argsort(nodes, kind="stable")
    again = np.flatnonzero(np.diff(nodes[order]) == 0)
    last = np.full(count, -1)
    last[order[again + 1]] = order[again]
    # Of the visits since, those whose own last one was later visit a node again.
    distance = np.arange(count) - last - 1 - _count_larger_before(last)
    return np.where(last < 0, np.inf, distance)


def _count_larger_before(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count for each value the larger ones before it, by merging sorted halves."""
    size = 1 << len(values).bit_length()
    padded = np.concatenate([values, np.full(size - len(values), values.max())])
    place, found, half = np.arange(size), np.zeros(size, np.int64), 1
    while half < size:
        pairs = place.reshape(-1, 2 * half)
        order = np.argsort(padded[pairs], axis=1, kind="stable")
        is_left, place = order < half, np.take_along_axis(pairs, order, axis=1)
        found[place] += np.where(is_left, 0, half - np.cumsum(is_left, axis=1))
        half *= 2
    return found[: len(values)]


def _draw(of: dict[str, Any], side: int) -> Figure:
    figure = new_figure(
        "Along the Hilbert curve a small cache of tree nodes misses less than in rows\n"
        f"Hilbert paper, Sect. 5; {side} x {side} primary rays in tessellated rooms",
        2.9,
    )
    left, right = figure.subplots(1, 2, sharey=True)
    curves(left, {name: of[name] for name in DRAWN}, DRAWN)
    ticks = {float(size): str(size) for size in SIZES[::2]}
    name_axes(left, "nodes in the cache", "misses (%)", log="xy", ticks=ticks, few_decades=True)
    left.set_ylim(bottom=2)
    left.legend(frameon=False)
    for size, line in ((SMALL, "-"), (LARGE, "--")):
        missed = {1: of[ROWS][str(size)]}
        missed |= {tile: of[f"tiles of {tile} x {tile}"][str(size)] for tile in TILES}
        curve(right, missed, DRAWN[ROWS], ls=line, label=f"tiles, cache of {size}")
        right.axhline(
            of[HILBERT][str(size)], color=DRAWN[HILBERT].color, lw=1, ls=line, label=f"Hilbert, {size}"
        )
    name_axes(right, "side of the tiles (pixels; 1: rows)", log="x", ticks=(1, *TILES))
    right.legend(frameon=False)
    return figure


def _claims(measured: dict[str, dict[str, Any]]) -> Claims:
    return {
        "higher cache hit rates along the Hilbert curve: fewer misses than in rows": {
            f"{name}, {size} nodes": of[HILBERT][size] < of[ROWS][size]
            for name, of in measured.items()
            for size in JUDGED
        },
        "enumerating near samples helps: fewer misses than in the order of a net over the screen": {
            f"{name}, {size} nodes": max(of[HILBERT][size], of[MORTON][size]) < of[NET][size]
            for name, of in measured.items()
            for size in JUDGED
        },
    }

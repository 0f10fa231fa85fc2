"""Thesis Sect. 4.1.1 to 4.1.4: trees by the surface area heuristic, by other costs and in other ways."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures.shared import judged, meshes
from figures.shared.meshes import Rays, leaf_depths, trace
from figures.shared.sheets.panels import legend_below, name_axes, new_figure

SIDE = {"draft": 24, "paper": 96}
FAN = 200
"""Triangles of the fan."""
QUADRATIC = 2000
"""Boxes up to which all pairs of them are looked at."""
SETS = {"draft": (4, 24), "paper": (16, 100)}
"""Sets of random boxes, and boxes, of trees by a sharper bound."""
CATASTROPHE = 2.0
"""As many nodes, or more."""
SLIGHTLY = 1.25

SAH, CENTRES, UNWEIGHTED = "surface area heuristic", "2-means of centres", "area, not weighted"
SILHOUETTE = "2-means by silhouette"
VOLUME, BOTH = "volume in place of area", "volume + area"

NOTE = (
    f"Summed areas and nodes of {{side}} x {{side}} primary rays relative to the tree of the surface "
    "area heuristic; one triangle per leaf. All but the last two builders take the split of least c(j), "
    "Eq. 4.1, among their candidates: along three axes, along one curve, or of two pairs of clusters. "
    "2-means uses the metric for boxes; 'of centres' clusters points, 'by silhouette' takes clusters with "
    "the largest average silhouette width, in place of the least Eq. 4.1. Quadratic splits try all pairs of "
    f"boxes, feasible for at most {QUADRATIC}; 'filled' keeps 40 % of the boxes in each group. 'volume', "
    "'volume + area', both in units of the scene's box, and 'not weighted', without numbers of boxes, are "
    "other costs in place of Eq. 4.1. The fan: "
    f"{FAN} triangles around a vertex, each 0.9 times as wide as the one before; its tree by quadratic "
    f"splits is {{depth}} levels deep, by the heuristic {{least}}. Not drawn: without numbers of boxes one "
    f"knot has {{depth_of_knot:.0f}} levels on average. A sharper bound, one split ahead, and silhouettes: "
    f"also on {{sets}} sets of {{count}} random boxes."
)


def _ways(low: NDArray, high: NDArray) -> dict[str, Callable[[], trees.Tree]]:
    middle = (low + high) / 2
    found: dict[str, Callable[[], trees.Tree]] = {
        SAH: partial(trees.surface_area_tree, low, high),
        "optimal subtrees of it": lambda: trees.optimal_subtrees(trees.surface_area_tree(low, high)),
        "Hilbert order": partial(trees.hilbert_tree, low, high),
        "Morton order": partial(trees.morton_tree, low, high),
        "2-means": partial(trees.two_means_tree, low, high, tries=2),
        CENTRES: lambda: trees.refitted(trees.two_means_tree(middle, middle, tries=2), low, high),
    }
    size = (high.max(axis=0) - low.min(axis=0)).prod() ** (1 / 3)
    found[VOLUME] = lambda: trees.surface_area_tree(low, high, cost=lambda n, e: n * e.prod(axis=-1))
    found[BOTH] = lambda: trees.surface_area_tree(
        low, high, cost=lambda n, e: n * (_area_of(e) + e.prod(axis=-1) / size)
    )
    if len(low) <= QUADRATIC:
        found[UNWEIGHTED] = lambda: trees.surface_area_tree(low, high, cost=lambda _, e: _area_of(e))
        found[SILHOUETTE] = partial(trees.two_means_tree, low, high, tries=2, silhouette=True)
        found["quadratic split"] = partial(trees.quadratic_split_tree, low, high)
        found["quadratic split, filled"] = partial(trees.quadratic_split_tree, low, high, fill=0.4)
    return found


def _area_of(extent: NDArray) -> NDArray[np.float64]:
    return 2 * (extent * np.roll(extent, 1, axis=-1)).sum(axis=-1)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Build trees of all meshes in all ways, and send rays through them."""
    side = SIDE[quality]
    measured: dict[str, dict[str, Any]] = {}
    small = meshes.Mesh(meshes.knot(2, 3, 48, 10), (0.0, 1.0, -7.0), (0.0, 0.0, 0.0))
    compared = {"one knot": lambda: small} | {
        name: partial(meshes.made, name, quality) for name in meshes.MESHES
    }
    for done, (name, mesh) in enumerate(compared.items(), start=1):
        measured[name] = _of_mesh(mesh(), side)
        progress(done / len(compared))
    fan = _fan()
    sharper, depths = _trees_of_random_boxes(*SETS[quality])
    worse, deeper = ({kind: judged.ratio(*of) for kind, of in found.items()} for found in (sharper, depths))
    others = [way for way, of in measured["one knot"].items() if isinstance(of, dict)]
    others = [way for way in others if way not in (SAH, UNWEIGHTED)]
    claims = {
        "along the Hilbert curve trees are worse than by three axes": {
            mesh: _nodes(of, "Hilbert order") > 1 for mesh, of in measured.items()
        },
        "in Morton order they are worse than along the Hilbert curve": {
            mesh: _nodes(of, "Morton order") > _nodes(of, "Hilbert order") for mesh, of in measured.items()
        },
        "in Morton order they are catastrophic: twice the nodes": {
            mesh: _nodes(of, "Morton order") > CATASTROPHE for mesh, of in measured.items()
        },
        "2-means perform slightly worse: up to a quarter more summed area": {
            mesh: 1 < _area(of, "2-means") < SLIGHTLY for mesh, of in measured.items()
        },
        "by 2-means trees are always inferior: more summed area": {
            f"{mesh}, {way}": _area(of, way) > 1
            for mesh, of in measured.items()
            for way in ("2-means", CENTRES)
        },
        "without numbers of boxes the tree gets very deep: twice the mean leaf depth": (
            measured["one knot"][UNWEIGHTED]["mean leaf depth"]
            > 2 * measured["one knot"][SAH]["mean leaf depth"]
        ),
        "and inefficient: more nodes": _nodes(measured["one knot"], UNWEIGHTED) > 1,
        "by silhouette width trees are very deep: twice the mean leaf depth": {
            kind: judged.smaller(heuristic, silhouette, 0.5)
            for kind, (silhouette, heuristic) in depths.items()
        },
        "area works better than volume: fewer nodes": {
            mesh: _nodes(of, VOLUME) > 1 for mesh, of in measured.items()
        },
        "volume and area together are superior for some scenes": any(
            _nodes(of, BOTH) < 1 for of in measured.values()
        ),
        "a sharper bound, one split ahead, increases the summed area": {
            kind: judged.smaller(heuristic, bound) for kind, (bound, heuristic) in sharper.items()
        },
        "the child that is hit first is to be visited first: fewer nodes than along the axis": {
            mesh: of[SAH]["nodes along axes / those of the nearest first"] > 1
            for mesh, of in measured.items()
        },
        "quadratic splits degrade a fan to something like a list: a depth of half its triangles": (
            fan["quadratic split"] > FAN / 2
        ),
    }
    numbers = {
        "measured": {"meshes": measured, "depth of the fan": fan}
        | {"summed area by a sharper bound / by the heuristic": worse}
        | {"mean leaf depth by silhouette / by the heuristic": deeper},
        "claims": claims,
        "note": NOTE.format(
            side=side,
            depth=fan["quadratic split"],
            least=fan[SAH],
            depth_of_knot=measured["one knot"][UNWEIGHTED]["mean leaf depth"],
            sets=SETS[quality][0],
            count=SETS[quality][1],
        ),
    }
    return _draw(measured, others), numbers


def _nodes(of: dict[str, Any], way: str) -> float:
    return of[way]["nodes / those of the heuristic"]


def _area(of: dict[str, Any], way: str) -> float:
    return of[way]["area / that of the heuristic"]


def _of_mesh(mesh: meshes.Mesh, side: int) -> dict[str, Any]:
    rays = Rays(*meshes.camera_rays(mesh, side))
    distance = trees.triangle_distances(mesh.triangles, *rays)
    found: dict[str, Any] = {}
    first: dict[str, float] = {}
    built: dict[str, trees.Tree] = {}
    for name, make in _ways(*meshes.corners(mesh.triangles)).items():
        tree = built[name] = make()
        area, visits = trees.summed_area(tree), float(trace(tree, rays, distance).visits.mean())
        first = first or {"area": area, "visits": visits}
        found[name] = {
            "summed area": area,
            "area / that of the heuristic": area / first["area"],
            "nodes of a primary ray": visits,
            "nodes / those of the heuristic": visits / first["visits"],
            "mean leaf depth": leaf_depths(tree)[1],
        }
    along = trees.nodes_visited(built[SAH], *rays, distance, nearest_first=False).mean()
    found[SAH]["nodes along axes / those of the nearest first"] = float(along / first["visits"])
    return found | {"triangles": len(mesh.triangles)}


Pairs = dict[str, tuple[list[float], list[float]]]
"""By kind of boxes: of another tree, and of the heuristic's."""


def _trees_of_random_boxes(sets: int, count: int) -> tuple[Pairs, Pairs]:
    """Return summed areas by a sharper bound, and mean leaf depths by silhouettes, of sets of boxes."""
    areas: Pairs = {}
    depths: Pairs = {}
    for kind, power in (("alike", 1), ("of many sizes", 8)):
        areas[kind], depths[kind] = ([], []), ([], [])
        for key in range(sets):
            random = np.random.default_rng(key)
            low = random.uniform(size=(count, 3))
            high = low + 0.5 * random.uniform(size=low.shape) ** power
            heuristic = trees.surface_area_tree(low, high)
            ahead = trees.refitted(replace(heuristic, children=_split_ahead(low, high)), low, high)
            silhouette = trees.two_means_tree(low, high, silhouette=True)
            for k, tree in enumerate((ahead, heuristic)):
                areas[kind][k].append(trees.summed_area(tree))
            for k, tree in enumerate((silhouette, heuristic)):
                depths[kind][k].append(leaf_depths(tree)[1])
    return areas, depths


def _split_ahead(low: NDArray, high: NDArray) -> NDArray[np.int64]:
    """Return the children of a tree whose splits have the least Eq. 4.2 of their parts' own best splits."""
    children: list[tuple[int, int]] = []

    def build(boxes: NDArray[np.int64]) -> int:
        if len(boxes) == 1:
            return int(boxes[0])
        order = np.argsort(low[boxes] + high[boxes], axis=0, kind="stable").T
        splits = [(row[:j], row[j:]) for row in boxes[order] for j in range(1, len(boxes))]
        bounds = [sum(_bound(low[part], high[part]) for part in split) for split in splits]
        one, other = splits[int(np.argmin(bounds))]
        children.append((build(one), build(other)))
        return len(low) + len(children) - 1

    build(np.arange(len(low)))
    return np.array(children)


def _bound(low: NDArray, high: NDArray) -> float:
    """Return the least Eq. 4.2 of all splits of some boxes, or the area of a single one."""
    count = len(low)
    if count == 1:
        return float(trees.surface_area(low[0], high[0]))
    order = np.argsort(low + high, axis=0, kind="stable").T
    areas = []
    for rows in (order, order[:, ::-1]):
        first, last = np.minimum.accumulate(low[rows], axis=1), np.maximum.accumulate(high[rows], axis=1)
        areas.append(_area_of(last - first))
    number = np.arange(1, count)
    sums = (2 * number - 1) * areas[0][:, :-1] + (2 * (count - number) - 1) * areas[1][:, :-1][:, ::-1]
    return float(areas[0][0, -1] + sums.min())


def _fan() -> dict[str, int]:
    """Return the depths of trees over triangles around one vertex."""
    angle = np.pi / 2 * 0.9 ** np.arange(FAN + 1)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    low, high = meshes.corners(np.stack([0 * rim[:-1], rim[:-1], rim[1:]], axis=1))
    ways = _ways(low, high)
    return {
        name: leaf_depths(ways[name]())[0] for name in ("quadratic split", "quadratic split, filled", SAH)
    }


def _draw(measured: dict[str, dict[str, Any]], ways: list[str]) -> Figure:
    figure = new_figure(
        "Trees by 2-means or along curves are worse than by the surface area heuristic\n"
        "thesis, Sect. 4.1.1 to 4.1.4; one marker per mesh",
        4.5,
    )
    panels = figure.subplots(1, 2, sharey=True)
    kinds = {
        "area / that of the heuristic": "summed area / that of the heuristic",
        "nodes / those of the heuristic": "nodes of a primary ray / the heuristic's",
    }
    for axes, (key, name) in zip(panels, kinds.items(), strict=True):
        for (mesh, of), marker in zip(measured.items(), "osD^vX", strict=True):
            rows = [k for k, way in enumerate(ways) if way in of]
            values = [of[ways[k]][key] for k in rows]
            axes.plot(values, rows, marker, ms=4, label=f"{mesh}: {of['triangles']} triangles")
        axes.axvline(1, color="0.4", lw=0.8)
        name_axes(axes, name)
    panels[0].set_yticks(range(len(ways)), ways)
    panels[0].set_ylabel("how the tree is built")
    panels[0].invert_yaxis()
    legend_below(figure, panels[0], 3)
    return figure

"""Thesis Sect. 4.1.3 and 4.1.4: trees by the surface area heuristic and by other ways."""

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures.shared.costs import in_turns, median, timed
from figures.shared.sheets.panels import legend_below, name_axes, new_figure
from figures.thesis.chapter_4 import meshes
from figures.thesis.chapter_4.meshes import Rays, leaf_depths, trace

SIDE = {"draft": 24, "paper": 96}
FAN = 200
"""Triangles of the fan."""
QUADRATIC = 2000
"""Boxes up to which all pairs of them are looked at."""
CATASTROPHE = 2.0
"""As many nodes, or more."""
SLIGHTLY = 1.25

EMBREE = find_spec("embreex") is not None

SAH, CENTRES = "surface area heuristic", "2-means of centres"

NOTE = (
    f"Summed areas and nodes of {{side}} x {{side}} primary rays relative to the tree of the surface "
    "area heuristic; one triangle per leaf. All but the last two builders take the split of least c(j), "
    "Eq. 4.1, among their candidates: along three axes, along one curve, or of two pairs of clusters. "
    "2-means uses the metric for boxes; 'of centres' clusters points. Quadratic splits try all pairs of "
    f"boxes, feasible for at most {QUADRATIC}; 'filled' keeps 40 % of the boxes in each group. The fan: "
    f"{FAN} triangles around a vertex, each 0.9 times as wide as the one before; its tree by quadratic "
    f"splits is {{depth}} levels deep, by the heuristic {{least}}. Embree's time per ray (one core, same "
    f"primary rays, its own tree) shows how hard a mesh is.{{embree}}"
)


def _ways(low: NDArray, high: NDArray) -> dict[str, Callable[[], trees.Tree]]:
    found: dict[str, Callable[[], trees.Tree]] = {
        SAH: partial(trees.surface_area_tree, low, high),
        "optimal subtrees of it": lambda: trees.optimal_subtrees(trees.surface_area_tree(low, high)),
        "Hilbert order": partial(trees.hilbert_tree, low, high),
        "Morton order": partial(trees.morton_tree, low, high),
        "2-means": partial(trees.two_means_tree, low, high, tries=2),
        CENTRES: partial(_of_centres, low, high),
    }
    if len(low) <= QUADRATIC:
        found["quadratic split"] = partial(trees.quadratic_split_tree, low, high)
        found["quadratic split, filled"] = partial(trees.quadratic_split_tree, low, high, fill=0.4)
    return found


def _of_centres(low: NDArray, high: NDArray) -> trees.Tree:
    center = (low + high) / 2
    return trees.refitted(trees.two_means_tree(center, center, tries=2), low, high)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Build trees of all meshes in all ways, and send rays through them."""
    side = SIDE[quality]
    measured: dict[str, dict[str, Any]] = {}
    marks: dict[str, float] = {}
    small = meshes.Mesh(meshes.knot(2, 3, 48, 10), (0.0, 1.0, -7.0), (0.0, 0.0, 0.0))
    compared = {"one knot": lambda: small} | {
        name: partial(meshes.made, name, quality) for name in meshes.MESHES
    }
    for done, (name, mesh) in enumerate(compared.items(), start=1):
        measured[name] = _of_mesh(mesh(), side)
        if EMBREE:
            marks[name] = _embree(mesh())
        progress(done / len(compared))
    fan = _fan()
    others = [way for way in measured["one knot"] if way not in ("triangles", SAH)]
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
        "quadratic splits degrade a fan to something like a list: a depth of half its triangles": (
            fan["quadratic split"] > FAN / 2
        ),
    }
    numbers = {
        "measured": {"meshes": measured, "Embree, nanoseconds a ray": marks, "depth of the fan": fan},
        "claims": claims,
        "note": NOTE.format(
            side=side,
            depth=fan["quadratic split"],
            least=fan[SAH],
            embree="" if EMBREE else " Embree is not installed here.",
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
    for name, make in _ways(*meshes.corners(mesh.triangles)).items():
        tree, seconds = timed(make)
        area, visits = trees.summed_area(tree), float(trace(tree, rays, distance).visits.mean())
        first = first or {"area": area, "visits": visits}
        found[name] = {
            "summed area": area,
            "area / that of the heuristic": area / first["area"],
            "nodes of a primary ray": visits,
            "nodes / those of the heuristic": visits / first["visits"],
            "mean leaf depth": leaf_depths(tree)[1],
            "seconds to build": seconds.clock,
        }
    return found | {"triangles": len(mesh.triangles)}


def _fan() -> dict[str, int]:
    """Return the depths of trees over triangles around one vertex."""
    angle = np.pi / 2 * 0.9 ** np.arange(FAN + 1)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    low, high = meshes.corners(np.stack([0 * rim[:-1], rim[:-1], rim[1:]], axis=1))
    ways = _ways(low, high)
    return {
        name: leaf_depths(ways[name]())[0] for name in ("quadratic split", "quadratic split, filled", SAH)
    }


def _embree(mesh: meshes.Mesh, side: int = 256, turns: int = 5) -> float:
    """Return the nanoseconds of a primary ray, the median of some turns after the first."""
    from embreex.mesh_construction import TriangleMesh  # pyright: ignore[reportMissingImports]
    from embreex.rtcore_scene import EmbreeScene  # pyright: ignore[reportMissingImports]

    scene = EmbreeScene()
    TriangleMesh(scene, mesh.triangles.astype(np.float32))
    origin, way = (np.ascontiguousarray(a, np.float32) for a in meshes.camera_rays(mesh, side))
    taken = in_turns({"": lambda _: scene.run(origin, way)}, turns)[""]
    return median(taken) / len(origin) * 1e9


def _draw(measured: dict[str, dict[str, Any]], ways: list[str]) -> Figure:
    figure = new_figure(
        "Trees by 2-means or along curves are worse than by the surface area heuristic\n"
        "thesis, Sect. 4.1.3 and 4.1.4; one marker per mesh",
        3.7,
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

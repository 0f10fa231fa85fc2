"""Thesis Table 4.3: the optimisation of subtrees several times, of the ten uppermost levels and of all."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis import trees
from figures.shared.meshes import mesh_models
from figures.shared.meshes.traversal import Rays, leaf_depths, traced
from figures.shared.sheets import text_tables
from figures.shared.sheets.curves import titled
from figures.shared.turns import timed

SIZE = {"draft": "draft", "paper": "large"}
"""Of the meshes."""

SIDE = {"draft": 24, "paper": 96}
RUNS = 4
LEVELS = {"10 levels": 10, "all levels": None}
MOST = 60
"""Runs until nothing changes, of the small set."""

PRINTED = {
    "summed area": (1.36267e13, 1.27797e13, 1.25772e13, 1.25063e13, 1.24589e13),
    "reduction in percent": (6.22, 1.58, 0.56, 0.38),
    "mean leaf depth": (27.57, 33.29, 33.05, 33.03, 33.12),
}

NOTE = (
    "Areas in units of the root's; each reduction is that of one run, of the area before it, as printed. "
    "'10 levels': only below nodes of the ten levels next to the root, at most 1023 subtrees of up to 8 "
    "leaves. Nodes by {side} x {side} primary rays. The thesis's mesh has some millions of triangles, ours "
    "{fewest} to {most}. 'until nothing "
    "changes': runs over all levels of the tree over {small} random boxes. Below each node then the subtree "
    "over the nodes that are opened is optimal, as the thesis conjectures; not every other subtree with as "
    "many leaves needs to be."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Optimise trees of all meshes four times, in both ways."""
    side = SIDE[quality]
    measured: dict[str, dict[str, Any]] = {}
    sizes: list[int] = []
    for done, name in enumerate(mesh_models.MESHES, start=1):
        mesh = mesh_models.made(name, SIZE[quality])
        tree = trees.surface_area_tree(*mesh_models.corners(mesh.triangles))
        sizes.append(len(mesh.triangles))
        rays = Rays(*mesh_models.camera_rays(mesh, side))
        distance = trees.triangle_distances(mesh.triangles, *rays)
        for way, levels in LEVELS.items():
            runs = [tree]
            busy = 0.0
            for _ in range(RUNS):
                better, seconds = timed(partial(trees.optimal_subtrees, runs[-1], levels=levels))
                runs.append(better)
                busy += seconds.processors
            root = float(trees.surface_area(tree.low[-1], tree.high[-1]))
            area = np.array([trees.summed_area(each) for each in runs]) / root
            measured[f"{name}, {way}"] = {
                "triangles": sizes[-1],
                "processor seconds of all runs": busy,
                "summed area": area.tolist(),
                "reduction in percent": (100 * (1 - area[1:] / area[:-1])).tolist(),
                "mean leaf depth": [leaf_depths(each)[1] for each in runs],
                "nodes a primary ray visits": [
                    float(traced(each, rays, distance).visits.mean()) for each in runs
                ],
            }
        progress(done / len(mesh_models.MESHES))
    small = 500
    low = np.random.default_rng(1).uniform(size=(small, 3))
    gains = _until_nothing_changes(trees.surface_area_tree(low, low + 0.1))
    first = {name: of["reduction in percent"][0] for name, of in measured.items()}
    part = {name: first[f"{name}, 10 levels"] / first[f"{name}, all levels"] for name in mesh_models.MESHES}
    visits = {
        name: measured[f"{name}, 10 levels"]["nodes a primary ray visits"] for name in mesh_models.MESHES
    }
    claims = {
        "the reduction of the area is not as large on further runs": {
            name: max(of["reduction in percent"][1:]) < of["reduction in percent"][0]
            for name, of in measured.items()
        },
        "runs end where nothing changes": len(gains) < MOST,
        "ten levels reduce the area by less than the whole tree": {name: p < 1 for name, p in part.items()},
        "but considerably: by more than half as much": {name: p > 0.5 for name, p in part.items()},
        "after a first run of ten levels primary rays cost very slightly more": {
            name: once > before for name, (before, once, *_) in visits.items()
        },
        "after another one less than before": {
            name: twice < before for name, (before, _, twice, *_) in visits.items()
        },
    }
    numbers = {
        "measured": {
            "meshes": measured,
            "reduction of the first run, ten levels / all": part,
            "runs until nothing changes": len(gains),
            "reductions in percent until nothing changes": gains,
        },
        "printed": {name: list(of) for name, of in PRINTED.items()},
        "claims": claims,
        "note": NOTE.format(side=side, small=small, fewest=min(sizes), most=max(sizes)),
    }
    return _draw(measured), numbers


def _until_nothing_changes(tree: trees.Tree) -> list[float]:
    """Return the reductions in percent of runs, the last one 0 if that many are enough."""
    gains: list[float] = []
    while len(gains) < MOST and (not gains or gains[-1] > 0):
        better = trees.optimal_subtrees(tree)
        gains.append(100 * (1 - trees.summed_area(better) / trees.summed_area(tree)))
        tree = better
    return gains


def _draw(measured: dict[str, dict[str, Any]]) -> Figure:
    figure = titled(
        "Several optimisations of subtrees, one after the other (thesis Table 4.3)", 12.0, 3.9, fontsize=11
    )
    reduced = [f"{r:.2f} %" for r in PRINTED["reduction in percent"]]
    depth = [f"{PRINTED['mean leaf depth'][k]:.2f}" for k in (0, 1, 2, 4)]
    rows = [["thesis: power plant, 10 levels", "13.63e12", *reduced, *depth, *["–"] * 4]]
    for name, of in measured.items():
        reduced = [f"{r:.2f} %" for r in of["reduction in percent"]]
        depth, nodes = of["mean leaf depth"], of["nodes a primary ray visits"]
        few = [f"{depth[k]:.2f}" for k in (0, 1, 2, 4)] + [f"{nodes[k]:.2f}" for k in (0, 1, 2, 4)]
        rows.append([name, f"{of['summed area'][0]:.2f}", *reduced, *few])
    runs = [f"run {k}" for k in range(1, RUNS + 1)]
    heads = ["mesh, levels", "before", *runs, *("before", "run 1", "run 2", "run 4") * 2]
    groups = [
        ("summed area, and by what each run reduces it", 1, 5),
        ("mean leaf depth", 6, 9),
        ("nodes of a primary ray", 10, 13),
    ]
    text_tables.draw(figure.subplots(), heads, rows, groups, [3.0, 1.3, *[1.0] * 12])
    return figure

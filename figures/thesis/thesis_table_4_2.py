"""Thesis Table 4.2: summed area and depth of trees before and after one optimisation of subtrees."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures.shared.meshes import mesh_models
from figures.shared.meshes.traversal import Rays, bounced, leaf_depths, traced
from figures.shared.sheets import text_tables
from figures.shared.sheets.curves import titled
from figures.shared.turns import timed

SIZE = {"draft": "draft", "paper": "large"}
"""Of the meshes."""

SIDE = {"draft": 32, "paper": 128}
SETS = {"draft": 10, "paper": 60}
"""Of random boxes of each kind, for the first way of Sect. 4.1.2."""
SCALES = {"40 boxes, spread evenly": (40, 1), "300 boxes, on six scales": (50, 6)}
"""Boxes on a scale, and scales."""

KINDS = ("primary", "diffuse")

PRINTED = {
    "Sponza": (154307, 139191, 9.77, 21, 28, 16.36, 18.48),
    "Conf. (simpl.)": (842865, 731707, 13.19, 22, 26, 16.27, 18.78),
    "Conf. (transf.)": (8412.97, 7309.09, 13.12, 27, 34, 19.93, 24.13),
    "Kitchen": (8281.78, 6843.93, 17.36, 25, 34, 19.26, 23.78),
    "Interior09": (398678, 344896, 13.49, 33, 41, 21.97, 26.00),
    "Buddha": (3.94301e8, 3.90666e8, 0.92, 26, 32, 19.54, 19.88),
}
ROWS = (
    "summed area before",
    "summed area after",
    "summed area, reduction in percent",
    "largest depth before",
    "largest depth after",
    "mean leaf depth before",
    "mean leaf depth after",
)

NOTE = (
    "One triangle a leaf; areas in units of the root's, so that the summed area is the mean number of nodes "
    "that lines spread evenly over those through the root visit. Nodes that rays visit: {side} x {side} "
    "primary rays, and diffuse ones from where these hit; seconds of a processor, in NumPy. The area falls "
    "as the thesis finds it where triangles are of many sizes, as in models of buildings, and little where "
    "they are of about one, as its Buddha's are. It finds the frame rate for primary rays to grow about in "
    "proportion to what the area falls by. 'About' is a factor of 2 between both reductions here, and they "
    "are farther apart on most meshes: primary rays come from one place and end at their hits, so that what "
    "they visit may fall by more or less, or grow. The first way of Sect. 4.1.2 builds trees over optimal "
    "subtrees of up to 8 boxes, over and over. That the result is never worse than the tree before holds for "
    "boxes that are spread evenly, but not for those on several scales: each build is greedy, and no longer "
    "knows how many boxes are in a subtree ({sets} sets of each kind). The second way, of the table, takes "
    "the best arrangement in place, so that the sum cannot grow."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Build and optimise trees of all meshes, and send rays through them."""
    side = SIDE[quality]
    measured: dict[str, dict[str, Any]] = {}
    for done, name in enumerate(mesh_models.MESHES, start=1):
        measured[name] = _of_mesh(mesh_models.made(name, SIZE[quality]), side)
        progress(done / (len(mesh_models.MESHES) + 1))
    growth = {name: [_growth(key, *of) for key in range(SETS[quality])] for name, of in SCALES.items()}
    reduced = {
        name: of["primary rays"]["reduction in percent"] / of[ROWS[2]] for name, of in measured.items()
    }
    claims = {
        "the summed area never grows": all(of[ROWS[2]] >= 0 for of in measured.values()),
        "the summed area falls by 0.92 to 17.36 percent": {
            name: 0.92 <= of[ROWS[2]] <= 17.36 for name, of in measured.items()
        },
        "the mean leaf depth increases": {name: of[ROWS[6]] > of[ROWS[5]] for name, of in measured.items()},
        "the largest depth increases": {name: of[ROWS[4]] > of[ROWS[3]] for name, of in measured.items()},
        "primary rays visit fewer nodes by about as much as the area falls, within a factor of 2": {
            name: 0.5 <= ratio <= 2 for name, ratio in reduced.items()
        },
        "trees built over optimal subtrees have no larger summed area than before": {
            name: max(of) <= 1e-9 for name, of in growth.items()
        },
    }
    numbers = {
        "measured": {
            "meshes": measured,
            "built over optimal subtrees": {
                name: {
                    "part of sets where the summed area is larger": float(np.mean(np.greater(of, 1e-9))),
                    "largest growth in percent": 100 * max(of),
                    "mean change in percent": float(100 * np.mean(of)),
                }
                for name, of in growth.items()
            },
        },
        "printed": {name: dict(zip(ROWS, of, strict=True)) for name, of in PRINTED.items()},
        "claims": claims,
        "note": NOTE.format(side=side, sets=SETS[quality]),
    }
    return _draw(measured), numbers


def _of_mesh(mesh: mesh_models.Mesh, side: int) -> dict[str, Any]:
    low, high = mesh_models.corners(mesh.triangles)
    tree, seconds = timed(lambda: trees.surface_area_tree(low, high))
    better, more = timed(lambda: trees.optimal_subtrees(tree))
    root = float(trees.surface_area(tree.low[-1], tree.high[-1]))
    area = [trees.summed_area(each) / root for each in (tree, better)]
    depth = [leaf_depths(each) for each in (tree, better)]
    values = (*area, 100 * (1 - area[1] / area[0]), depth[0][0], depth[1][0], depth[0][1], depth[1][1])
    found: dict[str, Any] = {"triangles": len(low)} | dict(zip(ROWS, values, strict=True))
    rays = Rays(*mesh_models.camera_rays(mesh, side))
    for kind in KINDS:
        distance = trees.triangle_distances(mesh.triangles, *rays)
        before, after = (traced(each, rays, distance) for each in (tree, better))
        means = float(before.visits.mean()), float(after.visits.mean())
        found[f"{kind} rays"] = {
            "nodes before": means[0],
            "nodes after": means[1],
            "reduction in percent": 100 * (1 - means[1] / means[0]),
        }
        rays = bounced(mesh.triangles, rays, before, 1)
    return found | {
        "processor seconds to build": seconds.processors,
        "processor seconds to optimise": more.processors,
    }


def _growth(key: int, count: int, scales: int) -> float:
    """Return by which part the first way of Sect. 4.1.2 makes the summed area of random boxes larger."""
    random = np.random.default_rng(key)
    low = np.concatenate([random.normal(size=(count, 3)) * 4.0**-k for k in range(scales)])
    high = low + 0.5 * random.uniform(size=low.shape) ** 8
    return _rebuilt(low, high) / trees.summed_area(trees.surface_area_tree(low, high)) - 1


def _rebuilt(low: NDArray, high: NDArray, most: int = 8) -> float:
    """Return the summed area if the largest subtrees of up to ``most`` boxes become optimal, and boxes."""
    total = float(trees.surface_area(low, high).sum())
    while len(low) > 1:
        tree = trees.surface_area_tree(low, high)
        below = [[k] for k in range(tree.size)]
        for one, other in tree.children:
            below.append(below[one] + below[other])
        small = [len(of) <= most for of in below]
        kept = np.ones(len(below), bool)
        for node, pair in enumerate(tree.children, start=tree.size):
            kept[pair] = not small[node]
        parts = [of for of, fits, top in zip(below, small, kept, strict=True) if fits and top]
        for of in parts:
            best = trees.optimal_subtrees(trees.surface_area_tree(low[of], high[of]))
            total += (
                float(trees.surface_area(best.low[len(of) :], best.high[len(of) :]).sum()) if of[1:] else 0
            )
        low, high = (
            np.stack([end(a[of], axis=0) for of in parts]) for a, end in ((low, np.min), (high, np.max))
        )
    return total


def _area(value: float) -> str:
    return f"{value:.2f}" if value < 1e4 else f"{value:,.0f}"


def _draw(measured: dict[str, dict[str, Any]]) -> Figure:
    figure = titled(
        "Trees before and after one optimisation of subtrees: our meshes, and the thesis's (Table 4.2)",
        13.4,
        4.4,
        fontsize=11,
    )
    two = "{:.2f}".format
    formats = (_area, _area, "{:.2f} %".format, str, str, two, two)
    rows = [["triangles", *(str(of["triangles"]) for of in measured.values()), *["–"] * len(PRINTED)]]
    for k, (row, form) in enumerate(zip(ROWS, formats, strict=True)):
        cells = [form(of[row]) for of in measured.values()]
        label = row.removesuffix(" in percent").replace("summed area before", "summed area before (root: 1)")
        rows.append([label, *cells, *(form(of[k]) for of in PRINTED.values())])
    for kind in KINDS:
        for part, form in (("nodes before", "{:.2f}"), ("nodes after", "{:.2f}"), ("reduction", "{:.2f} %")):
            key = part if part != "reduction" else "reduction in percent"
            cells = [form.format(of[f"{kind} rays"][key]) for of in measured.values()]
            rows.append([f"{kind} rays, {part}", *cells, *["–"] * len(PRINTED)])
    for key in ("processor seconds to build", "processor seconds to optimise"):
        rows.append([key, *(f"{of[key]:.2f}" for of in measured.values()), *["–"] * len(PRINTED)])
    heads = ["", *(name.replace("rooms, tessellated", "tessellated") for name in measured), *PRINTED]
    groups = [
        ("our meshes", 1, len(measured)),
        ("thesis, areas in other units", len(measured) + 1, len(heads) - 1),
    ]
    widths = [2.4, *[1.0] * len(measured), *[1.2] * len(PRINTED)]
    text_tables.draw(figure.subplots(), heads, rows, groups, widths)
    return figure

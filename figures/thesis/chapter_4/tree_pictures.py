"""Pictures of trees: nodes that rays visit, clusters of two means and their boxes (Fig. 4.1 to 4.3)."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from analysis import trees
from figures._rc import BLUE, ORANGE
from figures.shared import meshes
from figures.shared.meshes import Rays, trace
from figures.shared.sheets.image_sheets import Row, image_sheet
from figures.shared.sheets.panels import new_figure

SIDE_4_1 = {"draft": 54, "paper": 189}

NOTE_4_1 = (
    "{side} x {side} rays through pixel centres; a node counts if its box is entered on the way to the "
    "nearest hit, nearer children first; one triangle per leaf. The tree is that of the surface area "
    "heuristic by an exact sweep, then one run over the whole tree with subtrees of up to 8 leaves. "
    "Both images of a mesh share a scale. The thesis shows one pair of images as the improvement. Ours "
    "get darker in some places and brighter in others: nodes that move up in the tree are visited by "
    "more rays."
)


def thesis_4_1(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Count visited nodes in each pixel through both trees of each mesh."""
    side = SIDE_4_1[quality]
    images: dict[str, dict[str, NDArray]] = {"before": {}, "after": {}, "after - before": {}}
    captions: dict[str, dict[str, str]] = {row: {} for row in images}
    measured = {}
    for done, name in enumerate(meshes.MESHES, start=1):
        mesh = meshes.made(name, quality)
        rays = Rays(*meshes.camera_rays(mesh, side))
        distance = trees.triangle_distances(mesh.triangles, *rays)
        tree = trees.surface_area_tree(*meshes.corners(mesh.triangles))
        better = trees.optimal_subtrees(tree)
        before, after = (trace(each, rays, distance).visits.reshape(side, side) for each in (tree, better))
        change = after - before
        # A few pixels at silhouettes have far more than all others.
        nodes = float(np.percentile(np.maximum(before, after), 99.5))
        most = float(np.percentile(abs(change), 99)) or 1.0
        measured[name] = {
            "triangles": len(mesh.triangles),
            "mean before": float(before.mean()),
            "mean after": float(after.mean()),
            "reduction in percent": float(100 * (1 - after.mean() / before.mean())),
            "summed area, reduction in percent": 100
            * (1 - trees.summed_area(better) / trees.summed_area(tree)),
            "pixels with fewer": float(np.mean(change < 0)),
            "pixels with more": float(np.mean(change > 0)),
        }
        column = name.replace("rooms, ", "")
        drawn = _false(before / nodes), _false(after / nodes), _false(0.5 + 0.5 * change / most, "RdBu_r")
        texts = (
            f"mean {before.mean():.2f}",
            f"mean {after.mean():.2f}",
            f"{100 * (after.mean() / before.mean() - 1):+.1f} %, red +{most:.0f}",
        )
        for row, image, text in zip(images, drawn, texts, strict=True):
            images[row][column], captions[row][column] = image, text
        progress(done / len(meshes.MESHES))
    title = (
        "Optimised trees save rays most nodes in the tessellated rooms, few elsewhere\n"
        "thesis, Fig. 4.1; nodes visited per ray, from purple (few) to yellow (many); what the optimisation "
        "changes, from blue (fewer) to red (more); our meshes"
    )
    claims = {
        "fewer nodes are traversed after the optimisation, on average over the picture": {
            name: of["mean after"] < of["mean before"] for name, of in measured.items()
        },
        "more pixels have fewer nodes than have more": {
            name: of["pixels with fewer"] > of["pixels with more"] for name, of in measured.items()
        },
    }
    numbers = {"measured": measured, "claims": claims, "note": NOTE_4_1.format(side=side)}
    rows = {row: Row(of, captions=captions[row]) for row, of in images.items()}
    return image_sheet(title, rows), numbers


def _false(part: NDArray, colors: str = "viridis") -> NDArray[np.float64]:
    """Return an image in false colours, from 0 to 1."""
    return colormaps[colors](np.clip(part, 0, 1))[..., :3]


KEYS = {"draft": 40, "paper": 400}
"""Random pairs of first means."""
THICK = 0.02
"""Of the boxes, across the plane of the drawing."""

NOTE_4_2 = (
    "The thesis prints no coordinates; both examples are ours: small boxes in a plane, as of "
    "tessellated ellipses, clustered by their centres from {keys} random pairs of seeds. Cost (Eq. 4.1) "
    "and areas are relative to one box for all. First: A lies in a corner of the box of B and has as "
    "many boxes; with three times as many, the cost is also least for A and B. Second: two ellipses "
    "longer than their distance, with the maximum norm. The thesis blames badly placed seeds, but no "
    "pair separates the ellipses: in this norm the ends of an ellipse are as far from the other mean as "
    "from its own. With the Euclidean norm {euclid:.0%} of the pairs do; if the ellipses are shorter "
    "than their distance, all pairs do with either norm."
)


class Parts(NamedTuple):
    """Two clusters, and what they cost."""

    second: NDArray[np.bool_]
    areas: tuple[float, float]
    cost: float
    """Eq. 4.1, over the same for one box of all."""
    overlap: float
    """Area of what both boxes have in common, over that of the smaller one."""


def ellipse(center: Any, axes: Any, degrees: float, count: int) -> tuple[NDArray, NDArray]:
    """Return boxes of the cells of an ellipse on a plane."""
    steps = (np.arange(count) + 0.5) / count * 2 - 1
    u, v = (a.reshape(-1) for a in np.meshgrid(steps, steps))
    inside = u * u + v * v < 1
    u, v = u[inside] * axes[0], v[inside] * axes[1]
    turn = np.radians(degrees)
    x = center[0] + np.cos(turn) * u - np.sin(turn) * v
    y = center[1] + np.sin(turn) * u + np.cos(turn) * v
    half = np.array([1.2 * max(axes) / count, 1.2 * max(axes) / count, THICK / 2])
    middle = np.stack([x, y, 0 * x], axis=1)
    return middle - half, middle + half


def _join(*objects: tuple[NDArray, NDArray]) -> tuple[NDArray, NDArray, NDArray[np.bool_]]:
    """Return the boxes of two objects, and which are of the second."""
    low, high = (np.concatenate(parts) for parts in zip(*objects, strict=True))
    return low, high, np.arange(len(low)) >= len(objects[0][0])


def _parts(low: NDArray, high: NDArray, second: NDArray[np.bool_]) -> Parts:
    boxes = [(low[part].min(axis=0), high[part].max(axis=0)) for part in (~second, second)]
    one, other = (float(trees.surface_area(*box)) for box in boxes)
    common = [np.maximum(boxes[0][0], boxes[1][0]), np.minimum(boxes[0][1], boxes[1][1])]
    shared = float(trees.surface_area(*common)) if (common[0] <= common[1]).all() else 0.0
    whole = float(trees.surface_area(low.min(axis=0), high.max(axis=0)))
    cost = ((~second).sum() * one + second.sum() * other) / (len(low) * whole)
    return Parts(second, (one / whole, other / whole), float(cost), shared / min(one, other))


def _clusters(low: NDArray, high: NDArray, norm: float, key: int) -> Parts:
    """Return two clusters of the centres of boxes."""
    center = (low + high) / 2
    return _parts(low, high, _children(trees.two_means_tree(center, center, tries=1, norm=norm, key=key)))


def _children(tree: trees.Tree) -> NDArray[np.bool_]:
    """Return which boxes are below the second child of the root."""
    below = np.zeros(2 * tree.size - 1, bool)
    below[tree.children[-1, 1]] = True
    for node in range(2 * tree.size - 3, tree.size - 1, -1):
        below[tree.children[node - tree.size]] = below[node] | below[tree.children[node - tree.size]]
    return below[: tree.size]


def _same(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    return bool(np.array_equal(one, other) or np.array_equal(one, ~other))


def thesis_4_2(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Cluster both examples with many first means, and draw the clusters with their boxes."""
    keys = KEYS[quality]
    slanted = _join(ellipse((0.12, 0.88), (0.1, 0.1), 0, 19), ellipse((0.5, 0.5), (0.68, 0.07), 45, 19))
    beside = _join(ellipse((0.5, 0.7), (0.45, 0.1), 0, 15), ellipse((0.5, 0.3), (0.45, 0.1), 0, 15))
    found: dict[str, dict[str, Any]] = {}
    for name, (low, high, known), norm in (("4.2", slanted, 2), ("4.3", beside, np.inf)):
        clusters = [_clusters(low, high, norm, key) for key in range(keys)]
        found[name] = {
            "clusters": clusters,
            "objects": _parts(low, high, known),
            "heuristic": _parts(low, high, _children(trees.surface_area_tree(low, high))),
            "part": float(np.mean([_same(c.second, known) for c in clusters])),
        }
        progress(0.4 if name == "4.2" else 0.8)
    euclid = float(np.mean([_same(_clusters(*beside[:2], 2, key).second, beside[2]) for key in range(keys)]))
    slant, side = found["4.2"], found["4.3"]
    split = slant["heuristic"]
    worst = max(side["clusters"], key=lambda c: sum(c.areas))
    figure = new_figure(
        "Boxes of 2-means clusters overlap far more than those of the surface area heuristic\n"
        "thesis, Fig. 4.2 and 4.3; cost: by the surface area heuristic (Eq. 4.1); overlap: part of the "
        "smaller box; above, 2-means separate object A from B, the heuristic divides B",
        4.9,
    )
    panels = figure.subplots(2, 2, height_ratios=[1, 0.62])
    above = {
        "2-means, Euclidean norm": slant["clusters"][0],
        "surface area heuristic": slant["heuristic"],
    }
    below = {
        "2-means, largest coordinate, worst seeds": worst,
        "surface area heuristic": side["heuristic"],
    }
    for row, boxes, parts in zip(panels, (slanted, beside), (above, below), strict=True):
        for axes, (title, of) in zip(row, parts.items(), strict=True):
            _draw(axes, title, boxes[0], boxes[1], of)
    for axes in panels[0]:
        axes.text(0.25, 0.88, "A", va="center")
        axes.text(0.62, 0.5, "B", va="center")
    low, high, of_b = slanted
    a, b = ((low[part].min(axis=0), high[part].max(axis=0)) for part in (~of_b, of_b))
    measured = {
        "Fig. 4.2": {
            "first means that end with A and B apart": slant["part"],
            "A and B": _numbers(slant["objects"]),
            "2-means": _numbers(slant["clusters"][0]),
            "surface area heuristic": _numbers(slant["heuristic"]),
        },
        "Fig. 4.3": {
            "first means that end with both ellipses apart": side["part"],
            "the same with the Euclidean norm": euclid,
            "both ellipses": _numbers(side["objects"]),
            "2-means, worst": _numbers(worst),
            "surface area heuristic": _numbers(side["heuristic"]),
        },
    }
    claims = {
        "the box of A is enclosed completely in that of B": bool(
            (a[0] >= b[0]).all() and (a[1] <= b[1]).all()
        ),
        "2-means assign A and B to different clusters": slant["part"] > 0.5,
        "the heuristic splits B, and the boxes overlap much less": (
            not _same(split.second, slanted[2]) and split.overlap < 0.5 * slant["objects"].overlap
        ),
        "with the largest coordinate as norm the areas of clusters are not minimised": (
            sum(worst.areas) > 1.05 * sum(side["objects"].areas)
        ),
        "other first means assign each ellipse to a cluster of its own": 0 < side["part"] < 1,
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE_4_2.format(keys=keys, euclid=euclid)}


def _numbers(of: Parts) -> dict[str, float]:
    return {
        "sum of both areas / that of all": sum(of.areas),
        "c / that of all in one box": of.cost,
        "overlap / the smaller box": of.overlap,
        "boxes in the smaller part": int(min(of.second.sum(), (~of.second).sum())),
    }


def _draw(axes: Axes, title: str, low: NDArray, high: NDArray, of: Parts) -> None:
    for part, color in ((~of.second, BLUE), (of.second, ORANGE)):
        middle = (low[part] + high[part]) / 2
        axes.plot(middle[:, 0], middle[:, 1], ".", color=color, ms=3)
        corner, far = low[part].min(axis=0), high[part].max(axis=0)
        axes.add_patch(Rectangle((corner[0], corner[1]), *(far - corner)[:2], fill=False, ec=color, lw=1.6))
    axes.set_title(f"{title}\ncost {of.cost:.2f}, overlap {of.overlap:.2f}")
    axes.set(aspect="equal", xlim=(-0.06, 1.06))
    axes.set_axis_off()

"""Thesis Fig. 4.1: the nodes that primary rays visit, before and after the optimisation of subtrees."""

from collections.abc import Callable

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures.shared.meshes import mesh_models
from figures.shared.meshes.traversal import Rays, traced
from figures.shared.sheets.image_sheets import Panel, image_grid

SIDE = {"draft": 48, "paper": 288}

NOTE = (
    "{side} x {side} rays through pixel centres; a node counts if its box is entered on the way to the "
    "nearest hit, nearer children first; one triangle a leaf. The tree is that of the surface area heuristic "
    "by an exact sweep, then one run over the whole tree with subtrees of up to 8 leaves. Both images of a "
    "mesh have the same scale; in the difference grey is the same number, black is fewer after. The thesis "
    "shows one pair of images as the improvement. Ours get darker in some places and brighter in others: "
    "what moves up in the tree is visited by rays that did not visit it before."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Count visited nodes in each pixel through both trees of each mesh."""
    side = SIDE[quality]
    panels, measured = [], {}
    for done, name in enumerate(mesh_models.MESHES, start=1):
        mesh = mesh_models.made(name, quality)
        rays = Rays(*mesh_models.camera_rays(mesh, side))
        distance = trees.triangle_distances(mesh.triangles, *rays)
        tree = trees.surface_area_tree(*mesh_models.corners(mesh.triangles))
        better = trees.optimal_subtrees(tree)
        before, after = (traced(each, rays, distance).visits.reshape(side, side) for each in (tree, better))
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
        for when, visits in (("before", before), ("after", after)):
            caption = f"{name}: {when}\nmean {visits.mean():.2f}, yellow {nodes:.0f} nodes"
            panels.append(Panel(caption, _false(visits / nodes)))
        caption = (
            f"after - before: {100 * (after.mean() / before.mean() - 1):+.2f} %\n"
            f"blue -{most:.0f}, red +{most:.0f}"
        )
        panels.append(Panel(caption, _false(0.5 + 0.5 * change / most, "RdBu_r")))
        progress(done / len(mesh_models.MESHES))
    title = f"Nodes that a ray visits, {side} x {side} pixels\n(thesis Fig. 4.1, on our meshes)"
    claims = {
        "fewer nodes are traversed after the optimisation, on average over the picture": {
            name: of["mean after"] < of["mean before"] for name, of in measured.items()
        },
        "more pixels have fewer nodes than have more": {
            name: of["pixels with fewer"] > of["pixels with more"] for name, of in measured.items()
        },
    }
    numbers = {"measured": measured, "claims": claims, "note": NOTE.format(side=side)}
    return image_grid(title, panels, 3, 288), numbers


def _false(part: NDArray, colors: str = "viridis") -> NDArray[np.float64]:
    """Return an image in false colours, from 0 to 1."""
    return colormaps[colors](np.clip(part, 0, 1))[..., :3]

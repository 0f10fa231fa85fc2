"""Thesis Fig. 4.1: the nodes that primary rays visit, before and after the optimisation of subtrees."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from analysis import trees
from figures.shared import mesh_models
from figures.shared.image_grid import Panel, image_grid
from figures.shared.traversal import Rays, traced

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
        white = float(np.percentile(np.maximum(before, after), 99.5))
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
        panels += [
            Panel(f"{name}: before\nmean {before.mean():.2f}, white {white:.0f} nodes", before, (0.0, white)),
            Panel(f"{name}: after\nmean {after.mean():.2f}, white {white:.0f} nodes", after, (0.0, white)),
            Panel(
                f"after - before: {100 * (after.mean() / before.mean() - 1):+.2f} %\n"
                f"black -{most:.0f}, white +{most:.0f}",
                change,
                (-most, most),
            ),
        ]
        progress(done / len(mesh_models.MESHES))
    title = f"Visited nodes by pixel, {side} x {side}\n(thesis Fig. 4.1, on our meshes)"
    claims = {
        "fewer nodes are traversed after the optimisation, on average over the picture": {
            name: of["mean after"] < of["mean before"] for name, of in measured.items()
        },
        "more pixels have fewer nodes than have more": {
            name: of["pixels with fewer"] > of["pixels with more"] for name, of in measured.items()
        },
    }
    return image_grid(title, panels, 3, 288), {
        "measured": measured,
        "claims": claims,
        "note": NOTE.format(side=side),
    }

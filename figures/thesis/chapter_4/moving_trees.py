"""Thesis Sect. 4.2 and 4.3: trees over moving triangles, their expected cost, nodes and memory."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures._rc import BLACK, BLUE, GREEN, LETTERS, ORANGE, PURPLE, VERMILLION
from figures.plot import Style
from figures.shared import meshes
from figures.shared.meshes import Mesh, Rays, helicopter_parts, knots, terrain, trace
from figures.shared.sheets.panels import curve, legend_below, name_axes, new_figure

SIDE = {"draft": 24, "paper": 96}
PARTS = {"draft": (2, 8), "paper": (2, 4, 8, 16)}
"""Of the shutter, with a tree each."""
KAPPAS = {"draft": (2.0, 4.0), "paper": (2.0, 4.0, 8.0)}
"""Split triangles have parts of at most 1 / kappa of the area of their box."""
MOST = 16
"""Parts of a triangle in time."""


class Moving(NamedTuple):
    """A triangle mesh in motion."""

    times: NDArray[np.float64]
    triangles: NDArray[np.float64]
    """(k, n, 3, 3): at each of the times; vertices are on straight lines between."""
    view: Mesh
    """The mesh when the shutter opens, with its camera."""


def flying_helicopter(detail: int, segments: int = 36) -> Moving:
    """Return the helicopter over still ground, its motion in linear segments."""
    times = np.linspace(0, 1, segments + 1)
    parts = np.concatenate([part for part, _ in helicopter_parts(detail, times)], axis=1)
    return Moving(times, parts, Mesh(parts[0], (5.5, 7.2, 8.6), (-0.3, 2.0, 0.0), 50.0))


def flying_knots(detail: int) -> Moving:
    """Return the crowd of knots, each on its own line, some of them fast."""
    mesh = knots(detail)
    count = len(mesh.triangles) // 25
    way = np.random.default_rng(4).normal(size=(25, 1, 1, 3)) * np.array([2.5, 0.5, 2.5])
    end = mesh.triangles.reshape(25, count, 3, 3) + way
    return Moving(np.array([0.0, 1.0]), np.stack([mesh.triangles, end.reshape(-1, 3, 3)]), mesh)


def hail(detail: int, count: int) -> Moving:
    """Return small triangles that fall far over a still terrain; the first along the diagonal of all."""
    ground = terrain(detail)
    rng = np.random.default_rng(5)
    low, high = (end(ground.triangles, axis=(0, 1)) for end in (np.min, np.max))
    start = rng.uniform([0, high[1], 0], [10, high[1] + 3, 10], (count, 3))
    end = start + rng.normal(size=(count, 3)) * 0.4 - np.array([0, 3.0, 0])
    around = np.concatenate([start, end, [low, high]])
    start[0], end[0] = around.min(axis=0), around.max(axis=0)
    shapes = 0.05 * rng.normal(size=(count, 3, 3))
    stones, fallen = start[:, None] + shapes, end[:, None] + shapes
    moved = np.concatenate([ground.triangles, fallen])
    opened = np.concatenate([ground.triangles, stones])
    return Moving(np.array([0.0, 1.0]), np.stack([opened, moved]), ground._replace(triangles=opened))


SCENES: dict[str, dict[str, Callable[[], Moving]]] = {
    "helicopter": {
        "draft": lambda: flying_helicopter(4, 12),
        "paper": lambda: flying_helicopter(10),
    },
    "knots": {"draft": lambda: flying_knots(3), "paper": lambda: flying_knots(6)},
    "hail": {"draft": lambda: hail(2, 200), "paper": lambda: hail(8, 4000)},
}

TICKS = (2, 4, 8, 16, 32, 64)
WHOLE, HALF, INTERPOLATED, REFITTED = (
    "whole shutter",
    "interpolated, tree of half-way",
    "interpolated, tree of the whole",
    "tree of the first part, refitted",
)
DEGRADED = 1.1
"""As many nodes as of a new tree, or more."""
STYLES = {
    WHOLE: (BLACK, "o"),
    INTERPOLATED: (BLUE, "s"),
    HALF: (PURPLE, "D"),
    "trees of parts": (VERMILLION, "^"),
    REFITTED: (ORANGE, "<"),
    "split, kappa": (GREEN, "v"),
}

NOTE = (
    "Linear motion between two times, for the helicopter {knots}: its rotors turn 2.25 times. The "
    "ground and the terrain are still. Expected nodes: summed areas relative to the area of the scene's "
    "box over all times, the mean over lines spread evenly in space and time. Visited nodes: {side} x "
    "{side} primary rays, each at its own time. A box counts once per stored time or part. "
    "Interpolated boxes are stored for all times; 'half-way' uses the tree for the middle of the "
    "shutter. Each of the 2 to {parts} parts of the shutter has its own tree (Eq. 4.7), or that of the "
    "first of {parts} with its boxes fitted anew (4.2.2). Triangles split "
    "in time have up to {most} parts, with at most 1 / kappa of the area if that is enough, in one tree "
    "over boxes in space and time, areas weighted by duration. In the hail a small triangle flies along "
    "the scene's diagonal."
)


class Way(NamedTuple):
    """What a way costs."""

    expected: float
    visited: float
    boxes: float
    """Per triangle."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Build trees in all ways over all scenes, and send rays through them."""
    found: dict[str, dict[str, Way]] = {}
    counts: dict[str, dict[str, float]] = {}
    boxes: dict[str, dict[str, float]] = {}
    degraded: dict[str, dict[str, float]] = {}
    knots = 0
    for done, name in enumerate(SCENES, start=1):
        scene = SCENES[name][quality]()
        knots = max(knots, len(scene.times))
        found[name], counts[name], boxes[name], degraded[name] = _of_scene(scene, quality)
        progress(done / len(SCENES))
    measured = {
        name: {
            "ways": {way: of._asdict() for way, of in found[name].items()},
            "parts of triangles / triangles, by kappa": counts[name],
            "largest box of a triangle / that of all": boxes[name],
            "nodes, refitted / new tree, by part": degraded[name],
        }
        for name in SCENES
    }
    cheapest = {name: min(of.values(), key=lambda way: way.visited) for name, of in found.items()}
    ways = [WHOLE, *map(_parts, PARTS[quality])]
    claims = {
        "interpolated boxes pay off: fewer nodes are visited than with boxes for the whole shutter": {
            name: of[INTERPOLATED].visited < of[WHOLE].visited for name, of in found.items()
        },
        "it is better to build the tree for a time instant than over the whole shutter": {
            name: of[HALF].visited < of[INTERPOLATED].visited for name, of in found.items()
        },
        "a tree for each part of the shutter fits better: fewer nodes are visited, the more parts": {
            name: all(of[after].visited < of[before].visited for before, after in pairwise(ways))
            for name, of in found.items()
        },
        "refitted trees do for the next part of the shutter, and degrade: a tenth more nodes in the last": {
            name: of["2"] < DEGRADED < of[str(PARTS[quality][-1])] for name, of in degraded.items()
        },
        "the box of a small triangle on the diagonal is as large as the scene": boxes["hail"]["whole"] > 0.95,
        "parts of the shutter ameliorate that": boxes["hail"][f"{PARTS[quality][-1]} parts"] < 0.05,
        "splitting triangles in time lowers what is expected": {
            name: of[_split(2.0)].expected < of[WHOLE].expected for name, of in found.items()
        },
        "it multiplies the triangles, by more than 2 at kappa 2": {
            name: of[f"{2.0:g}"] > 2 for name, of in counts.items()
        },
    }
    numbers = {
        "measured": measured
        | {"fewest visited nodes": {name: way.visited for name, way in cheapest.items()}},
        "claims": claims,
        "note": NOTE.format(knots=knots, side=SIDE[quality], parts=PARTS[quality][-1], most=MOST),
    }
    return _draw(found), numbers


def _parts(count: int) -> str:
    return f"trees of parts: {count}"


def _split(kappa: float) -> str:
    return f"split, kappa: {kappa:g}"


def _of_scene(
    scene: Moving, quality: str
) -> tuple[dict[str, Way], dict[str, float], dict[str, float], dict[str, float]]:
    times, vertices = scene.times, scene.triangles
    low, high = meshes.corners(vertices)
    whole = trees.boxes_during(low, high, times)
    everything = float(trees.surface_area(whole[0].min(axis=0), whole[1].max(axis=0)))
    rays = Rays(*meshes.camera_rays(scene.view, SIDE[quality]))
    when = np.random.default_rng(6).uniform(size=len(rays.origin))
    count = low.shape[1]

    def way(tree: trees.Tree, number: Any = None) -> Way:
        distance = trees.triangle_distances(vertices, *rays, times=times, time=when, number=number)
        visited = trace(tree, rays, distance, when).visits.mean()
        stored = (2 * tree.size - 1) * (1 if tree.times is None else len(times))
        return Way(trees.summed_area(tree) / everything, float(visited), stored / count)

    tree = trees.surface_area_tree(*whole)
    middle = trees.surface_area_tree(*trees.boxes_during(low, high, times, 0.5, 0.5))
    found = {
        WHOLE: way(tree),
        INTERPOLATED: way(trees.refitted(tree, low, high, times)),
        HALF: way(trees.refitted(middle, low, high, times)),
    }
    degraded: dict[str, float] = {}
    largest = {"whole": float(trees.surface_area(*whole).max()) / everything}
    for parts in PARTS[quality]:
        cuts = np.linspace(0, 1, parts + 1)
        own = np.minimum((when * parts).astype(int), parts - 1)
        names = [_parts(parts)] + [f"{REFITTED}: {parts}"] * (parts == PARTS[quality][-1])
        visited, expected = np.zeros((2, len(names), parts))
        first, most = None, 0.0
        for part in range(parts):
            boxes = trees.boxes_during(low, high, times, cuts[part], cuts[part + 1])
            new, now = trees.surface_area_tree(*boxes), own == part
            first = first or new
            few = Rays(rays.origin[now], rays.direction[now])
            distance = trees.triangle_distances(vertices, *few, times=times, time=when[now])
            for k, tree in enumerate((new, trees.refitted(first, *boxes))[: len(names)]):
                visited[k, part] = trace(tree, few, distance).visits.sum() / len(when)
                expected[k, part] = trees.summed_area(tree) / everything
            most = max(most, float(trees.surface_area(*boxes).max()) / everything)
        for name, nodes, areas in zip(names, visited, expected, strict=True):
            found[name] = Way(float(areas.mean()), float(nodes.sum()), parts * (2 * count - 1) / count)
        largest[f"{parts} parts"] = most
        degraded = {
            f"{part}": float(kept / new) for part, (new, kept) in enumerate(visited[[0, -1]].T, start=1)
        }
    counts = {}
    for kappa in KAPPAS[quality]:
        lows, highs, number = trees.split_in_time(low, high, times, kappa, most=MOST)
        found[_split(kappa)] = way(trees.surface_area_tree(lows, highs), number)
        counts[f"{kappa:g}"] = len(number) / count
    return found, counts, largest, degraded


def _draw(found: dict[str, dict[str, Way]]) -> Figure:
    figure = new_figure(
        "Trees that follow the motion need fewer nodes than boxes for the whole shutter\n"
        "thesis, Sect. 4.2 and 4.3; kappa: a triangle is split in time into parts of at most 1 / kappa of "
        "its area; in the hail, small triangles fly",
        3.2,
    )
    panels = figure.subplots(1, len(found))
    for axes, (name, of) in zip(panels, found.items(), strict=True):
        _draw_ways(axes, of)
        axes.set_xscale("log", base=2)
        name_axes(axes, "boxes stored per triangle", "", name, ticks=TICKS)
        axes.set_ylim(0, 1.08 * of[WHOLE].visited)
    figure.supylabel("nodes visited per primary ray", fontsize=LETTERS)
    legend_below(figure, panels[0], 3)
    return figure


def _draw_ways(axes: Axes, of: dict[str, Way]) -> None:
    for kind, (color, marker) in STYLES.items():
        ways = [(name, way) for name, way in of.items() if name.split(": ")[0] == kind]
        values = ", ".join(name.split(": ")[1] for name, _ in ways if ": " in name)
        label = f"{kind}: {values}" if values else kind
        costs = {way.boxes: way.visited for _, way in ways}
        curve(axes, costs, Style(color, marker), ms=5, lw=0.8, label=label)
    axes.axhline(of[WHOLE].visited, color=BLACK, lw=0.6, ls=":")

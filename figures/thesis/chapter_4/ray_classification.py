"""Thesis Sect. 4.3.2: ray classification, by hyper-cubes in 5-D, and 6-D with time, beside trees."""

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures._rc import BLACK, BLUE, VERMILLION
from figures.shared import judged, meshes
from figures.shared.meshes import Rays
from figures.shared.sheets.panels import legend_below, name_axes, new_figure
from figures.thesis.chapter_4.moving_trees import SCENES, Moving

SETS = {"draft": 4, "paper": 16}
PRIMARY, SPREAD = "primary rays", "spread rays"
WHOLE, INTERPOLATED = "tree of the whole shutter", "tree of interpolated boxes"
CASES = {
    "draft": ((SPREAD, 32), (PRIMARY, 32), (PRIMARY, 256)),
    "paper": ((SPREAD, 512), (PRIMARY, 512), (PRIMARY, 4096), (PRIMARY, 32768)),
}
"""Kinds and numbers of rays that share hyper-cubes."""
MOST, FEW, DEEPEST = 16, 4, 40
"""Hyper-cubes of so many candidates, or rays, are not split any more; nor those after so many splits."""
HALVINGS = 5
"""Of the shutter, at most."""
Cases = tuple[tuple[str, int], ...]
WAYS = {"ray classification, 5-D": 5, "ray classification, 6-D": 6}

NOTE = (
    "The scenes of thesis-4.3.1 as in drafts, {sets} sets of rays, each ray at its own time; of 'spread' "
    "rays origins are uniform in the scene's box. Hyper-cubes are halved along their longest side until they "
    "have at most {most} candidates or {few} rays; in 5-D candidates are those of the whole shutter, in 6-D "
    "it is halved up to {halvings} times. Tests: of beams and boxes, for hyper-cubes that have rays, and of "
    "all candidates; in trees of rays with boxes and triangles, without what it takes to build the tree. "
    "First hits are the same, of {seen} rays of each set; only these go through trees."
)


class Classified(NamedTuple):
    """Candidates of rays."""

    ray: NDArray[np.int64]
    triangle: NDArray[np.int64]
    stored: int
    """Candidates of all hyper-cubes."""
    tests: int
    """Of beams and boxes."""


def boxes_in_time(low: NDArray, high: NDArray, times: NDArray) -> tuple[NDArray, NDArray]:
    """Return boxes of the shutter, its halves, their halves and so on: (2 ** (HALVINGS + 1), n, 3)."""
    parts = [(0.0, 1.0)] + [(k / 2**m, (k + 1) / 2**m) for m in range(HALVINGS + 1) for k in range(2**m)]
    lows, highs = zip(*(trees.boxes_during(low, high, times, *part) for part in parts), strict=True)
    return np.stack(lows), np.stack(highs)


def classify(boxes: tuple[NDArray, NDArray], rays: Rays, time: NDArray, dims: int) -> Classified:
    """Return the candidates of rays, by hyper-cubes of origins, directions and, if there are 6, times.

    Directions are points of the faces of a cube, as by J. Arvo and D. Kirk ("Fast Ray Tracing by Ray
    Classification", 1987). Hyper-cubes without rays are not made.
    """
    axis = abs(rays.direction).argmax(axis=1)
    sign = np.sign(rays.direction[np.arange(len(axis)), axis])
    found = []
    for first, way in product(range(3), (-1, 1)):
        mine, turn = np.flatnonzero((axis == first) & (sign == way)), np.roll(range(3), -first)
        if len(mine):
            flip = np.array([way, 1, 1])
            origin, direction = (a[mine][:, turn] * flip for a in rays)
            point = np.column_stack([origin, direction[:, 1:] / direction[:, :1], time[mine]])
            ends = [a[: 2 if dims == 5 else None, :, turn] * flip for a in boxes]
            part = _descend((np.minimum(*ends), np.maximum(*ends)), point, dims)
            found.append(part._replace(ray=mine[part.ray]))
    ray, triangle, stored, tests = zip(*found, strict=True)
    return Classified(np.concatenate(ray), np.concatenate(triangle), sum(stored), sum(tests))


def _descend(boxes: tuple[NDArray, NDArray], point: NDArray, dims: int) -> Classified:
    """Return the candidates of rays that go along the first axis: (n, 6), with slopes and times."""
    low, high = point.min(axis=0)[None], point.max(axis=0)[None]
    low[:, 5], high[:, 5] = 0, 1
    # Of hyper-cubes: the part of the shutter. Of rays: the hyper-cube. Of pairs: hyper-cube and triangle.
    part, ray, own = np.ones(1, int), np.arange(len(point)), np.zeros(len(point), int)
    triangle = np.arange(boxes[0].shape[1])
    cube = np.zeros_like(triangle)
    scale = np.append(np.full(3, (boxes[1][0].max(axis=0) - boxes[0][0].min(axis=0)).max()), [2, 2, 1])
    found, stored, tests = [], 0, 0
    for level in range(DEEPEST + 1):
        near, far = (a[part[cube], triangle] for a in boxes)
        tests += len(cube)
        hit = beam_meets_box(low[cube], high[cube], near, far)
        cube, triangle = cube[hit], triangle[hit]
        count = np.bincount(cube, minlength=len(low))
        start = np.cumsum(count) - count
        done = (count <= MOST) | (np.bincount(own, minlength=len(low)) <= FEW) | (level == DEEPEST)
        stored += int(count[done].sum())
        here = done[own]
        each = count[own[here]]
        place = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        found.append((np.repeat(ray[here], each), triangle[np.repeat(start[own[here]], each) + place]))
        ray, own = ray[~here], own[~here]
        if not len(ray):
            break
        size = (high - low) / scale
        size[:, 5] = np.where((dims == 6) & (part < 2**HALVINGS), size[:, 5], -1)
        axis = size.argmax(axis=1)
        middle = ((low + high) / 2)[np.arange(len(low)), axis]
        above = point[ray, axis[own]] >= middle[own]
        children, own = np.unique(2 * own + above, return_inverse=True)
        parent, side = children // 2, children % 2 == 1
        cube, triangle = np.concatenate([2 * cube, 2 * cube + 1]), np.tile(triangle, 2)
        kept = np.flatnonzero(np.isin(cube, children))
        kept = kept[np.argsort(cube[kept], kind="stable")]
        cube, triangle = np.searchsorted(children, cube[kept]), triangle[kept]
        low, high, axis, middle, part = low[parent], high[parent], axis[parent], middle[parent], part[parent]
        low[side, axis[side]], high[~side, axis[~side]] = middle[side], middle[~side]
        part = np.where(axis == 5, 2 * part + side, part)
    rays, triangles = zip(*found, strict=True)
    return Classified(np.concatenate(rays), np.concatenate(triangles), stored, tests)


def beam_meets_box(low: NDArray, high: NDArray, near: NDArray, far: NDArray) -> NDArray[np.bool_]:
    """Return whether rays of beams meet boxes: a ray goes by t along the first axis, slopes times t aside.

    All limits of t are linear, so that the test is exact, but for a little more because of rounding.
    """
    first, last = np.maximum(near[:, 0] - high[:, 0], 0), far[:, 0] - low[:, 0]
    fits = np.ones(len(low), bool)
    for k in (1, 2):
        for slope, room in (
            (low[:, k + 2], far[:, k] - low[:, k]),
            (-high[:, k + 2], high[:, k] - near[:, k]),
        ):
            with np.errstate(divide="ignore", invalid="ignore"):
                bound = room / slope
            last = np.where(slope > 0, np.minimum(last, bound), last)
            first = np.where(slope < 0, np.maximum(first, bound), first)
            fits &= (slope != 0) | (room >= 0)
    return fits & (first <= last + 1e-9 * (1 + abs(last)))


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Count the tests of sets of rays, by trees and by ray classification."""
    names = ("tests per ray", "of triangles", "stored per triangle")
    measured: dict[str, dict[str, Any]] = {}
    inferior = {}
    for done, scene in enumerate(SCENES, start=1):
        for case, found in _of_scene(SCENES[scene]["draft"](), SETS[quality], CASES[quality]).items():
            measured.setdefault(scene, {})[case] = {
                way: dict(zip(names, map(judged.interval, of.T), strict=True)) for way, of in found.items()
            }
            more = [judged.smaller(found[INTERPOLATED][:, 0], found[way][:, 0]) for way in WAYS]
            inferior[f"{scene}, {case}"] = judged.all_of(*more)
        progress(done / len(SCENES))
    claims = {"ray classification is inferior: more tests per ray than in a tree, 5-D and 6-D": inferior}
    note = NOTE.format(sets=SETS[quality], most=MOST, few=FEW, halvings=HALVINGS, seen=CASES[quality][0][1])
    return _draw(measured, CASES[quality]), {"measured": measured, "claims": claims, "note": note}


def _of_scene(scene: Moving, sets: int, cases: Cases) -> dict[str, dict[str, NDArray[np.float64]]]:
    """Return all tests per ray, those of triangles, and what is stored per triangle: (sets, 3) by way."""
    times, (low, high) = scene.times, meshes.corners(scene.triangles)
    boxes = boxes_in_time(low, high, times)
    tree = trees.surface_area_tree(boxes[0][1], boxes[1][1])
    built = {WHOLE: tree, INTERPOLATED: trees.refitted(tree, low, high, times)}
    camera, size, few = meshes.camera_rays(scene.view, 256), low.shape[1], cases[0][1]
    found: dict[str, dict[str, NDArray]] = {}

    def draw(kind: str, count: int, key: int) -> tuple[NDArray, NDArray, NDArray]:
        random = np.random.default_rng(key)
        some, when = random.choice(len(camera[0]), count, replace=False), random.uniform(size=count)
        if kind == PRIMARY:
            return camera[0][some], camera[1][some], when
        origin = random.uniform(low.min(axis=(0, 1)), high.max(axis=(0, 1)), (count, 3))
        return origin, random.normal(size=(count, 3)), when

    for kind, count in cases:
        drawn = [draw(kind, count, key) for key in range(sets)]
        of = found[f"{count} {kind}"] = {way: np.zeros((sets, 3)) for way in (*built, *WAYS)}
        # The rays of all sets that go through trees, together.
        *rays, when = (np.concatenate([a[:few] for a in part]) for part in zip(*drawn, strict=True))
        distance = trees.triangle_distances(scene.triangles, *rays, times=times, time=when)
        first = []
        for way, tree in built.items():
            tested = np.zeros(sets * few, np.int64)

            def counted(ray: NDArray, leaf: NDArray, tested: Any = tested, at: Any = distance) -> NDArray:
                tested[ray] += 1  # A ray visits one node at a time.
                return at(ray, leaf)

            traced = meshes.trace(tree, Rays(*rays), counted, when)
            visits, hits = (of_rays.reshape(sets, few).mean(axis=1) for of_rays in (traced.visits, tested))
            stored = (2 - 1 / size) * (len(times) if tree.times is not None else 1)
            of[way][:] = np.stack([1 + 2 * (visits - hits) + hits, hits, np.full(sets, stored)], axis=1)
            first.append(traced.distance.reshape(sets, few))
        for (way, dims), (key, (*one, time)) in product(WAYS.items(), enumerate(drawn)):
            made = classify(boxes, Rays(*one), time, dims)
            hits = len(made.ray) / count
            of[way][key] = made.tests / count + hits, hits, made.stored / size
            nearest, seen = np.full(few, np.inf), made.ray < few
            pairs = made.ray[seen], made.triangle[seen]
            np.minimum.at(nearest, pairs[0], distance(pairs[0] + key * few, pairs[1]))
            if not all(np.array_equal(nearest, of_tree[key]) for of_tree in first):
                raise ValueError(f"first hits of {kind} differ between ways")
    return found


def _draw(measured: dict[str, dict[str, Any]], cases: Cases) -> Figure:
    figure = new_figure(
        "Ray classification needs fewer tests than trees only if very many rays share candidates\n"
        "thesis, Sect. 4.3.2; in 6-D hyper-cubes divide the time, too; open markers: rays spread over the "
        "scene, other lines and markers: primary rays",
        4.4,
    )
    panels, ticks = figure.subplots(2, len(measured)), sorted({count for _, count in cases})
    styles = {WHOLE: "0.6", INTERPOLATED: BLACK} | dict(zip(WAYS, (BLUE, VERMILLION), strict=True))
    for row, key in zip(panels, ("tests per ray", "stored per triangle"), strict=True):
        for axes, (scene, of) in zip(row, measured.items(), strict=True):
            for (way, color), kind in product(styles.items(), (PRIMARY, SPREAD)):
                if way in WAYS or kind == PRIMARY:
                    counts = [count for other, count in cases if other == kind]
                    values = [of[f"{count} {kind}"][way][key]["mean"] for count in counts]
                    look = {"label": way} if kind == PRIMARY else {"mfc": "white"}
                    axes.plot(counts, values, "o-" if way in WAYS else "--", color=color, ms=5, **look)
            name_axes(axes, "number of rays", key, scene, log="xy", ticks=ticks, few_decades=True)
    legend_below(figure, panels[0, 0], 2)
    return figure

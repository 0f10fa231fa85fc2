"""Trees before and after optimisations of their subtrees (Tables 4.2 and 4.3)."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import trees
from figures.shared import judged, meshes
from figures.shared.costs import in_turns, timed
from figures.shared.meshes import Rays, bounce, leaf_depths, trace
from figures.shared.sheets.panels import new_figure, text_table

SIZE = {"draft": "draft", "paper": "large"}
"""Of the meshes."""

SIDE_4_2 = {"draft": 32, "paper": 128}
SETS = {"draft": 4, "paper": 60}
"""Of random boxes of each kind, for the first way of Sect. 4.1.2."""
SCALES = {"40 boxes, spread evenly": (40, 1), "300 boxes, on six scales": (50, 6)}
"""Boxes on a scale, and scales."""

KINDS = ("primary", "diffuse")

PRINTED_4_2 = {
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

NOTE_4_2 = (
    "One triangle per leaf; areas relative to the root, so that the summed area is the mean number of "
    "nodes visited by lines spread evenly through the root. Nodes visited: by {side} x {side} primary "
    "rays, and diffuse ones from their hits; processor seconds in NumPy. As in the thesis, the area "
    "falls for triangles of many sizes, as in buildings, and little for triangles of similar size, as "
    "in the Buddha. The thesis finds that the frame rate of primary rays grows about in proportion. "
    "Here 'about' means within a factor of 2, which most meshes miss: primary rays start in one place "
    "and end at their hits. The first method of Sect. 4.1.2 repeatedly builds trees over optimal "
    "subtrees of up to 8 boxes. It never makes the tree worse for evenly spread boxes, but can for "
    "boxes on several scales: each build is greedy, and ignores how many boxes are in a subtree ({sets} "
    "sets of each kind). The second method, that of the table, optimises in place, so that the sum "
    "cannot grow."
)


def thesis_table_4_2(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Build and optimise trees of all meshes, and send rays through them."""
    side = SIDE_4_2[quality]
    measured: dict[str, dict[str, Any]] = {}
    for done, name in enumerate(meshes.MESHES, start=1):
        measured[name] = _of_mesh(meshes.made(name, SIZE[quality]), side)
        progress(done / (len(meshes.MESHES) + 1))
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
        "printed": {name: dict(zip(ROWS, of, strict=True)) for name, of in PRINTED_4_2.items()},
        "claims": claims,
        "note": NOTE_4_2.format(side=side, sets=SETS[quality]),
    }
    return _draw_4_2(measured), numbers


def _of_mesh(mesh: meshes.Mesh, side: int) -> dict[str, Any]:
    low, high = meshes.corners(mesh.triangles)
    tree, seconds = timed(lambda: trees.surface_area_tree(low, high))
    better, more = timed(lambda: trees.optimal_subtrees(tree))
    root = float(trees.surface_area(tree.low[-1], tree.high[-1]))
    area = [trees.summed_area(each) / root for each in (tree, better)]
    depth = [leaf_depths(each) for each in (tree, better)]
    values = (*area, 100 * (1 - area[1] / area[0]), depth[0][0], depth[1][0], depth[0][1], depth[1][1])
    found: dict[str, Any] = {"triangles": len(low)} | dict(zip(ROWS, values, strict=True))
    rays = Rays(*meshes.camera_rays(mesh, side))
    for kind in KINDS:
        distance = trees.triangle_distances(mesh.triangles, *rays)
        before, after = (trace(each, rays, distance) for each in (tree, better))
        means = float(before.visits.mean()), float(after.visits.mean())
        found[f"{kind} rays"] = {
            "nodes before": means[0],
            "nodes after": means[1],
            "reduction in percent": 100 * (1 - means[1] / means[0]),
        }
        rays = bounce(mesh.triangles, rays, before, 1)
    return found | {
        "processor seconds to build": seconds.processors,
        "processor seconds to optimise": more.processors,
    }


def _growth(key: int, count: int, scales: int) -> float:
    """Return by which part the first way of Sect. 4.1.2 makes the summed area of random boxes larger."""
    random = np.random.default_rng(key)
    low = np.concatenate([random.normal(size=(count, 3)) * 4.0**-k for k in range(scales)])
    high = low + 0.5 * random.uniform(size=low.shape) ** 8
    return _rebuild(low, high) / trees.summed_area(trees.surface_area_tree(low, high)) - 1


def _rebuild(low: NDArray, high: NDArray, most: int = 8) -> float:
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


def _draw_4_2(measured: dict[str, dict[str, Any]]) -> Figure:
    figure = new_figure(
        "Optimising subtrees in place never increases the summed area\n"
        "thesis, Table 4.2; before → after the optimisation\n"
        "* as printed; 9.80 % by the two areas beside it",
        4.9,
    )
    ours, theirs = figure.subplots(2, 1, height_ratios=[12.8, 6.8])
    changes = {"summed area": ROWS[:2], "largest depth": ROWS[3:5], "mean leaf depth": ROWS[5:]}
    rows = [["triangles", *(f"{of['triangles']:,}" for of in measured.values())]]
    for name, (before, after) in changes.items():
        rows.append([name, *(_change(of[before], of[after]) for of in measured.values())])
        if before == ROWS[0]:
            rows.append(["reduction", *(f"{of[ROWS[2]]:.2f} %" for of in measured.values())])
    for kind in KINDS:
        rays = [of[f"{kind} rays"] for of in measured.values()]
        rows.append([f"nodes, {kind} rays", *(_change(of["nodes before"], of["nodes after"]) for of in rays)])
        rows.append(["reduction", *(f"{of['reduction in percent']:.2f} %" for of in rays)])
    for name in ("build", "optimise"):
        times = [of[f"processor seconds to {name}"] for of in measured.values()]
        rows.append([f"CPU seconds to {name}", *(f"{time:.2f}" for time in times)])
    heads = ["", *(name.replace("rooms, ", "") for name in measured)]
    groups = [("our meshes (areas relative to the root)", 1, len(measured))]
    text_table(ours, heads, rows, groups, [1.5, *[1.2] * len(measured)])
    printed = {name: dict(zip(ROWS, of, strict=True)) for name, of in PRINTED_4_2.items()}
    rows = [["area before", *(_short(of[ROWS[0]]) for of in printed.values())]]
    rows.append(["area after", *(_short(of[ROWS[1]]) for of in printed.values())])
    wrong = next(iter(printed))
    rows.append(
        ["reduction", *(f"{of[ROWS[2]]:.2f} %{'*' * (name == wrong)}" for name, of in printed.items())]
    )
    for name, (before, after) in list(changes.items())[1:]:
        rows.append([name, *(_change(of[before], of[after]) for of in printed.values())])
    groups = [("meshes of the thesis", 1, len(printed))]
    text_table(theirs, ["", *printed], rows, groups, [1.5, *[1.0] * len(printed)])
    return figure


def _change(before: float, after: float) -> str:
    form = "{}" if isinstance(before, int) else "{:.2f}"
    return f"{form.format(before)} → {form.format(after)}"


def _short(value: float) -> str:
    return f"{value:,.0f}" if value < 1e7 else f"{value / 1e6:.1f}e6"


SIDE_4_3 = {"draft": 24, "paper": 96}
RUNS = 4
LEVELS = {"10 levels": 10, "all levels": None}
MOST = 60
"""Runs until nothing changes, of a small set."""
SMALL, SMALL_SETS = 500, {"draft": 2, "paper": 16}
SLIGHTLY = 1.05
TURNS = {"draft": 4, "paper": 16}
"""Of rendering with each tree, to compare times."""

PRINTED_4_3 = {
    "summed area": (1.36267e13, 1.27797e13, 1.25772e13, 1.25063e13, 1.24589e13),
    "reduction in percent": (6.22, 1.58, 0.56, 0.38),
    "mean leaf depth": (27.57, 33.29, 33.05, 33.03, 33.12),
}

NOTE_4_3 = (
    "Areas relative to the root; each reduction is relative to the area before the run, as printed. '10 "
    "levels': only below nodes of the ten levels next to the root, at most 1023 subtrees of up to 8 "
    "leaves. Nodes by {side} x {side} primary rays, and processor seconds of these in NumPy, in {turns} "
    "turns. The thesis's mesh has some millions of triangles, ours {fewest} to {most}. 'until nothing "
    "changes': runs over all levels of trees over {small} random boxes, {sets} sets. At the end the "
    "subtree opened below each node is optimal, as the thesis conjectures; other subtrees with as many "
    "leaves need not be."
)


def thesis_table_4_3(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Optimise trees of all meshes four times, in both ways."""
    side = SIDE_4_3[quality]
    measured: dict[str, dict[str, Any]] = {}
    seconds: dict[str, dict[str, list[float]]] = {}
    sizes: list[int] = []
    for done, name in enumerate(meshes.MESHES, start=1):
        mesh = meshes.made(name, SIZE[quality])
        tree = trees.surface_area_tree(*meshes.corners(mesh.triangles))
        sizes.append(len(mesh.triangles))
        rays = Rays(*meshes.camera_rays(mesh, side))
        distance = trees.triangle_distances(mesh.triangles, *rays)
        for way, levels in LEVELS.items():
            runs = [tree]
            busy = 0.0
            for _ in range(RUNS):
                better, taken = timed(partial(trees.optimal_subtrees, runs[-1], levels=levels))
                runs.append(better)
                busy += taken.processors
            if levels:
                calls = {f"run {k}": partial(_render, runs[k], rays, distance) for k in range(3)}
                seconds[name] = {
                    run: [each.processors for each in of[1:]]
                    for run, of in in_turns(calls, TURNS[quality]).items()
                }
            root = float(trees.surface_area(tree.low[-1], tree.high[-1]))
            area = np.array([trees.summed_area(each) for each in runs]) / root
            measured[f"{name}, {way}"] = {
                "triangles": sizes[-1],
                "processor seconds of all runs": busy,
                "summed area": area.tolist(),
                "reduction in percent": (100 * (1 - area[1:] / area[:-1])).tolist(),
                "mean leaf depth": [leaf_depths(each)[1] for each in runs],
                "nodes a primary ray visits": [
                    float(trace(each, rays, distance).visits.mean()) for each in runs
                ],
            }
        progress(done / len(meshes.MESHES))
    gains = []
    for key in range(SMALL_SETS[quality]):
        low = np.random.default_rng(key).uniform(size=(SMALL, 3))
        gains.append(_until_nothing_changes(trees.surface_area_tree(low, low + 0.1)))
    first = {name: of["reduction in percent"][0] for name, of in measured.items()}
    part = {name: first[f"{name}, 10 levels"] / first[f"{name}, all levels"] for name in meshes.MESHES}
    claims = {
        "the reduction of the area is not as large on further runs": {
            name: max(of["reduction in percent"][1:]) < of["reduction in percent"][0]
            for name, of in measured.items()
        },
        "runs end where nothing changes": all(len(of) < MOST for of in gains),
        "ten levels reduce the area by less than the whole tree": {name: p < 1 for name, p in part.items()},
        "but considerably: by more than half as much": {name: p > 0.5 for name, p in part.items()},
        "after a first run of ten levels rendering takes very slightly longer": {
            name: judged.all_of(
                judged.smaller(of["run 0"], of["run 1"]), judged.smaller(of["run 1"], of["run 0"], SLIGHTLY)
            )
            for name, of in seconds.items()
        },
        "after another one less time than before": {
            name: judged.smaller(of["run 2"], of["run 0"]) for name, of in seconds.items()
        },
    }
    numbers = {
        "measured": {
            "meshes": measured,
            "reduction of the first run, ten levels / all": part,
            "time to render after a first and a second run / before": {
                name: {run: judged.ratio(of[run], of["run 0"]) for run in ("run 1", "run 2")}
                for name, of in seconds.items()
            },
            "runs until nothing changes, by set": list(map(len, gains)),
        },
        "printed": {name: list(of) for name, of in PRINTED_4_3.items()},
        "claims": claims,
        "note": NOTE_4_3.format(
            side=side,
            turns=TURNS[quality],
            small=SMALL,
            sets=len(gains),
            fewest=min(sizes),
            most=max(sizes),
        ),
    }
    return _draw_4_3(measured), numbers


def _render(tree: trees.Tree, rays: Rays, distance: Callable[..., NDArray], _: int) -> meshes.Found:
    return trace(tree, rays, distance)


def _until_nothing_changes(tree: trees.Tree) -> list[float]:
    """Return the reductions in percent of runs, the last one 0 if that many are enough."""
    gains: list[float] = []
    while len(gains) < MOST and (not gains or gains[-1] > 0):
        better = trees.optimal_subtrees(tree)
        gains.append(100 * (1 - trees.summed_area(better) / trees.summed_area(tree)))
        tree = better
    return gains


def _draw_4_3(measured: dict[str, dict[str, Any]]) -> Figure:
    figure = new_figure(
        "Further runs of the optimisation gain less than the first one\nthesis, Table 4.3; our meshes", 2.9
    )
    reduced = PRINTED_4_3["reduction in percent"]
    depth = PRINTED_4_3["mean leaf depth"]
    rows = [["thesis: power plant, 10", *_two(reduced), _change(depth[0], depth[-1]), "–", "–", "–"]]
    for name, of in measured.items():
        depth, nodes = of["mean leaf depth"], of["nodes a primary ray visits"]
        changes = [*_two(of["reduction in percent"]), _change(depth[0], depth[-1]), *_two(nodes[:3])]
        rows.append([name.removesuffix(" levels"), *changes])
    runs = [f"run {k}" for k in range(1, RUNS + 1)]
    heads = ["mesh, levels", *runs, f"{RUNS} runs", "before", "run 1", "run 2"]
    groups = [
        ("reduction of the summed area, %", 1, 4),
        ("mean leaf depth", 5, 5),
        ("nodes of a primary ray", 6, 8),
    ]
    text_table(figure.subplots(), heads, rows, groups, [2.4, *[0.85] * 4, 1.7, *[1.0] * 3])
    return figure


def _two(values: Sequence[float]) -> list[str]:
    return [f"{value:.2f}" for value in values]

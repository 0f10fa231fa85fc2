"""Thesis Sect. 3.1.6: many lamps and a shutter, by cuts through clusters of gather and light points."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.trees import hilbert_tree
from figures._errors import rms, slope
from figures._rc import BLACK, BLUE, GREY, VERMILLION
from figures.plot import Style
from figures.shared import judged
from figures.shared.sheets.image_sheets import Panel, axes_below, image_grid
from figures.shared.sheets.panels import curve, name_axes
from figures.thesis.chapter_3.cuts import Cut, Gathers, Lights, find_cut, gather_tree, light_tree
from qmcjax import tracing
from qmcjax.tracing import motion


class Size(NamedTuple):
    """How much is measured."""

    side: int
    """Pixels a side, for errors over keys."""
    shown: int
    """Pixels a side of the images."""
    tolerances: tuple[float, ...]
    counts: tuple[int, ...]
    """Of lamps."""
    keys: int


SIZES = {
    "draft": Size(4, 48, (0.08, 0.02), (250, 1000), 4),
    "paper": Size(8, 64, (0.16, 0.08, 0.04, 0.02, 0.01), (125, 250, 500, 1000, 2000, 4000), 16),
}
INSTANTS, LAMPS = 16, 1000
SHOWN = 16
"""The key of the images."""
WEBER = 0.02
"""The tolerance of the images: clusters below 2 % of a pixel are not refined."""

BATCH, SIGHTS = 256_000, 2**16
"""Shadow rays traced at once, and rays of the camera: fewer are repeated, for one program."""

CUTS, RANDOM = "error of cuts", "error of random pairs"

BELOW = 640
"""Pixels of the curves below the images."""


NOTE = (
    f"The scene is ours: {LAMPS} lamps of random strength, each second one moving, above a floor with two "
    f"still boxes and one that slides. Each pixel has {INSTANTS} gather points, one per instant; a moving "
    "lamp has one light point per instant. The tree of light points follows a Hilbert curve, that "
    "of gather points is binary, sorted by surface and time. The bound of a cluster is its strength times "
    "the largest cosine over squared distance of its boxes, as if nothing blocked the light. We refine all "
    "clusters at once whose bound is above the tolerance times the present value of the pixel. Random "
    "pairs: instants uniform, lamps by strength, as many as the cut evaluates in the same pixel. Errors and "
    "bounds are relative to the RMS of the image of all pairs; {side} x {side} pixels and {keys} keys."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw images from all, clustered and random pairs, and errors and numbers of pairs over keys."""
    size = SIZES[quality]
    world = make_world()
    cases: dict[float, list[dict[str, float]]] = {tolerance: [] for tolerance in size.tolerances}
    pairs: dict[int, list[float]] = {count: [] for count in size.counts}
    for key in range(size.keys):
        scene = make_scene(world, size.side, LAMPS, key)
        for tolerance, found in cases.items():
            found.append(_compare(scene, tolerance, key))
        for count, costs in pairs.items():
            other = scene if count == LAMPS else make_scene(world, size.side, count, key)
            costs.append(cut(other, WEBER, key).cost.mean())
        progress(0.9 * (key + 1) / size.keys)
    by_tolerance = {
        f"{tolerance:g}": {name: np.array([one[name] for one in found]) for name in found[0]}
        for tolerance, found in cases.items()
    }
    exponents = [slope({n: costs[key] for n, costs in pairs.items()}) for key in range(size.keys)]
    measured = {
        "all pairs": INSTANTS * LAMPS,
        "by tolerance": {
            tolerance: {name: judged.interval(values) for name, values in of.items()}
            for tolerance, of in by_tolerance.items()
        },
        "random over cut": {t: judged.ratio(of[RANDOM], of[CUTS]) for t, of in by_tolerance.items()},
        "largest error over bound": max(float(of["error / bound"].max()) for of in by_tolerance.values()),
        "pairs by number of lamps": {str(n): judged.interval(costs) for n, costs in pairs.items()},
        "exponent of the pairs": judged.interval(exponents),
    }
    finest = by_tolerance[f"{WEBER:g}"]
    claims = {
        "no error is above its bound, in all pixels": measured["largest error over bound"] <= 1,
        "a strongly sublinear cost: the exponent of pairs over lamps is below 1/2": judged.below(
            exponents, 0.5
        ),
        "representatives are distributed over all instants: more than 99 % of them in a pixel": judged.below(
            1 - finest["instants"], 0.01
        ),
        "less error than as many random pairs": {
            tolerance: judged.smaller(of[CUTS], of[RANDOM]) for tolerance, of in by_tolerance.items()
        },
    }
    scene = make_scene(world, size.shown, LAMPS, SHOWN)
    figure = _draw(scene, measured)
    progress(1.0)
    note = NOTE.format(side=size.side, keys=size.keys)
    return figure, {"measured": measured, "claims": claims, "note": note}


class Scene(NamedTuple):
    """Trees of the gather points of pixels and of light points, and what lamps transport."""

    gathers: Gathers
    lights: Lights
    strength: NDArray[np.float64]
    """(lamps,): their sum is 1."""
    table: NDArray[np.float64]
    """(pixels, instants, lamps): what gather points receive from lamps of strength 1."""


def make_world() -> tracing.World:
    """Return a floor with two still boxes, and one that slides in front."""
    slides = motion.affine(None, motion.linear_segments([0, 1], [[0, 0, 0], [0.8, 0, 0]]))
    return tracing.world(
        [
            tracing.plane([0, 0, 0], [0, 1, 0]),
            tracing.box([[-0.7, 0, 0.3], [0.3, 0, 0.1]], [[-0.3, 0.8, 0.7], [0.8, 0.3, 0.6]]),
            tracing.box([-0.15, 0, -0.7], [0.15, 0.3, -0.4], motion=slides),
        ]
    )


def make_scene(world: tracing.World, side: int, count: int, key: int) -> Scene:
    """Return random gather points of side x side pixels, and random lamps of which each second one moves."""
    random = np.random.default_rng(key)
    times = (np.arange(INSTANTS) + 0.5) / INSTANTS
    y, x = np.mgrid[:side, :side].reshape(2, -1, 1) + random.random((2, side * side, INSTANTS))
    camera = tracing.camera([0, 2.0, -2.2], [0, 0.1, 0], fov=42)
    across, down, when = (
        jnp.asarray(np.resize(np.broadcast_to(a, x.shape), max(x.size, SIGHTS)), jnp.float32)
        for a in (x / side, y / side, times)
    )
    sight = camera.rays(across, down, when, ())
    origin, direction = (jnp.stack(vector, axis=-1) for vector in (sight.origin, sight.direction))
    hit = tracing.nearest_hit(world, origin, direction, when)
    place, normal, surface = (np.asarray(part)[: x.size] for part in (hit.point, hit.normal, hit.shape))
    place, normal = (part.astype(np.float64).reshape(-1, INSTANTS, 3) for part in (place, normal))
    lamps = (random.random((count, 1, 3)) - [0.5, 0, 0.5]) * [3, 0.4, 3] + [0, 0.9, 0]
    moves = 0.4 * (random.random((count, 1, 3)) - 0.5) * (np.arange(count) % 2)[:, None, None]
    lamps = lamps + moves * times[:, None]
    strength = random.exponential(size=count)
    strength /= strength.sum()
    gathers = gather_tree(place, normal, surface.reshape(-1, INSTANTS))
    table = transport(world, place, normal, lamps, times)
    return Scene(gathers, _light_tree(lamps, strength, random), strength, table)


def transport(
    world: tracing.World, place: NDArray, normal: NDArray, lamps: NDArray, times: NDArray
) -> NDArray[np.float64]:
    """Return what gather points receive from lamps of strength 1, (pixels, instants, lamps).

    It is the cosine over the squared distance, 0 if something blocks the light.
    """
    count, lamps = len(lamps), np.resize(lamps, (max(len(lamps), LAMPS), *lamps.shape[1:]))
    table = np.empty((*place.shape[:2], len(lamps)))
    step = max(1, BATCH // (INSTANTS * len(lamps)))
    for begin in range(0, len(place), step):
        origin, facing = (part[begin : begin + step, :, None] for part in (place, normal))
        way = lamps.swapaxes(0, 1) - origin
        start, ray, when = (a.astype(np.float32) for a in (origin, way, times[:, None]))
        blocked = tracing.any_hit(world, start, ray, when, np.float32(1))
        # As NumPy sums vectors, but in a third of the time.
        along, square = (sum(one[..., k] * way[..., k] for k in range(3)) for one in (facing, way))
        table[begin : begin + step] = np.where(blocked, 0, np.maximum(along, 0) / square**1.5)
    return table[..., :count]


def exact(scene: Scene) -> NDArray[np.float64]:
    """Return the values of pixels from all pairs."""
    return (scene.table @ scene.strength).mean(axis=1)


def _light_tree(lamps: NDArray, strength: NDArray, random: np.random.Generator) -> Lights:
    """Return the tree of light points: of all instants for lamps that move."""
    moving = np.ptp(lamps, axis=1).any(axis=1)
    still, moves = np.flatnonzero(~moving), np.flatnonzero(moving)
    number = np.concatenate([still, np.repeat(moves, INSTANTS)])
    place = np.concatenate([lamps[still, 0], lamps[moves].reshape(-1, 3)])
    exists = np.concatenate([np.ones((len(still), INSTANTS)), np.tile(np.eye(INSTANTS), (len(moves), 1))])
    return light_tree(hilbert_tree(place, place), exists * strength[number, None], number, random)


def cut(scene: Scene, tolerance: float, key: int) -> Cut:
    """Cut the pairs of all pixels."""
    return find_cut(scene.table, scene.gathers, scene.lights, tolerance, np.random.default_rng([key, 1]))


def draw_pairs(scene: Scene, cost: NDArray, key: int) -> NDArray[np.float64]:
    """Estimate pixels from numbers of random pairs, lamps by strength."""
    random = np.random.default_rng([key, 2])
    pixel = np.repeat(np.arange(len(cost)), cost)
    instant = random.integers(INSTANTS, size=len(pixel))
    lamp = np.searchsorted(np.cumsum(scene.strength), random.random(len(pixel)) * (1 - 1e-9))
    return np.bincount(pixel, scene.table[pixel, instant, lamp], len(cost)) / cost


def _compare(scene: Scene, tolerance: float, key: int) -> dict[str, float]:
    """Return costs and relative errors, and how many instants the pairs of a pixel have."""
    found, reference = cut(scene, tolerance, key), exact(scene)
    error, mean = found.value - reference, rms(reference)
    used = np.zeros((len(reference), INSTANTS))
    used[found.pairs.pixel, found.pairs.instant] = 1
    return {
        "pairs": found.cost.mean(),
        CUTS: rms(error) / mean,
        RANDOM: rms(draw_pairs(scene, found.cost, key) - reference) / mean,
        "bound": rms(found.bound) / mean,
        "error / bound": np.max(abs(error) / found.bound),
        "instants": used.mean(),
    }


def _draw(scene: Scene, measured: Mapping[str, Any]) -> Figure:
    found, reference = cut(scene, WEBER, SHOWN), exact(scene)
    mean = found.cost.mean()
    images = {
        f"all {measured['all pairs']:,} pairs": reference,
        f"cuts, {mean:,.0f} pairs": found.value,
        f"{mean:,.0f} random pairs": draw_pairs(scene, found.cost, SHOWN),
    }
    top, side = 1.2 * np.quantile(reference, 0.99), round(len(reference) ** 0.5)
    panels = [
        Panel(f"{name} per pixel", np.clip(image / top, 0, 1).reshape(side, side), transfer="srgb")
        for name, image in images.items()
    ]
    title = (
        "Lightcuts evaluate less than 2 % of all pairs, with no error above its bound\n"
        f"thesis, Sect. 3.1.6; {LAMPS:,} lamps, half of them moving, and {INSTANTS} instants of the shutter"
    )
    figure = image_grid(title, panels, 3, BELOW)
    left, right = axes_below(figure, BELOW, 2)
    cases = measured["by tolerance"].values()
    for label, name, color in (
        ("bound", "bound", GREY),
        ("random", RANDOM, VERMILLION),
        ("cuts", CUTS, BLUE),
    ):
        errors = {case["pairs"]["mean"]: case[name]["mean"] for case in cases}
        curve(left, errors, Style(color, "o"), label=label)
    ticks = [round(case["pairs"]["mean"]) for case in cases]
    name_axes(left, "evaluated pairs per pixel", "relative RMS error", log="xy", ticks=ticks)
    left.legend(loc="upper center", ncols=3, frameon=False)
    left.set_ylim(top=30)
    costs = {int(n): of["mean"] for n, of in measured["pairs by number of lamps"].items()}
    curve(right, {n: n * INSTANTS for n in costs}, Style(BLACK, "s"), label="all")
    curve(right, costs, Style(BLUE, "o"), label="cuts")
    name_axes(right, "lamps", "pairs per pixel", log="xy", ticks=list(costs), legend="upper left")
    return figure

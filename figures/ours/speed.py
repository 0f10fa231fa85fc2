"""How fast points, rays, paths and measures are, beside the programs that a user would take instead."""

from collections.abc import Callable, Mapping
from functools import partial
from itertools import islice
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]
from scipy.stats import qmc

import analysis
import qmcjax as qj
from figures.making import this_machine
from figures.shared.costs import in_turns, median, timed
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.sheets.panels import new_figure
from figures.shared.timing import point_rates, ray_rates
from qmcjax import scenes, sequences, tracing
from qmcjax.choosing import CANDIDATES

CALLS = {"draft": 1, "paper": 7}
BUDGET = 6.0
"""Seconds after which no further calls are made."""

NOTE_ON_MEASURES = (
    "Measures: medians of calls after the first, alternating programs, same points, float64. cKDTree is "
    "built with boxsize=1 and called with two workers; scipy's L2 star discrepancy is the value alone, "
    "ours includes the gradient."
)


Points = NDArray[np.float64]
Call = Callable[[Any], Any]


class Peer(NamedTuple):
    """A measure, what a user would take instead, and numbers of points by quality."""

    measure: Call
    peer: Call
    name: str
    dims: int
    draft: int
    paper: int


def _of(make: Callable[[int], sequences.Sequence]) -> Callable[[int, int, int], Points]:
    return lambda n, dims, block: np.asarray(make(dims).points(n, block * n, dtype=jnp.float64))


def _clustered(n: int, dims: int, key: int) -> Points:
    rng = np.random.default_rng(key)
    return (rng.random((16, dims))[rng.integers(0, 16, n)] + 0.02 * rng.normal(size=(n, dims))) % 1


FAMILIES: dict[str, Callable[[int, int, int], Points]] = {
    "Sobol'": _of(sequences.sobol),
    "random": lambda n, dims, key: np.random.default_rng(key).random((n, dims)),
    "lattice": _of(sequences.lattice),
    "clustered": _clustered,
}


def _nearest_by_tree(points: Points) -> float:
    distances, _ = cKDTree(points, boxsize=1.0).query(points, k=2, workers=2)
    return float(np.asarray(distances)[:, 1].min())


PEERS = {
    f"min distance, {dims}-D": Peer(analysis.min_distance, _nearest_by_tree, "cKDTree", dims, 2**14, 2**20)
    for dims in (2, 3)
} | {
    "L2 star and gradient, 2-D": Peer(
        jax.value_and_grad(analysis.l2_star_discrepancy),
        lambda points: qmc.discrepancy(points, method="L2-star"),
        "scipy",
        2,
        2**9,
        2**14,
    ),
}


def measure_rates(quality: str) -> dict[str, dict[str, float]]:
    """Return points per second by measure and points, ours and the peer's."""
    rates: dict[str, dict[str, float]] = {}
    with jax.enable_x64(True):
        for name, case in PEERS.items():
            n = getattr(case, quality)
            calls: dict[str, Callable[[Any], Any]] = {"qmcjax": case.measure, case.name: case.peer}
            for family, draw in FAMILIES.items():
                taken = in_turns(calls, CALLS[quality], BUDGET, partial(draw, n, case.dims))
                rates[f"{name}, {n} points, {family}"] = {who: n / median(of) for who, of in taken.items()}
    return rates


SIZES = {"draft": (16, 1, 1, 1), "paper": (128, 16, 9, 2)}
"""Side of the image, samples per pixel, turns, scenes."""

BOUNCES = 6
"""Paths have up to 8 edges."""

POINTS = {"qmcjax, Sobol'": CANDIDATES["(0,2), Owen"].make, "qmcjax, random": CANDIDATES["random"].make}


NOTE_ON_PATHS = (
    "Paths: images of {side} x {side} pixels, {spp} samples per pixel, {bounces} bounces, light sampled "
    "at each surface. Medians of alternating runs, ours without compiling, Mitsuba's (scalar_rgb, all "
    "threads) without loading. Its points are independent, as ours in one case; in the other, Sobol' "
    "points are scrambled per pixel."
)


def path_rates(quality: str) -> tuple[dict[str, Any], str]:
    """Let both programs render in turns, and return what each scene took, and how it was measured."""
    side, spp, turns, count = SIZES[quality]
    found = {name: _paths(scene, side, spp, turns) for name, scene in islice(cases().items(), count)}
    missing = "" if mitsuba_scenes.installed() else " Mitsuba is not installed: pip install mitsuba."
    return found, NOTE_ON_PATHS.format(side=side, spp=spp, bounces=BOUNCES) + missing


def cases() -> dict[str, tracing.PathTracing]:
    """Return scenes of diffuse surfaces of one colour each."""
    box = scenes.cornell_box(0.0, ball=False, mirror=False, blocks=True, light=0.5, bounces=BOUNCES)
    interior = mitsuba_scenes.plain(scenes.interior(BOUNCES).estimator)
    return {"Cornell box": box.estimator, "interior": interior}


def _paths(scene: tracing.PathTracing, side: int, spp: int, turns: int) -> dict[str, Any]:
    seconds: dict[str, list[float]] = {}
    means: dict[str, list[float]] = {}
    for turn in range(turns + 1):
        for name, points in POINTS.items():
            sampler = points(len(scene.needs), side, side, spp, turn)
            image, took = timed(qj.render, scene, sampler, side, side, spp)
            seconds.setdefault(name, []).append(took.clock)
            means.setdefault(name, []).append(float(np.mean(image)))
        if turn and mitsuba_scenes.installed():
            # The first of two wakes its threads.
            images, both = mitsuba_scenes.render_image(scene, side, side, spp, [2 * turn, 2 * turn + 1])
            seconds.setdefault("Mitsuba", [np.nan]).append(both[1])
            means.setdefault("Mitsuba", [np.nan]).append(float(images.mean()))
    return {
        "primitives": scene.world.count,
        "paths per second": {
            name: side * side * spp / float(np.median(of[1:])) for name, of in seconds.items()
        },
        "seconds of the first image": {name: seconds[name][0] for name in POINTS},
        "mean of the images": {name: float(np.mean(of[1:])) for name, of in means.items()},
    }


ALIKE = 1.25
"""Ratio of rates that are about the same."""

Ratios = dict[str, float]
"""Rates of ours over another program's, by case."""

NOTE = (
    "All are medians of calls after the first. Points: scipy and torch draw block after block, QMCPy "
    "its first points each time. Peers compute float64. Their scrambling is linear, except QMCPy's "
    "nested uniform one, compared with our exact Owen scrambling. {rays} {paths} {measures} Peers not "
    "installed are omitted (pip install -e '.[bench]' brings QMCPy and torch)."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure one kind after the other, points in a separate process, and draw ratios."""
    points = this_machine.measure_apart(point_rates, quality)
    progress(0.3)
    rays, about_rays = ray_rates.measure(quality)
    progress(0.6)
    paths, about_paths = path_rates(quality)
    progress(0.8)
    measures = measure_rates(quality)
    of_points = {
        case["case"]: {name: rate / max(case["peers"].values()) for name, rate in case["ours"].items()}
        for case in points["cases"]
        if case["peers"]
    }
    of_rays = {
        name: ways["compiled"]["per processor second"] / ways["Embree"]["per processor second"]
        for name, ways in rays.items()
        if {"compiled", "Embree"} <= ways.keys()
    }
    compared: dict[str, Ratios] = {
        "points: scipy, QMCPy or torch": {_short(case): of["float32"] for case, of in of_points.items()},
        "rays: Embree, one thread each": of_rays,
        "paths: Mitsuba": {
            f"{name}, {way.removeprefix('qmcjax, ')}": rate / of["paths per second"]["Mitsuba"]
            for name, of in paths.items()
            for way, rate in of["paths per second"].items()
            if way in POINTS and "Mitsuba" in of["paths per second"]
        },
        "measures: cKDTree, scipy": {
            case.removesuffix(", Sobol'"): of["qmcjax"] / rate
            for case, of in measures.items()
            for peer, rate in of.items()
            if case.endswith(", Sobol'") and peer != "qmcjax"
        },
    }

    def rate(title: str) -> float:
        return next(of["ours"]["float32"] for of in points["cases"] if of["case"].startswith(title))

    pairs = (("Faure", "Sobol'"), ("permutation net", "rank-1 lattice"))
    between = {f"{one} / {other}": rate(one) / rate(other) for one, other in pairs}
    faure, nets = between.values()
    return _draw({kind: of for kind, of in compared.items() if of}), {
        "measured": {
            "points": points,
            "points, ours / fastest peer": of_points,
            "rates over those of others": between,
            "rays": rays,
            "rays, compiled / Embree per processor second": of_rays,
            "paths": paths,
            "measures": measures,
        },
        "claims": {
            "bases above 2 are slower: Faure's sequence makes fewer coordinates per second than Sobol's": (
                faure < 1
            ),
            "permutation nets are as fast as rank-1 lattices, within 25 %": 1 / ALIKE < nets < ALIKE,
        },
        "note": NOTE.format(rays=about_rays, paths=about_paths, measures=NOTE_ON_MEASURES),
    }


def _draw(compared: Mapping[str, Ratios]) -> Figure:
    """Draw a bar for each case: how many times as fast as the fastest other program ours is."""
    ratios = [ratio for of in compared.values() for ratio in of.values()]
    faster = sum(ratio > 1 for ratio in ratios)
    figure = new_figure(
        f"Faster than other programs in {faster} of {len(ratios)} cases, by up to {max(ratios):.0f} times",
        0.175 * (len(ratios) + 2 * len(compared)) + 0.9,
    )
    axes = figure.subplots()
    row, names, heads = 0, {}, set()
    for k, (kind, of) in enumerate(compared.items()):
        names[row] = f"{kind[0].upper()}{kind[1:]}"
        heads.add(row)
        for name, ratio in sorted(of.items(), key=lambda item: -item[1]):
            row += 1
            axes.barh(row, ratio - 1, left=1, color=f"C{k}")
            look: dict[str, Any] = {"textcoords": "offset points", "va": "center"}
            axes.annotate(f"{ratio:.2g}", (max(ratio, 1), row), (3, 0), **look)
            names[row] = name
        row += 2
    axes.set_yticks(list(names), list(names.values()))
    for place, label in zip(names, axes.get_yticklabels(), strict=True):
        label.set_fontweight("bold" if place in heads else "normal")
    axes.axvline(1, color="black", lw=0.8)
    axes.set(xscale="log", ylim=(row - 1.2, -0.8), xlim=(min(0.5, 0.9 * min(ratios)), 1.6 * max(ratios)))
    axes.set(xlabel="our rate / theirs", ylabel="case")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(axis="x", alpha=0.3)
    axes.tick_params(axis="y", length=0)
    return figure


def _short(case: str) -> str:
    """Return a case with its number of points as a power of 2."""
    size = next((word for word in case.split() if word.isdigit() and int(word) > 32), "")
    short = case.replace(size, f"2^{int(size).bit_length() - 1}") if size else case
    return short.replace(", Owen (peers: linear) scrambled", ", Owen (linear) scrambled")

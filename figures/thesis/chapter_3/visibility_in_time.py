"""Thesis Sect. 3.2: variance at equal time, visibility in time computed against sampled."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures.making.schema import Claims
from figures.plot import Style
from figures.shared.costs import timed
from figures.shared.sheets.panels import curve, name_axes, new_figure
from qmcjax import scenes, tracing
from qmcjax.core.pytrees import jit


class Size(NamedTuple):
    """How much is measured."""

    side: int
    turns: int
    box: tuple[int, ...]
    """Times of shading in the Cornell box."""
    counts: tuple[int, ...]
    """Numbers of triangles."""


SIZES = {
    "draft": Size(32, 2, (), (8,)),
    "paper": Size(96, 24, (1, 4, 16), (2, 8, 32, 128)),
}
TIMES = 32
BOX, ALL = "Cornell box, by times of shading", "moving triangles, by their number"
RATIO = "variance of sampled over analytic visibility"

ASKED = 4.0

NOTE = (
    "One random sample in each of {side} x {side} pixels, {turns} alternating runs of both methods: "
    "variances within pixels, and median times per image without compilation. Variance at equal time is "
    "variance times time, as for independent samples; stratified times would favour sampling. The "
    "blurred part: pixels whose central ray sees more than one primitive at {times} times; times are "
    "those of the whole image. Sampling is cheap here: one instruction tests a primitive against many "
    "rays, while a tile of rays takes all steps that any of its rays needs for its intervals. In the "
    "Cornell box highlights and shadows move, so more shading times pay off."
)


class Case(NamedTuple):
    """A scene in two ways: what variances and times are."""

    variances: tuple[NDArray[np.float64], NDArray[np.float64]]
    """Of sampled and of exact visibility, in each pixel."""
    seconds: tuple[float, float]
    first: tuple[float, float]
    """With compiling."""
    seen: NDArray[np.int64]
    """How many primitives rays through the middles of pixels see."""

    def numbers(self) -> dict[str, Any]:
        """Return ratios of sampled over exact, and the times."""
        blurred = self.seen > 1
        cost = self.seconds[1] / self.seconds[0]
        found = {}
        for name, part in (("blurred part", blurred), ("whole image", np.ones_like(blurred))):
            ratio = float(self.variances[0][part].mean() / self.variances[1][part].mean())
            found[name] = {"at equal samples": ratio, "at equal time": ratio / cost}
        pixels = blurred.size
        return {
            RATIO: found,
            "blurred pixels": float(blurred.mean()),
            "primitives that a ray sees there, mean": float(self.seen[blurred].mean()),
            "time of analytic over sampled": cost,
            "microseconds a sample": [1e6 * s / pixels for s in self.seconds],
            "seconds of the first image": list(self.first),
        }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure both scenes, and triangles over their number."""
    size = SIZES[quality]
    todo = len(size.box) + len(size.counts)
    box: dict[int, Case] = {}
    for samples in size.box:
        scene = scenes.cornell_box(visibility="analytic").estimator
        box[samples] = _measure(replace(scene, samples=samples), size)
        progress(len(box) / todo)
    triangles: dict[int, Case] = {}
    for count in size.counts:
        scene = scenes.moving_triangles(count, visibility="analytic").estimator
        triangles[count] = _measure(scene, size)
        progress((len(box) + len(triangles)) / todo)
    measured: dict[str, Any] = {
        BOX: {str(k): case.numbers() for k, case in box.items()},
        ALL: {str(k): case.numbers() for k, case in triangles.items()},
    }
    gains = {
        name: {k: one[RATIO]["blurred part"]["at equal time"] for k, one in of.items()}
        for name, of in measured.items()
    }
    best = {name: max(of.values()) for name, of in gains.items() if of}
    figure = _draw(measured)
    measured["best at equal time, blurred part"] = best
    loses = [k for k, gain in gains[ALL].items() if gain < 1]
    measured["numbers of triangles at which sampled visibility wins"] = loses
    return figure, {
        "measured": measured,
        "claims": _claims(measured),
        "note": NOTE.format(side=size.side, turns=size.turns, times=TIMES),
    }


def _claims(measured: Mapping[str, Any]) -> Claims:
    best = measured["best at equal time, blurred part"]
    return {
        "variance at equal time is at least 4 times smaller in the blurred part": {
            name.split(",")[0]: gain >= ASKED for name, gain in best.items()
        },
        "the reduction of variance is larger than the cost: over the whole image, at equal time": {
            f"{name.split(',')[0]}, {k}": one[RATIO]["whole image"]["at equal time"] > 1
            for name in (BOX, ALL)
            for k, one in measured[name].items()
        },
        "it reduces variance while making ray intersections more expensive": all(
            one[RATIO]["whole image"]["at equal samples"] > 1 < one["time of analytic over sampled"]
            for name in (BOX, ALL)
            for one in measured[name].values()
        ),
    }


@jit()
def _image(scene: Any, point: jax.Array) -> jax.Array:
    return scene(point)


def _points(side: int, dims: int, key: int) -> jax.Array:
    """Return a random point in each pixel."""
    rng = np.random.default_rng(key)
    y, x = np.mgrid[:side, :side]
    inside = rng.random((side, side, dims))
    inside[..., :2] = (inside[..., :2] + np.stack([x, y], axis=-1)) / side
    return jnp.asarray(inside, jnp.float32)


def _measure(scene: tracing.AnalyticVisibility, size: Size) -> Case:
    """Render both ways by turns."""
    both = scene.estimator, scene
    sums = np.zeros((2, 2, size.side, size.side, 3))
    seconds: list[list[float]] = [[], []]
    for turn in range(size.turns + 1):
        for way, one in enumerate(both):
            points = jax.block_until_ready(_points(size.side, len(one.needs), turn))
            values, taken = timed(_image, one, points)
            seconds[way].append(taken.clock)
            sums[way] += np.stack([np.asarray(values, np.float64) ** power for power in (1, 2)])
    turns = size.turns + 1
    variances = (sums[:, 1] - sums[:, 0] ** 2 / turns) / (turns - 1)
    return Case(
        (variances[0].mean(axis=-1), variances[1].mean(axis=-1)),
        (float(np.median(seconds[0][1:])), float(np.median(seconds[1][1:]))),
        (seconds[0][0], seconds[1][0]),
        _first_hits(scene.estimator, size.side),
    )


def _first_hits(scene: tracing.Estimator, side: int) -> NDArray[np.int64]:
    """Return how many primitives rays through the middles of pixels find at many times."""
    y, x = (jnp.asarray((np.mgrid[:side, :side] + 0.5) / side, jnp.float32)).reshape(2, -1)
    found = [_numbers(scene, x, y, jnp.full_like(x, t)) for t in (np.arange(TIMES) + 0.5) / TIMES]
    ordered = np.sort(np.stack(found), axis=0)
    return (1 + np.sum(ordered[1:] != ordered[:-1], axis=0)).reshape(side, side)


@jit()
def _numbers(scene: tracing.Estimator, x: jax.Array, y: jax.Array, at: jax.Array) -> jax.Array:
    sight = scene.camera.rays(x, y, at, ())
    origin, direction = (jnp.stack(vector, axis=-1) for vector in (sight.origin, sight.direction))
    return tracing.nearest_hit(scene.world, origin, direction, at).shape


def _draw(measured: Mapping[str, Any]) -> Figure:
    figure = new_figure(
        "At equal time, analytic visibility in time gains in three of seven settings\nthesis, Sect. 3.2",
        3.5,
    )
    shown = {name: measured[name] for name in (ALL, BOX) if measured[name]}
    axes = figure.subplots(1, len(shown) + 1)
    for panel, (name, cases) in zip(axes, shown.items(), strict=False):
        for part, key, look in (
            ("blurred part", "at equal samples", Style("C1", "s", "--")),
            ("blurred part", "at equal time", Style("C0", "o")),
            ("whole image", "at equal time", Style("C0", "^", ":")),
        ):
            gain = {k: case[RATIO][part][key] for k, case in cases.items()}
            curve(panel, gain, look, lw=1.5, label=f"{key}, {part}")
        panel.axhline(1, color="k", lw=0.8)
        panel.annotate("below: sampled wins", (0.97, 0.03), xycoords="axes fraction", ha="right")
        panel.axhline(ASKED, color="0.4", lw=0.8, ls=":", label=f"{ASKED:g} times")
        scene, _, what = name.partition(", by ")
        ticks = [int(k) for k in cases]
        x, y = what.replace("their number", "triangles"), "variance, sampled / analytic"
        name_axes(panel, x, y, scene, log="xy", ticks=ticks, few_decades=True)
        panel.set_ylim(0.1, None)
    cases = measured[ALL]
    for k, (name, color) in enumerate((("sampled", "C2"), ("analytic", "C3"))):
        times = {n: case["microseconds a sample"][k] for n, case in cases.items()}
        curve(axes[-1], times, Style(color, "o"), lw=1.5, label=f"time, {name}")
    x, y, ticks = "triangles", "microseconds per sample", [int(n) for n in cases]
    name_axes(axes[-1], x, y, "moving triangles", log="xy", ticks=ticks, few_decades=True)
    first, last = axes[0].get_legend_handles_labels(), axes[-1].get_legend_handles_labels()
    figure.legend(first[0] + last[0], first[1] + last[1], loc="outside lower center", ncols=3, frameon=False)
    return figure

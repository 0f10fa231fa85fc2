"""Z paper Table 1: run times of images by sampler and number of samples, and rates of generation alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import qmcjax as qj
from figures import plot
from figures.shared.costs import in_turns
from figures.shared.sheets.panels import new_figure, text_table
from figures.z.z_3 import SoftShadow
from qmcjax import orders, samplers, sequences
from qmcjax.core.pytrees import pytree

SIZE = {"draft": (120, 68), "paper": (1920, 1080)}
COUNTS = {"draft": (1, 4), "paper": (1, 4, 16, 64, 256)}
RATE_SPP = 16
CALLS = 3

ALIKE = 1.25
"""Ratio of times that are about the same."""

PRINTED_SPP = tuple(2**k for k in range(14))
PRINTED = {
    "(0,2)": (0.2, 0.5, 0.5, 0.8, 1.2, 2.0, 4.0, 7.5, 14.0, 28.0, 64.5, 107.5, 213.5, 427.5),
    "Sobol'": (0.2, 0.5, 0.8, 1.0, 1.8, 3.5, 6.5, 12.5, 25.5, 51.5, 105.5, 213.5, 418.5, 837.5),
    "ranked keys": (0.2, 0.5, 0.5, 0.8, 1.2, 2.0, 4.0, 8.0, 14.0, 27.5, 57.5, 113.5, 265.5, 422.5),
    "Z": (0.5, 0.5, 0.5, 0.8, 1.2, 2.0, 4.0, 7.5, 15.0, 28.5, 57.5, 113.5, 230.5, 461.5),
}
"""Seconds, by number of samples; those of ranked keys are of Heitz et al.'s own."""

RATIOS = (("Z", "(0,2)"), ("Z", "ranked keys"), ("Sobol'", "Z"))

NOTE = (
    "{width} x {height} pixels. The table: a soft shadow in four dimensions stands in for the paper's "
    "scene, so compare ratios, not seconds; shading costs little here, so sampler costs show more than "
    "in a path tracer. (0,2) is the Sobol' sequence xor-scrambled in each pixel, its four dimensions "
    "not padded. The dots: the mean of x y at {spp} samples per pixel, almost only generation. Medians "
    "of {calls} images after the first, each with a new key, samplers alternating. If all pixels share "
    "a sequence up to an xor, its points are computed once per image. Ranked keys, after Heitz et al., "
    "are ours; the paper's ratios are of theirs."
)


@pytree
@dataclass(frozen=True)
class Product:
    """The product of the coordinates on the screen."""

    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        """Return x y."""
        return point[..., 0] * point[..., 1]


def shadow_samplers(width: int, height: int, spp: int, key: int) -> dict[str, Any]:
    """Return the samplers of the table, in four dimensions."""
    return {
        "(0,2)": samplers.independent(sequences.sobol(4), key, "xor"),
        "Sobol'": samplers.full_screen(sequences.digital_shift(sequences.sobol(4), key), width, height),
        "ranked keys": samplers.ranked(4, key),
        "Z": samplers.z(width, height, spp, key, dims=4),
    }


def rate_samplers(width: int, height: int, spp: int, key: int) -> dict[str, Any]:
    """Return samplers of two dimensions along the orders."""
    sobol = sequences.sobol(2)
    owen = sequences.owen(sobol, key)
    return {
        "(0,2), xor per pixel": samplers.independent(sobol, key, "xor"),
        "(0,2), Owen per pixel": samplers.independent(sobol, key),
        "raster order": samplers.contiguous(orders.raster(width, height), sobol, spp),
        "Hilbert order": samplers.contiguous(orders.hilbert(width, height), sobol, spp),
        "Hilbert order, Owen": samplers.contiguous(orders.hilbert(width, height), owen, spp),
        "Z0": samplers.z(width, height, spp, None, "plain"),
        "Z, hash": samplers.z(width, height, spp, key),
        "Z, multiplicative": samplers.z(width, height, spp, key, "multiplicative"),
        "Z, tree": samplers.z(width, height, spp, key, "tree"),
        "Z, ART": samplers.z(width, height, spp, key, "art"),
        "global Sobol'": samplers.full_screen(sobol, width, height),
        "ranked keys": samplers.ranked(2, key),
    }


def seconds(
    scene: Any, make: Callable[..., dict[str, Any]], width: int, height: int, spp: int, calls: int
) -> dict[str, list[float]]:
    """Return the times of an image by sampler, but for the first; they take turns, so that noise hits all."""
    images = {
        name: lambda made, name=name: qj.render(scene, made[name], width, height, spp)
        for name in make(width, height, spp, 0)
    }
    taken = in_turns(images, calls, draw=lambda key: make(width, height, spp, key))
    return {name: [seconds.clock for seconds in each[1:]] for name, each in taken.items()}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Time images, and draw times over samples and rates of generation."""
    (width, height), counts = SIZE[quality], COUNTS[quality]
    calls = CALLS if quality == "paper" else 2
    shadow = SoftShadow(0.5, 0.2)
    images: dict[str, dict[str, float]] = {}
    spread: dict[str, dict[str, float]] = {}
    for done, spp in enumerate(counts, start=1):
        measured = seconds(shadow, shadow_samplers, width, height, spp, calls)
        for name, times in measured.items():
            images.setdefault(name, {})[str(spp)] = middle = float(np.median(times))
            spread.setdefault(name, {})[str(spp)] = (max(times) - min(times)) / middle
        progress(done / (len(counts) + 1))
    measured = seconds(Product(), rate_samplers, width, height, RATE_SPP, calls)
    rates = {
        name: width * height * RATE_SPP / float(np.median(times)) / 1e6 for name, times in measured.items()
    }
    ratios = {
        f"{one} / {other}": {s: images[one][s] / images[other][s] for s in images[one]}
        for one, other in RATIOS
    }
    kinds = rates["Z, hash"] / rates["Z, tree"]
    numbers = {
        "measured": {
            "seconds an image": images,
            "(slowest - fastest) / median": spread,
            "largest spread of times": max(value for of in spread.values() for value in of.values()),
            "ratios of times": ratios,
            "rate by hashing / by trees": kinds,
            "million samples a second": rates,
            "rate / rate of raster order": {name: r / rates["raster order"] for name, r in rates.items()},
        },
        "printed": {
            "seconds": {
                name: dict(zip(map(str, PRINTED_SPP), times, strict=True)) for name, times in PRINTED.items()
            }
        },
        "claims": {
            "Z takes about as long as (0,2), within 25 %": _within(ratios["Z / (0,2)"]),
            "Z takes about as long as ranked keys, within 25 %": _within(ratios["Z / ranked keys"]),
            "Sobol' takes longer than Z": {f"{s} spp": r > 1 for s, r in ratios["Sobol' / Z"].items()},
            "hashing and trees are about as fast, within 25 %": 1 / ALIKE < kinds < ALIKE,
        },
        "note": NOTE.format(width=width, height=height, spp=RATE_SPP, calls=calls),
    }
    return _draw(images, rates, f"{width} x {height} pixels"), numbers


def _within(ratios: dict[str, float]) -> dict[str, bool]:
    return {f"{s} spp": 1 / ALIKE < ratio < ALIKE for s, ratio in ratios.items()}


def _draw(images: dict[str, dict[str, float]], rates: dict[str, float], size: str) -> Figure:
    figure = new_figure(
        "From 4 samples per pixel on, the global Sobol' sequence is slower than Z\nZ paper, Table 1",
        4.6,
    )
    table, dots = figure.subplots(2, 1, height_ratios=(1, 1.6))
    _draw_table(table, images, size)
    _draw_rates(dots, rates)
    return figure


def _draw_table(axes: Axes, images: dict[str, dict[str, float]], size: str) -> None:
    """Write our seconds, and ratios of times: ours with the paper's on their right."""
    rows = []
    for spp in images["Z"]:
        row, k = [spp, *(_seconds(of[spp]) for of in images.values())], PRINTED_SPP.index(int(spp))
        for one, other in RATIOS:
            row.append(f"{images[one][spp] / images[other][spp]:.2f}")
            row.append(f"{PRINTED[one][k] / PRINTED[other][k]:.2f}")
        rows.append(row)
    first = 1 + len(images)
    groups = [(f"seconds, {size}", 1, first - 1)]
    for k, (one, other) in enumerate(RATIOS):
        groups.append((f"{one} / {other}", first + 2 * k, first + 2 * k + 1))
    text_table(
        axes,
        ["spp", *(name.removesuffix(" keys") for name in images), *("ours", "paper") * len(RATIOS)],
        rows,
        groups,
    )


def _seconds(value: float) -> str:
    return f"{value:.3f}" if value < 1 else f"{value:.2f}"


def _draw_rates(axes: Axes, rates: dict[str, float]) -> None:
    for y, (name, rate) in enumerate(rates.items()):
        drawn = plot.style(name, rates)
        axes.plot([0, rate], [y, y], color="0.85", lw=1, zorder=0)
        axes.plot(rate, y, drawn.marker, color=drawn.color, ms=7)
        axes.annotate(f"{rate:.0f}", (rate, y), (8, 0), textcoords="offset points", va="center")
    axes.set_yticks(range(len(rates)), list(rates))
    axes.invert_yaxis()
    axes.margins(x=0.15)
    axes.set(
        xlim=(0, None),
        xlabel="million samples per second",
        ylabel="sampler",
        title=f"points alone: the mean of x y at {RATE_SPP} samples per pixel",
    )

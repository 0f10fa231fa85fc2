"""Consecutive pairs and quadruples of coordinates: Sobol's sequence, and matrices over F_3 made for them."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures._rc import BLUE, GREY, ORANGE
from figures.plot import Style
from qmcjax import sequences

DIMS = 32


@cache
def _sobol() -> sequences.Digital:
    return sequences.sobol(DIMS)


@cache
def _quads() -> Any:
    return sequences.quad_optimized(DIMS)


class Generator(NamedTuple):
    """A scrambled sequence of a key, the base of its numbers of points, and how its curves are drawn."""

    make: Callable[[jax.Array], sequences.Sequence]
    base: int
    style: Style


GENERATORS = {
    "random": Generator(lambda key: sequences.uniform(DIMS, key), 2, Style(GREY, ".", ":")),
    "Sobol'": Generator(lambda key: sequences.owen(_sobol(), key), 2, Style(ORANGE, "o")),
    "quad-optimized": Generator(lambda key: sequences.owen(_quads(), key), 3, Style(BLUE, "s")),
}
DIRECTIONS = np.random.default_rng(1).normal(size=(16, 4))
MEANS = {"smooth": (np.e - 1) ** 4, "half spaces": 0.5}
GROUPS = {"pairs": 2, "quadruples": 4}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the numbers of points in the smallest fair intervals, and errors over the number of points."""
    log_fair, log_most, keys = (20, 14, 64) if quality == "paper" else (10, 7, 2)
    fair = {
        group: {"Sobol'": _fair(size, 2, log_fair), "quad-optimized": _fair(size, 3, log_fair)}
        for group, size in GROUPS.items()
    }
    progress(0.3)
    errors = {}
    for done, (name, generator) in enumerate(GENERATORS.items(), start=1):
        errors[name] = _errors(generator, log_most, keys)
        progress(0.3 + 0.7 * done / len(GENERATORS))
    slopes = {
        name: {kind: _slope(of_name["points"], of_name[kind]) for kind in MEANS}
        for name, of_name in errors.items()
    }
    ratios = {kind: _ratio(errors, kind) for kind in MEANS}
    return _draw(fair, errors), {
        "measured": {
            "points in the smallest fair intervals": fair,
            "root mean square errors over quadruples and keys": errors,
            "slopes": slopes,
            "error of quad-optimized over that of Sobol', geometric mean over its numbers of points": ratios,
        },
        "note": f"The first {DIMS} coordinates of both, in pairs 2 k, 2 k + 1 and quadruples 4 k to 4 k + 3. "
        "Of b^m points, intervals of volume b^(t - m) hold b^t each, for the t of the group's matrices; the "
        "smaller, the more of space is evened out. Errors are of means over 4 coordinates, of the "
        "exponential of their sum and of half spaces through the centre of the cube in "
        f"{len(DIRECTIONS)} random directions, after Owen scrambling by {keys} keys. Sobol's numbers of "
        "points are powers of 2, in base 3 powers of 3, where each is best. At powers of 3 the error is "
        f"{ratios['smooth']:.2f} times Sobol's for the smooth function and {ratios['half spaces']:.2f} times "
        "for half spaces, on average, with Sobol's error between its powers by a line. Sobol's sequence here "
        "is Joe and Kuo's, made for good pairs of any coordinates, and has 21,201 of them instead of 32. "
        "Faure's sequence has t = 0 for 32 coordinates in base 37, where it needs 37^m points.",
    }


def _fair(size: int, base: int, log_fair: int) -> dict[str, list[float]]:
    """Return b^t over the numbers of points, the mean and the largest of all groups of coordinates."""
    result: dict[str, list[float]] = {"points": [], "mean": [], "largest": []}
    for m in range(1, int(log_fair / np.log2(base)) + 1):
        counts = [float(base ** _t(range(j, j + size), base, m)) for j in range(0, DIMS, size)]
        result["points"].append(base**m)
        result["mean"].append(float(np.exp(np.mean(np.log(counts)))))
        result["largest"].append(max(counts))
    return result


def _t(dims: range, base: int, m: int) -> int:
    if base == 2:
        return analysis.t_value(np.asarray(_sobol().matrices)[list(dims)], m=m)
    return analysis.t_value(np.stack([_quads().matrix(j) for j in dims]).astype(np.int64)[:, :m, :m], base=3)


def _errors(generator: Generator, log_most: int, keys: int) -> dict[str, list[float]]:
    """Return errors of the means over the first b^m points."""
    counts = [generator.base**m for m in range(2, int(log_most / np.log2(generator.base)) + 1)]
    squares: dict[str, list[NDArray]] = {kind: [] for kind in MEANS}
    for key in jax.random.split(jax.random.key(3), keys):
        points = np.asarray(generator.make(key).points(counts[-1], dtype=jnp.float64))
        for first in range(0, DIMS, 4):
            four = points[:, first : first + 4]
            values = {
                "smooth": np.exp(four.sum(axis=1))[:, None],
                "half spaces": ((four - 0.5) @ DIRECTIONS.T < 0).astype(np.float64),
            }
            for kind, value in values.items():
                means = value.cumsum(axis=0)[np.array(counts) - 1] / np.array(counts)[:, None]
                squares[kind].append(((means - MEANS[kind]) ** 2).mean(axis=1))
    return {"points": [float(n) for n in counts]} | {
        kind: np.sqrt(np.mean(found, axis=0)).tolist() for kind, found in squares.items()
    }


def _slope(points: list[float], errors: list[float]) -> float:
    """Return the slope over the upper half of the numbers of points."""
    half = len(points) // 2
    return float(np.polyfit(np.log(points[half:]), np.log(errors[half:]), 1)[0])


def _ratio(errors: dict[str, dict[str, list[float]]], kind: str) -> float:
    one, other = errors["quad-optimized"], errors["Sobol'"]
    inside = np.array(one["points"]) >= other["points"][0]
    points = np.log(one["points"])[inside]
    line = np.interp(points, np.log(other["points"]), np.log(other[kind]))
    return float(np.exp(np.mean(np.log(one[kind])[inside] - line)))


def _draw(fair: dict, errors: dict) -> Figure:
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    figure.suptitle(f"Consecutive pairs and quadruples among {DIMS} coordinates")
    panels = figure.subplots(2, 2)
    for axes, (group, found) in zip(panels[0], fair.items(), strict=True):
        for name, values in found.items():
            drawn = GENERATORS[name].style
            for which, line in (("mean", "-"), ("largest", "--")):
                axes.loglog(
                    values["points"],
                    values[which],
                    color=drawn.color,
                    marker=drawn.marker,
                    ls=line,
                    label=f"{name}, {which}",
                )
        axes.set_yscale("log", base=2)
        # Room for the legend.
        axes.set(title=group, xlabel="points", ylabel="points in the smallest fair intervals, $b^t$")
        axes.set_ylim(0.8, 8 * max(found["Sobol'"]["largest"]))
        axes.legend(frameon=False, ncols=2, loc="upper left")
    for axes, kind in zip(panels[1], MEANS, strict=True):
        _draw_errors(axes, errors, kind)
    for axes in panels.flat:
        axes.grid(alpha=0.3)
    return figure


def _draw_errors(axes: Axes, errors: dict, kind: str) -> None:
    for name, found in errors.items():
        drawn = GENERATORS[name].style
        axes.loglog(
            found["points"], found[kind], color=drawn.color, marker=drawn.marker, ls=drawn.line, label=name
        )
    axes.set(title=f"{kind}, 4-D, Owen-scrambled", xlabel="points", ylabel="RMS error")
    axes.legend(frameon=False)

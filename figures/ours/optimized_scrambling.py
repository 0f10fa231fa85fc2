"""Scramblings of nets by gradients of relaxed permutations, beside random ones and annealing of swaps."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._rc import BLUE, GREY, VERMILLION
from figures.shared.turns import in_turns, median
from qmcjax import orders, sequences

Integers = NDArray[np.int64]
Measure = Callable[[Array], Array]

SIZES = {"draft": (4, 20, 1), "paper": (8, 300, 5)}
"""m of the 2^m points, steps of the descent, keys."""

COST = 3
"""Values that count as much as one with its gradient."""

SIGMA = 1.5
"""Of the Gaussian, in pixels."""

MEAN_DISTANCE = (2 + np.sqrt(2) + 5 * np.log(1 + np.sqrt(2))) / 15
"""Between two random points of the unit square."""

NOTE = (
    "All are Owen scramblings of the same net of {n} points, at the middles of cells of side 1 / {n}: of "
    "Hammersley's net, and for pixels of the first {n} Sobol' points, one in each of {side} x {side} "
    "pixels in Morton order on a torus. The filtered error is that of random half planes after a Gaussian"
    " of 1.5 pixels, in closed form (their covariance is minus the distance), relative to white noise. A "
    "value with its gradient counts as {cost} values; it took {ratio}. Annealing exchanges the halves "
    "below one random node of a tree at a time, and begins with a temperature of half the standard "
    "deviation of random scramblings' measures, falling to a hundredth. Both searches begin with "
    "random scramblings. Lines: geometric means over {keys} keys, bands: all keys. {found} The nets as they "
    "are have {unscrambled} times the measure of a random scrambling. {same}"
)


class Task(NamedTuple):
    """A net, and the measure that its scramblings are searched for."""

    net: Integers
    measure: Measure


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Search by three methods, with as many evaluations, and draw how far they come."""
    m, steps, keys = SIZES[quality]
    measured: dict[str, dict[str, Any]] = {}
    curves: dict[str, dict[str, NDArray]] = {}
    found = {}
    tasks = _tasks(m)
    for done, (name, task) in enumerate(tasks.items(), start=1):
        values, curves[name], found[name] = _searched(task, steps, keys)
        measured[name] = values
        progress(done / len(tasks))
    same = [
        bool(analysis.t_value(found[name] / 2**m) == analysis.t_value(task.net / 2**m))
        for name, task in tasks.items()
    ]
    gains = {
        name: {other: of["gradients"]["mean"] / of[other]["mean"] for other in ("random", "annealing")}
        for name, of in measured.items()
    }
    return _draw(measured, curves, found), {
        "measured": {
            "points": 2**m,
            "searches": measured,
            "error by gradients / by another": gains,
            "t of the best net is that of the given one": sum(same),
        },
        "note": NOTE.format(
            n=2**m,
            side=2 ** (m // 2),
            cost=COST,
            keys=keys,
            ratio=" ".join(
                f"{of['seconds of a gradient / of a value']:.1f} ({name})," for name, of in measured.items()
            ).rstrip(","),
            found="What gradients find over the best random one and over annealing: "
            + "; ".join(
                f"{name} {gain['random']:.3f} and {gain['annealing']:.3f}" for name, gain in gains.items()
            )
            + ".",
            unscrambled=", ".join(f"{of['unscrambled']:.2f}" for of in measured.values()),
            same=f"{sum(same)} of {len(same)} results have the t of the given net.",
        ),
    }


def _tasks(m: int) -> dict[str, Task]:
    n, sobol = 2**m, sequences.sobol(2)
    hammersley = _integers(sequences.hammersley_net(m), n)
    return {
        "L2-star discrepancy": Task(hammersley, analysis.l2_star_discrepancy),
        "filtered error of pixels": Task(_integers(sobol, n), filtered(2 ** (m // 2))),
        "no power below 0.7 sqrt(n)": Task(hammersley, off_target),
    }


def _integers(sequence: sequences.Sequence, n: int) -> Integers:
    return np.floor(np.asarray(sequence.points(n), np.float64) * n).astype(np.int64)


def filtered(side: int) -> Measure:
    """Return the error of random half planes after the filter: point k is in pixel k of Morton's curve."""
    x, y = (np.asarray(each) for each in orders.morton(side, side).pixel(jnp.arange(side * side)))
    frequency = np.fft.fftfreq(side)
    squared = np.exp(-np.square(2 * np.pi * SIGMA * np.hypot(frequency[:, None], frequency)))
    weight = np.fft.ifft2(squared).real
    weights = weight[(y[:, None] - y) % side, (x[:, None] - x) % side]
    itself = np.eye(side * side)

    def measure(points: Array) -> Array:
        squares = sum(jnp.square(points[:, None, j] - points[None, :, j]) for j in range(2))
        # The root of zero has no derivative.
        distance = jnp.sqrt(squares + itself) - itself
        middle = _mean_distance(points[:, 0], points[:, 1])
        covariance = middle[:, None] + middle[None, :] - distance - MEAN_DISTANCE
        return jnp.sqrt(jnp.sum(weights * covariance) / (side * side * weight[0, 0] * MEAN_DISTANCE))

    return measure


def _mean_distance(x: Array, y: Array) -> Array:
    """Return the mean distance of a point to those of the unit square: rectangles with it as a corner."""

    def corner(a: Array, b: Array) -> Array:
        c = jnp.hypot(a, b)
        return (2 * a * b * c + a**3 * jnp.log((b + c) / a) + b**3 * jnp.log((a + c) / b)) / 6

    return corner(x, y) + corner(1 - x, y) + corner(x, 1 - y) + corner(1 - x, 1 - y)


def off_target(points: Array) -> Array:
    """Return the mean power below the frequency that n points can do without: blue noise."""
    n = len(points)
    most = int(0.7 * np.sqrt(n))
    power = analysis.point_spectrum(points, 2 * most + 1)
    frequency = np.fft.fftfreq(2 * most + 1) * (2 * most + 1)
    radius = np.hypot(frequency[:, None], frequency)
    low = (radius > 0) & (radius < 0.7 * np.sqrt(n))
    return jnp.sum(jnp.where(low, power, 0)) / np.count_nonzero(low)


def _searched(task: Task, steps: int, keys: int) -> tuple[dict[str, Any], dict[str, NDArray], Integers]:
    """Return ends and curves of all methods, relative to the mean of random scramblings, and the best net."""
    n = len(task.net)
    compiled = jax.jit(task.measure)

    def value(net: Integers) -> float:
        with jax.enable_x64(True):
            return float(compiled((net + 0.5) / n))

    runs: dict[str, list[NDArray]] = {"random": [], "annealing": [], "gradients": []}
    nets, means = [], []
    for key in range(keys):
        start = _scrambled(task.net, np.random.default_rng(key))
        result = analysis.optimize_scrambling(start, task.measure, steps, key)
        nets.append((result.values[-1], result.points))
        runs["gradients"].append(_over_cost(result.values, steps))
    budget = max(len(values) for values in runs["gradients"])
    for key in range(keys):
        rng = np.random.default_rng(key)
        start = _scrambled(task.net, rng)
        drawn = np.array([value(_scrambled(task.net, rng)) for _ in range(budget)])
        means.append(drawn.mean())
        runs["random"].append(np.minimum.accumulate(drawn))
        annealed = _annealed(start, value, budget, drawn.std() / 2, rng)
        runs["annealing"].append(np.minimum.accumulate(list(annealed)))
    usual = float(np.mean(means))
    ends: dict[str, Any] = {
        "unscrambled": value(task.net) / usual,
        "mean of random": usual,
        "values": budget,
        "seconds of a gradient / of a value": _ratio(task, compiled),
    }
    curves = {}
    for method, of in runs.items():
        # What has ended before keeps its value.
        longest = max(map(len, of))
        of = np.array([np.pad(values, (0, longest - len(values)), mode="edge") for values in of]) / usual
        curves[method] = of
        last = of[:, -1]
        ends[method] = {
            "mean": float(np.exp(np.log(last).mean())),
            "least": float(last.min()),
            "largest": float(last.max()),
        }
    return ends, curves, min(nets, key=lambda pair: pair[0])[1]


def _over_cost(values: NDArray, steps: int) -> NDArray:
    """Return the best so far over costs: of the first, gradients, and later where there is a better one."""
    better = np.diff(values, prepend=np.inf) < 0
    cost = np.where((np.arange(len(values)) <= steps), COST, 1 + COST * better)
    return np.repeat(values, cost)


def _scrambled(net: Integers, rng: np.random.Generator) -> Integers:
    """Return a random nested scrambling of all digits."""
    digits = len(net).bit_length() - 1
    made = net.copy()
    for j in range(net.shape[1]):
        for k in range(digits):
            coins = rng.integers(0, 2, 2**k)
            made[:, j] ^= coins[net[:, j] >> (digits - k)] << (digits - 1 - k)
    return made


def _annealed(
    net: Integers, value: Callable[[Integers], float], steps: int, hot: float, rng: np.random.Generator
) -> Iterator[float]:
    """Yield the values of nets that differ from one another by the halves below one node."""
    digits = len(net).bit_length() - 1
    now = value(net)
    yield now
    for step in range(1, steps):
        temperature = hot * 0.01 ** (step / steps)
        j, k = rng.integers(net.shape[1]), rng.integers(digits)
        below = net[:, j] >> (digits - k) == rng.integers(2**k)
        net[below, j] ^= 1 << (digits - 1 - k)
        tried = value(net)
        if tried <= now or rng.random() < np.exp((now - tried) / temperature):
            now = tried
        else:
            net[below, j] ^= 1 << (digits - 1 - k)
        yield now


def _ratio(task: Task, value: Callable[[Array], Array]) -> float:
    """Return how many times as long a value with its gradient takes: medians, warm."""
    both = {"value": value, "gradient": jax.jit(jax.value_and_grad(task.measure))}
    with jax.enable_x64(True):
        points = jnp.asarray((task.net + 0.5) / len(task.net))
        alone, gradient = map(median, in_turns(both, 19, draw=lambda _: points).values())
    return gradient / alone


COLORS = {"random": GREY, "annealing": BLUE, "gradients": VERMILLION}
WORDS = {
    "random": "best random scrambling",
    "annealing": "annealing of swaps",
    "gradients": "optimize_scrambling",
}


def _draw(
    measured: dict[str, dict[str, Any]],
    curves: dict[str, dict[str, NDArray]],
    found: dict[str, Integers],
) -> Figure:
    figure = Figure(figsize=(11.0, 7.4), layout="constrained")
    figure.suptitle("Scramblings of one net, by three searches with as many evaluations", fontsize=11)
    panels = figure.subplots(2, len(curves), height_ratios=[1, 1.25])
    for column, (name, of) in enumerate(curves.items()):
        _curves(panels[0, column], name, of)
        net = found[name]
        ends = measured[name]["gradients"]
        plot.points(
            (net + 0.5) / len(net),
            title=f"{len(net)} points of the least measure:\n{ends['least']:.3f} of the mean of random ones",
            ax=panels[1, column],
        )
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure


def _curves(axes: Axes, name: str, of: dict[str, NDArray]) -> None:
    for method, values in of.items():
        evaluations = np.arange(1, values.shape[1] + 1)
        mean = np.exp(np.log(values).mean(axis=0))
        axes.step(evaluations, mean, where="post", color=COLORS[method], lw=1.2, label=WORDS[method])
        axes.fill_between(
            evaluations,
            values.min(axis=0),
            values.max(axis=0),
            step="post",
            color=COLORS[method],
            alpha=0.2,
            lw=0,
        )
    axes.set(
        xscale="log",
        title=name,
        xlabel=f"values of the measure (a gradient counts {COST})",
        ylabel="best so far / mean of random",
    )
    axes.grid(alpha=0.3)

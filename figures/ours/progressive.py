"""One sampler for any number of samples, beside those that are made for each number."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from figures import plot
from figures.making import finished_cells
from figures.shared import judged
from figures.shared.integrands import integrand_classes, integrands_of_dims
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from figures.shared.sheets import marks
from qmcjax import samplers
from qmcjax.choosing import CANDIDATES

OURS = "progressive"
ORDERS = ("optimised orders", "Hilbert, Owen-Sobol'", "Z, hash")
RIVALS = (*ORDERS, "designed tiles")
DIMS = (2, 4)
GOALS = {2: 1.15, 4: 1.20}
"""How much larger than those of the best order for a number of samples errors may be."""


class Size(NamedTuple):
    """How much is measured."""

    side: int
    keys: int
    counts: tuple[int, ...]
    """Powers of two: for these there are other samplers."""
    orders: tuple[str, ...]
    rivals: tuple[str, ...]

    def others(self, spp: int) -> tuple[str, ...]:
        """Return those that are made for a number of samples; the best are left if it is large."""
        return self.rivals if spp <= ALL_UP_TO else self.orders[:2]


SIZES = {
    "draft": Size(32, 4, (1, 4), ORDERS[:2], ORDERS[:2]),
    "paper": Size(64, 16, (1, 2, 4, 8, 16, 32, 64, 256, 1024, 4096), ORDERS, RIVALS),
}
ALL_UP_TO = 64

TIMED_SIDE, TIMED_SPP = 256, 16

TITLE = (
    "Up to {most} samples of one sampler, at powers of two: filtered errors are {low:.2f} to {high:.2f}\n"
    "times in 2-D, {low_4:.2f} to {high_4:.2f} times in 4-D those of the best order made for just that number"
)

NOTE = (
    f"{{side}} x {{side}} pixels, {{keys}} keys, {COUNT} integrands each of {', '.join(CLASSES)}, the same "
    "in all pixels; none was used in the search. Errors are what a Gaussian of 1.5 pixels leaves of an image "
    "without its mean, root mean squares in a class and geometric means over classes, relative to "
    "independent samples, one per pixel. Above: errors of the first samples over those of samplers made for "
    "their number, the best order ({orders}) or the best of these and designed tiles, with Student's "
    f"intervals of 95 % over keys. The goals were {GOALS[2]} in 2-D, {GOALS[4]} in 4-D; {{verdicts}}. Below: "
    "errors also of numbers that are no powers of two; they are at most {between} of the larger error of "
    "both neighbouring powers. RMS errors of pixels, not filtered, are at most {plain} of those of the best "
    f"order. A frame of x y with {TIMED_SPP} samples takes {{slower:.2f}} of the time of optimised orders. "
    "What bounds it: all numbers of samples share one permutation of each square. By the closed form of the "
    "search, in 2-D, those for one number alone in the same nets are as good as the best order. Beside the "
    "order, nets in 2-D leave a pixel only which half of its samples comes first; searches over that gained "
    "nothing to speak of. Designed tiles are not stratified along the axes, and end at 16 samples. Above "
    f"{ALL_UP_TO} samples only {{best}} are made for each number."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all samplers, and draw ratios and errors."""
    size = SIZES[quality]
    counts, prefixes = size.counts, lengths(size.counts[-1])
    keys = range(1, size.keys + 1)

    def ours(dims: int) -> NDArray:
        made = [samplers.progressive(size.side, size.side, key, dims) for key in keys]
        return np.array([prefix_errors(sampler, size.side, dims, prefixes) for sampler in made])

    def theirs(dims: int, name: str, spp: int) -> NDArray:
        made = [CANDIDATES[name].make(dims, size.side, size.side, spp, key) for key in keys]
        return np.array([prefix_errors(sampler, size.side, dims, (spp,))[0] for sampler in made])

    cells: dict[str, Callable[[], NDArray]] = {f"{OURS} {dims}": partial(ours, dims) for dims in DIMS}
    for spp in counts:
        for dims in DIMS:
            for name in size.others(spp):
                cells[f"{name} {dims} {spp}"] = partial(theirs, dims, name, spp)
    measured = finished_cells.shared("errors", cells, lambda part: progress(0.95 * part))
    optimized = samplers.optimized(TIMED_SIDE, TIMED_SIDE, TIMED_SPP, 1)
    sampler = samplers.progressive(TIMED_SIDE, TIMED_SIDE, 1)
    slower = integrand_classes.time_ratio(sampler, optimized, TIMED_SIDE, TIMED_SPP)
    ratios = {
        (dims, among): {
            spp: _ratio(measured, dims, spp, [name for name in size.others(spp) if name in names], prefixes)
            for spp in counts
        }
        for dims in DIMS
        for among, names in (("the best order", size.orders), ("the best sampler", size.rivals))
    }
    between = {dims: _between(measured[f"{OURS} {dims}"], prefixes) for dims in DIMS}
    plain = {dims: max(of.plain for of in ratios[dims, "the best order"].values()) for dims in DIMS}
    spans = {dims: _span(ratios[dims, "the best order"]) for dims in DIMS}
    title = TITLE.format(
        most=counts[-1], low=spans[2][0], high=spans[2][1], low_4=spans[4][0], high_4=spans[4][1]
    )
    figure = _draw(title, measured, ratios, size, prefixes)
    return figure, {
        "measured": {
            "filtered error / white noise": {name: _middle(of).tolist() for name, of in measured.items()},
            "ours / best": {
                f"{dims}-D, {among}": {str(spp): of._asdict() for spp, of in row.items()}
                for (dims, among), row in ratios.items()
            },
            "other numbers / neighbouring powers of two": {f"{dims}-D": of for dims, of in between.items()},
            "time / time of optimised orders": slower,
        },
        "note": NOTE.format(
            side=size.side,
            keys=size.keys,
            orders=", ".join(size.orders),
            verdicts=_verdicts(ratios),
            between=_by_dims(between),
            plain=_by_dims(plain),
            slower=slower,
            best=" and ".join(size.orders[:2]),
        ),
    }


TOGETHER = 64
"""Samples whose values are summed in float32."""

WHITE = 1 / (2 * np.sqrt(np.pi) * 1.5)
"""What the filter leaves of white noise of standard deviation 1."""


def lengths(most: int) -> tuple[int, ...]:
    """Return numbers of samples: all up to 16, then 4 in each octave."""
    octaves = [k << m for m in range(2, 13) for k in (5, 6, 7, 8)]
    return tuple(n for n in (*range(1, 17), *(n for n in octaves if n > 16)) if n <= most)


@partial(jax.jit, static_argnums=(1, 2))
def _sum(sampler: samplers.Sampler, side: int, dims: int, start: Array, stop: Array) -> Array:
    """Return the sums of the values of the integrands over some samples of all pixels."""
    wanted = tuple(range(dims))
    state = sampler.prepare_image(side, side, wanted)

    def add(number: Array, total: Array) -> Array:
        sample = jnp.full((side, side), number, jnp.uint32)
        return total + integrands_of_dims.values(sampler.points(state, sample, wanted, jnp.float32))

    return lax.fori_loop(start, stop, add, jnp.zeros((side, side, len(CLASSES) * COUNT)))


def prefix_errors(
    sampler: samplers.Sampler, side: int, dims: int, counts: tuple[int, ...]
) -> NDArray[np.float64]:
    """Return filtered and RMS errors of the first samples, shape (counts, 2): geometric means over classes.

    Of images without their means, relative to independent samples, one per pixel.
    """
    deviation = integrands_of_dims.moments(dims)[1]
    total, found = np.zeros((side, side, len(deviation))), []
    for start, stop in zip((0, *counts), counts, strict=False):
        for first in range(start, stop, TOGETHER):
            total += np.asarray(_sum(sampler, side, dims, first, min(first + TOGETHER, stop)))
        image = (total - total.mean(axis=(0, 1))) / stop / deviation
        of_classes = integrand_classes.of_classes(image, len(CLASSES)) / [[WHITE], [1]]
        found.append([np.exp(np.mean(np.log(of))) for of in of_classes])
    return np.array(found)


class Ratio(NamedTuple):
    """Of filtered errors, with an interval, and of RMS errors, to those of the sampler of this name."""

    best: str
    middle: float
    low: float
    high: float
    plain: float


def _middle(of: NDArray) -> NDArray[np.float64]:
    """Return geometric means over keys of filtered errors."""
    return np.exp(np.log(of[..., 0]).mean(axis=0))


def _ratio(measured: dict, dims: int, spp: int, names: list[str], prefixes: tuple[int, ...]) -> Ratio:
    best = min(names, key=lambda name: float(_middle(measured[f"{name} {dims} {spp}"])))
    ours = measured[f"{OURS} {dims}"][:, prefixes.index(spp)]
    logs = np.log(ours) - np.log(measured[f"{best} {dims} {spp}"])
    _, low, high = judged.of_logarithms(logs[:, 0])
    middle, plain = np.exp(logs.mean(axis=0))
    return Ratio(best, float(middle), low, high, float(plain))


def _between(found: NDArray, prefixes: tuple[int, ...]) -> float:
    """Return the largest error of other numbers, over the larger one of both powers of two around."""
    errors = dict(zip(prefixes, _middle(found), strict=True))
    others = [n for n in prefixes if n & (n - 1)]
    return max(errors[n] / max(errors[1 << k] for k in (n.bit_length() - 1, n.bit_length())) for n in others)


def _span(row: dict[int, Ratio]) -> tuple[float, float]:
    middles = [of.middle for of in row.values()]
    return min(middles), max(middles)


def _verdicts(ratios: dict) -> str:
    found = []
    for dims in DIMS:
        row, goal = ratios[dims, "the best order"], GOALS[dims]
        kinds = {
            "reached": [n for n, of in row.items() if of.high <= goal],
            "missed": [n for n, of in row.items() if of.low > goal],
        }
        kinds["undecided"] = [n for n in row if not any(n in of for of in kinds.values())]
        words = [f"{kind} at {', '.join(map(str, of))}" for kind, of in kinds.items() if of]
        found.append(f"in {dims}-D they are {'; '.join(words)}")
    return ", and ".join(found)


def _by_dims(found: dict[int, float]) -> str:
    return ", ".join(f"{of:.2f} ({dims}-D)" for dims, of in found.items())


def _draw(title: str, measured: dict, ratios: dict, size: Size, prefixes: tuple[int, ...]) -> Figure:
    figure = Figure(figsize=(12, 8), layout="constrained")
    figure.suptitle(title)
    panels = figure.subplots(2, 2, height_ratios=(1, 1.3))
    for k, dims in enumerate(DIMS):
        _ratios(panels[0, k], dims, ratios)
        _curves(panels[1, k], dims, measured, size, prefixes)
    panels[0, 0].set_ylabel("filtered error, first samples / made for them")
    panels[1, 0].set_ylabel("filtered error / white noise, 1 spp")
    for axes in panels.flat:
        axes.set(xscale="log", xlabel="samples per pixel")
        axes.set_xticks(size.counts, [str(n) for n in size.counts], fontsize=7)
        axes.minorticks_off()
    panels[0, 0].legend(frameon=False, fontsize=8)
    panels[1, 0].legend(frameon=False, fontsize=8)
    return figure


def _ratios(axes: Axes, dims: int, ratios: dict) -> None:
    for shift, among in ((0.97, "the best order"), (1.03, "the best sampler")):
        row = ratios[dims, among]
        shown = [(of.middle, of.low, of.high) for of in row.values()]
        style = plot.style(among, ("the best order", "the best sampler"))
        look = {"ms": 4, "lw": 1, "ls": "-", "capsize": 2, "label": f"over {among} for this number"}
        marks.ratios(axes, np.array(list(row)) * shift, shown, style, **look)
    axes.axhline(1, color="0.3", lw=0.8)
    axes.axhline(GOALS[dims], color="0.3", lw=0.8, ls="--", label="goal, over the best order")
    axes.set_title(f"{dims}-D")


def _curves(axes: Axes, dims: int, measured: dict, size: Size, prefixes: tuple[int, ...]) -> None:
    names = (OURS, *RIVALS)
    errors = _middle(measured[f"{OURS} {dims}"])
    axes.plot(prefixes, errors, color=plot.style(OURS, names).color, label=f"the first n of {OURS}")
    for name in size.rivals:
        style = plot.style(name, names)
        counts = [spp for spp in size.counts if name in size.others(spp)]
        errors = [float(_middle(measured[f"{name} {dims} {spp}"])) for spp in counts]
        axes.plot(counts, errors, style.marker, color=style.color, ms=4, label=f"{name}, made for n")
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(lw=0.4, color="0.9")

"""What is not computed: pixels that are constant, passes of pixels that are good enough, and edges alone."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures import _sweep
from qmcjax import orders, samplers, scenes, sequences


class Size(NamedTuple):
    """How much is measured."""

    side: int
    counts: tuple[int, ...]
    calls: int
    tolerant_side: int
    passes: int
    keys: int
    edges: tuple[int, ...]


SIZES = {
    "draft": Size(128, (64,), 1, 64, 16, 1, (2**10, 2**13)),
    "paper": Size(512, (1024, 16), 7, 256, 64, 8, tuple(2**k for k in range(8, 21, 2))),
}

SCENES = {
    "checkerboard": scenes.checkerboard(),
    "disc": scenes.disc(),
    "step": scenes.step(),
    "ball": scenes.ball(),
}

PER_PASS = 16
TOLERANCE = 0.01
UNTIL = {"zone plate": scenes.zone_plate(1000.0), "ball": scenes.ball()}
"""Scenes that are rendered until the error is below the tolerance."""

GRADIENT_SIDE = 64

ASKED = (
    "at 1024 samples, time within 30 % of the proportion of samples taken times the full time, "
    "and disc and step at least 8 times faster; at 16 samples never slower than 1.3 times; error no larger"
)

NOTE = (
    "{side} x {side} pixels. Skipping: Owen-scrambled Sobol' samples along the Hilbert curve; medians of "
    "{calls} calls, each with a new key, with and without in turn, after one that compiles; 'over "
    "proportion' is the time with skipping over the proportion of samples taken times the time without, "
    "'beyond proportion' the difference: deciding which pixels are constant, and bringing the image "
    "together, is part of the time and weighs most where next to nothing is sampled. Passes: "
    "{tolerant_side} x {tolerant_side} pixels, of {per_pass} samples, until the standard error of a pixel "
    "and its neighbours is at most {tolerance}, at most {limit} samples; 'mean error' is that of the whole "
    "image, with its standard error over {keys} keys. Edges: the derivative of the mean of each of "
    "{edge_side} x {edge_side} pixels with respect to the disc's radius, RMS error over pixels and {keys} "
    "keys."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure skipping, passes and gradients, and draw where the samples went."""
    size = SIZES[quality]
    figure = Figure(figsize=(15, 15.5), layout="constrained")
    figure.suptitle("Samples that are not taken")
    panels = figure.subplots(4, 4)

    table: dict[str, dict[str, dict[str, float]]] = {}
    for column, (name, scene) in enumerate(SCENES.items()):
        table[name] = {str(spp): _compared(scene, size, spp) for spp in size.counts}
        _draw_skipping(panels[:2, column], name, scene, size, table[name])
        progress(0.15 * (column + 1))
    passes: dict[str, dict[str, dict[str, float]]] = {}
    for k, (name, scene) in enumerate(UNTIL.items()):
        passes[name] = {}
        for j, unbiased in enumerate((False, True)):
            way = "unbiased" if unbiased else "biased"
            result, passes[name][way] = _until(scene, size, unbiased)
            title = f"{name}, {way}"
            _draw_passes(panels[2, 2 * k + j], title, result, passes[name][way], size)
        progress(0.6 + 0.15 * (k + 1))
    figure.colorbar(panels[2, 0].images[0], ax=panels[2], shrink=0.8, label="passes")
    gradients = _gradients(panels[3, :3], size)
    _draw_times(panels[3, 3], table)
    return figure, {
        "measured": {
            "skipping": table,
            "passes": passes,
            "gradient of the disc's radius": gradients,
            "asked for": ASKED,
        },
        "note": NOTE.format(
            side=size.side,
            calls=size.calls,
            tolerant_side=size.tolerant_side,
            per_pass=PER_PASS,
            tolerance=TOLERANCE,
            limit=PER_PASS * size.passes,
            keys=size.keys,
            edge_side=GRADIENT_SIDE,
        ),
    }


def _compared(scene: Any, size: Size, spp: int) -> dict[str, float]:
    """Return times and errors with and without skipping, in turn."""
    along = _sweep.SAMPLERS[_sweep.ADAPTIVE]
    exact = scene.reference(size.side, size.side)[0]
    seconds: dict[bool, list[float]] = {True: [], False: []}
    squares: dict[bool, list[float]] = {True: [], False: []}
    for key in range(size.calls + 1):
        for adaptive in (False, True):
            taken, image = _sweep.timed(scene, along, size.side, spp, key, adaptive)
            seconds[adaptive].append(taken)
            squares[adaptive].append(float(np.mean((image - exact) ** 2)))
    with_, without = (float(np.median(seconds[adaptive][1:])) for adaptive in (True, False))
    saving = _skipped(scene, size, spp).saving
    return {
        "saving": saving,
        "proportion taken": 1 - saving,
        "seconds without": without,
        "seconds with": with_,
        "times faster": without / with_,
        "over proportion": with_ / ((1 - saving) * without),
        "seconds beyond proportion": with_ - (1 - saving) * without,
        "rms error without": float(np.sqrt(np.mean(squares[False]))),
        "rms error with": float(np.sqrt(np.mean(squares[True]))),
    }


def _skipped(scene: Any, size: Size, spp: int) -> Any:
    sampler = _sweep.SAMPLERS[_sweep.ADAPTIVE](size.side, spp, len(scene.needs), 0)
    return qj.render_adaptive(scene, sampler, size.side, size.side, spp)


def _draw_skipping(
    panels: NDArray[Any], name: str, scene: Any, size: Size, table: dict[str, dict[str, float]]
) -> None:
    result = _skipped(scene, size, size.counts[-1])
    panels[0].imshow(result.image, cmap="gray", vmin=0)
    panels[0].set_title(f"{name}, {size.counts[-1]} samples a pixel", fontsize=9)
    sampled = result.counts > 1
    panels[1].imshow(sampled, cmap="gray_r")
    lines = [f"{sampled.mean():.1%} of the pixels are sampled (black)"]
    for spp, row in table.items():
        lines.append(f"{spp} spp: {row['times faster']:.2f} times faster,")
        lines.append(f"time / proportion {row['over proportion']:.2f}")
    panels[1].set_title("\n".join(lines), fontsize=8)
    for axes in panels:
        axes.set_axis_off()


def _draw_times(axes: Axes, table: dict[str, dict[str, dict[str, float]]]) -> None:
    """Draw the times over the parts of the samples, and what was asked for."""
    for marker, (name, rows) in zip("osD^", table.items(), strict=True):
        for k, (spp, row) in enumerate(rows.items()):
            part, times = row["proportion taken"], row["seconds with"] / row["seconds without"]
            axes.loglog(part, times, marker, color=f"C{k}", ms=5, label=f"{name}, {spp} spp")
    ends = np.array([0.003, 1])
    axes.loglog(ends, ends, "k-", lw=0.8)
    axes.loglog(ends, 1.3 * ends, "k:", lw=0.8, label="1.3 times the part")
    axes.set(xlabel="part of the samples taken", ylabel="part of the time", title="time with skipping")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)


def _until(scene: Any, size: Size, unbiased: bool) -> tuple[Any, dict[str, float]]:
    """Return an image made of passes, and errors over several keys."""
    side, dims = size.tolerant_side, len(scene.needs)
    exact = scene.reference(side, side)[0]
    order = orders.hilbert(side, side)

    def one_pass(key: jax.Array) -> samplers.Sampler:
        return samplers.contiguous(order, sequences.owen(sequences.sobol(dims), key), PER_PASS)

    results = [
        qj.render_adaptive(
            scene,
            samplers.randomized(one_pass, key, PER_PASS),
            side,
            side,
            PER_PASS * size.passes,
            tolerance=TOLERANCE,
            unbiased=unbiased,
        )
        for key in range(size.keys)
    ]
    errors = np.stack([np.asarray(result.image, np.float64) for result in results]) - exact
    means = errors.mean(axis=(1, 2))
    numbers = {
        "rms error": float(np.sqrt(np.mean(errors**2))),
        "largest rms error of a pixel": float(np.sqrt(np.mean(errors**2, axis=0)).max()),
        "saving": float(np.mean([result.saving for result in results])),
        "mean error": float(means.mean()),
    }
    if size.keys > 1:
        numbers["standard error of the mean error"] = float(means.std(ddof=1) / np.sqrt(size.keys))
    return results[0], numbers


def _draw_passes(axes: Axes, title: str, result: Any, numbers: dict[str, float], size: Size) -> None:
    axes.imshow(result.counts / PER_PASS, vmin=0, vmax=size.passes)
    axes.set_title(
        f"{title}: until the error is {TOLERANCE}\nreached {numbers['rms error']:.2g}, "
        f"saving {numbers['saving']:.1%}\nmean error {numbers['mean error']:.1e}",
        fontsize=8,
    )
    axes.set_axis_off()


def _gradients(panels: NDArray[Any], size: Size) -> dict[str, Any]:
    """Draw the derivatives of the disc's means with respect to its radius, and their errors over n."""
    scene, side = SCENES["disc"], GRADIENT_SIDE
    exact = scene.reference_gradient(side, side)[0].radius
    largest = float(abs(exact).max())

    def estimated(sequence: sequences.Sequence, n: int) -> NDArray[np.float64]:
        return np.asarray(qj.boundary_gradient(scene, sequence, side, side, n).radius, np.float64)

    n = size.edges[len(size.edges) // 2]
    kinds: dict[str, Callable[[int], sequences.Sequence]] = {
        "random": lambda key: sequences.uniform(1, key),
        "van der Corput, Owen": lambda key: sequences.owen(sequences.van_der_corput(), key),
    }
    for axes, image, title in (
        (panels[0], exact, "derivative by the radius, exact"),
        (
            panels[1],
            estimated(kinds["van der Corput, Owen"](0), n),
            f"by {n} points on the edge",
        ),
    ):
        axes.imshow(image, vmin=0, vmax=largest, interpolation="nearest")
        axes.set_title(title, fontsize=9)
        axes.set_axis_off()
    errors: dict[str, dict[str, float]] = {}
    for kind, make_one in kinds.items():
        errors[kind] = {}
        for n in size.edges:
            images = [estimated(make_one(key), n) for key in range(size.keys)]
            errors[kind][str(n)] = float(np.sqrt(np.mean((np.stack(images) - exact) ** 2)))
        panels[2].loglog(size.edges, list(errors[kind].values()), "o-", ms=3, label=kind)
    panels[2].set(xlabel="points on the edge", ylabel="RMS error", title="derivative by the radius")
    panels[2].grid(alpha=0.3)
    panels[2].legend(fontsize=8)
    return {
        "rms error": errors,
        "random over van der Corput": {
            str(n): errors["random"][str(n)] / errors["van der Corput, Owen"][str(n)] for n in size.edges
        },
        "largest derivative": largest,
    }

"""What is not computed of ray-traced scenes: time where nothing moves, passes of pixels good enough."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures.shared import diffusion, traced_images
from figures.shared.image_grid import Panel, add_axes, image_grid
from qmcjax import samplers, scenes, sequences


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spp: int
    calls: int
    names: tuple[str, ...]
    reference: int
    per_pass: int
    passes: int
    tolerances: tuple[float, ...]


SIZES = {
    "draft": Size(64, 16, 1, ("cornell_box",), 256, 8, 8, (0.02,)),
    "paper": Size(128, 64, 3, ("cornell_box", "helicopter"), 1024, 16, 16, (0.02, 0.01, 0.005)),
}

KEY = 3

NOTE = (
    "{side} x {side} pixels. Time matters where `varies` says so: in boxes around all that moves and its "
    "shadows, and on the helicopter's ground, whose checkerboard moves everywhere. Elsewhere ray-traced "
    "scenes sample it nevertheless, since another program would take longer to compile than it saves. "
    "Skipping: {spp} samples per pixel, no pixel of these scenes is constant; seconds are minima of {calls} "
    "calls, by turns, after one that compiles. Passes: of {per_pass} samples, until the standard error of a "
    "pixel and its neighbours is at most the tolerance, at most {most} samples; 'time over proportion' is "
    "the time over that of all passes without a tolerance, over the proportion of samples taken. Sobol' "
    "sequences, scrambled in each pixel. The reference is {origins}."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure what skipping and passes save, and draw where."""
    size = SIZES[quality]
    panels: list[Panel] = []
    measured, origins = {}, []
    for row, name in enumerate(size.names):
        scene = getattr(scenes, name)()
        exact = diffusion.reference(scene, size.side, size.reference, _rendered)
        bound = float(np.sqrt(np.mean(np.square(exact.error))))
        known = traced_images.Reference(exact.image, bound, exact.origin)
        origins.append(f"{exact.origin} ({name}, RMS error {bound:.1e})")
        moving = _moving(scene, size.side)
        whole = _skipped(scene, moving, size)
        progress((row + 0.5) / len(size.names))
        passes, counts = _passes(scene, size, known)
        measured[name] = {"skipping": whole, "passes": passes}
        panels += _panels(name, exact.image, moving, counts, measured[name], size)
        progress((row + 1) / len(size.names))
    title = f"What is not computed of ray-traced scenes, {size.side} x {size.side} pixels"
    figure = image_grid(title, panels, 3, max(384, 2 * size.side), below=480)
    _draw_times(add_axes(figure, 110, 80, 640, 340), measured)
    return figure, {
        "measured": measured
        | {
            "the image with skipping is that without, bit by bit": {
                name: found["skipping"]["largest difference of pixels"] == 0
                for name, found in measured.items()
            },
            "the RMS error of passes is that of all of them, and at most the tolerance beyond": {
                name: all(
                    of["rms error"] ** 2 < of["rms error of all passes"] ** 2 + float(tolerance) ** 2
                    for tolerance, of in found["passes"].items()
                )
                for name, found in measured.items()
            },
        },
        "note": NOTE.format(
            side=size.side,
            spp=size.spp,
            calls=size.calls,
            per_pass=size.per_pass,
            most=size.per_pass * size.passes,
            origins=", ".join(origins),
        ),
    }


def _moving(scene: scenes.Traced, side: int) -> NDArray[np.bool_]:
    """Return in which pixels time matters."""
    y, x = np.mgrid[:side, :side].astype(np.float32)
    low = np.stack([x / side, y / side, np.zeros_like(x)], axis=-1)
    high = np.stack([(x + 1) / side, (y + 1) / side, np.ones_like(x)], axis=-1)
    return np.asarray(jax.jit(scene.varies)(jnp.asarray(low), jnp.asarray(high)))[
        ..., scene.needs.index("time")
    ]


def _sampler(scene: Any, key: Any) -> samplers.Sampler:
    return samplers.independent(sequences.sobol(len(scene.needs)), key)


def _rendered(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    return np.asarray(qj.render(scene, sampler, side, side, spp), np.float64)


def _skipped(scene: Any, moving: NDArray[np.bool_], size: Size) -> dict[str, float]:
    """Return the times with and without skipping, by turns."""

    def skipping(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
        return np.asarray(qj.render_adaptive(scene, sampler, side, side, spp).image, np.float64)

    ways = {"without": _rendered, "with": skipping}
    seconds: dict[str, list[float]] = {way: [] for way in ways}
    difference = 0.0
    for key in range(size.calls + 1):
        images = {}
        for way, image in ways.items():
            start = time.perf_counter()
            images[way] = image(scene, _sampler(scene, key), size.side, size.spp)
            seconds[way].append(time.perf_counter() - start)
        difference = max(difference, float(abs(images["with"] - images["without"]).max()))
    least = {way: min(taken[1:]) for way, taken in seconds.items()}
    sampler = _sampler(scene, 0)
    return {
        "part of the pixels where time matters": float(moving.mean()),
        "part of all coordinates not needed": float((~moving).mean() / len(scene.needs)),
        "saving of samples": qj.render_adaptive(scene, sampler, size.side, size.side, size.spp).saving,
        "seconds without": least["without"],
        "seconds with": least["with"],
        "with / without": least["with"] / least["without"],
        "largest difference of pixels": difference,
    }


def _passes(
    scene: Any, size: Size, exact: traced_images.Reference
) -> tuple[dict[str, dict[str, float]], NDArray[np.uint32]]:
    """Return times and errors of passes by tolerance, and the counts of the last."""
    sampler = samplers.randomized(lambda key: _sampler(scene, key), KEY, size.per_pass)
    most = size.per_pass * size.passes

    def timed(tolerance: float) -> tuple[float, qj.AdaptiveImage]:
        start = time.perf_counter()
        result = qj.render_adaptive(scene, sampler, size.side, size.side, most, tolerance=tolerance)
        np.asarray(result.image)
        return time.perf_counter() - start, result

    never = 1e-9
    seconds: dict[float, float] = {}
    results = {}
    for _ in range(size.calls + 1):
        for tolerance in (never, *size.tolerances):
            taken, results[tolerance] = timed(tolerance)
            seconds[tolerance] = min(seconds.get(tolerance, np.inf), taken)
    table = {}
    for tolerance in size.tolerances:
        part = 1 - results[tolerance].saving
        table[f"{tolerance:g}"] = {
            "proportion taken": part,
            "seconds": seconds[tolerance],
            "seconds of all passes": seconds[never],
            "time over proportion": seconds[tolerance] / (part * seconds[never]),
            "rms error": traced_images.rms_error(np.asarray(results[tolerance].image, np.float64), exact),
            "rms error of all passes": traced_images.rms_error(
                np.asarray(results[never].image, np.float64), exact
            ),
        }
    return table, results[size.tolerances[-1]].counts


def _panels(
    name: str,
    image: NDArray,
    moving: NDArray[np.bool_],
    counts: NDArray[np.uint32],
    found: dict[str, dict],
    size: Size,
) -> list[Panel]:
    skipping, most = found["skipping"], float(size.per_pass * size.passes)
    return [
        Panel(f"{name.replace('_', ' ')}, reference", diffusion.shown(image)),
        Panel(
            f"black: time matters, {moving.mean():.0%} of the pixels\n"
            f"with skipping {skipping['with / without']:.2f} times as long",
            ~moving,
        ),
        Panel(
            f"passes to the tolerance {size.tolerances[-1]:g}:\nblack 0, white {most:g} samples per pixel",
            np.asarray(counts, np.float64),
            (0.0, most),
        ),
    ]


def _draw_times(axes: Axes, measured: dict[str, dict]) -> None:
    """Draw the part of the time over the part of the samples."""
    for marker, (name, found) in zip("os", measured.items(), strict=False):
        for k, (tolerance, row) in enumerate(found["passes"].items()):
            part, times = row["proportion taken"], row["seconds"] / row["seconds of all passes"]
            label = f"{name.replace('_', ' ')}, tolerance {tolerance}"
            axes.loglog(part, times, marker, color=f"C{k}", ms=6, label=label)
    ends = np.array([0.1, 1])
    axes.loglog(ends, ends, "k-", lw=0.8, label="in proportion")
    axes.set(xlabel="part of the samples taken", ylabel="part of the time", title="passes")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), frameon=False)

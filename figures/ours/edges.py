"""Derivatives of images across moving edges, by lines: pictures, an optimisation, and errors over time."""

from collections.abc import Callable
from dataclasses import field
from functools import partial
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from figures._rc import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION
from figures.ours import edges_by_mitsuba
from figures.ours.edge_scenes import PARALLEL, SCENES
from figures.plot import Style
from figures.shared import judged
from figures.shared.costs import timed
from figures.shared.rendered import diffusion, scene_images
from figures.shared.rendered.diffusion import shown
from figures.shared.sheets.image_sheets import Panel, add_axes, image_grid
from figures.shared.sheets.panels import curve, name_axes
from qmcjax.choosing import CANDIDATES
from qmcjax.core.pytrees import frozen_pytree

SIDE = 128
STEP = 0.02
"""Of finite differences of points, whose lights and balls have sizes of about 1."""
REPLICATES = 8
"""Of a reference."""


class Size(NamedTuple):
    """How much is measured."""

    shown: str
    """The scene of pictures."""
    scenes: tuple[str, ...]
    samplers: dict[str, str]
    keys: int
    lines: tuple[int, ...]
    """Per pixel."""
    points: tuple[int, ...]
    rivals: tuple[int, ...]
    """Samples of Mitsuba; none in drafts."""
    reference: int
    """Lines per pixel of each replicate."""
    drawn: int


BEST = "Hilbert, Owen-Sobol'"
LINES, POINTS, DIFFERENCES = "lines, Hilbert, Owen", "points", "points, differences"
MITSUBA = "Mitsuba, direct_projective"
SAMPLERS = {BEST: LINES, "random": "lines, independent"}
MORE = {"Z, hash": "lines, Z", "designed tiles": "lines, designed"}

SIZES = {
    "draft": Size("ball", ("ball",), SAMPLERS, 2, (1, 2), (4, 64), (), 2, 16),
    "paper": Size(
        "shadow",
        tuple(SCENES),
        SAMPLERS | MORE,
        16,
        (1, 2, 4),
        (4, 16, 64, 256),
        (1, 4, 16, 64),
        8,
        16,
    ),
}

WRONG = {
    "ball": {"position": -0.5, "radius": 0.5},
    "shadow": {"position": -0.35, "radius": 0.35, "light corner": 0.1},
}
"""Where the optimisation starts."""
STEPS, RATE = 60, 0.05

NOTE = (
    f"{SIDE} x {SIDE} pixels, of scenes of ours: derivatives with respect to the first parameter of each. "
    f"A sample of lines is {PARALLEL} parallel ones across a pixel that may have an edge, else a point. "
    "Errors are RMS over pixels and colours, less that of the reference, {keys} keys; times are medians of "
    "one image, or of one image and its derivative, without compilation. Lines have derivatives by forward "
    f"mode; differences are central ones of points common to both sides, by steps of {STEP:g}, "
    "which are most of their error where edges are sharp. Lines of "
    "other samplers than Hilbert + Owen differ in the sampler only. Mitsuba's direct_projective runs with "
    "llvm_ad_rgb, forward mode, and its own settings, but without samples of shadow edges where there are "
    "no shadows; with them it takes seconds for any number of samples, and only the largest is measured. NaN "
    "in its pixels counts as 0. References are means of {replicates} images of {reference} "
    "lines per pixel. Ratios at equal time are interpolated, at the longest time that both reach. The "
    f"optimisation is Adam on the mean squared difference to the target, rate {RATE:g} in {STEPS} steps of "
    "one line per pixel. With motion, mirrors, or surfaces that cut each other there is no rival: "
    "Mitsuba does not have these derivatives."
)

Errors = dict[str, tuple[NDArray, NDArray]]
"""By method: medians of seconds, by number of samples, and errors (counts, keys)."""


@frozen_pytree
class Moved:
    """A scene with its derivative along a direction of its parameters, as three more channels."""

    values: Any
    direction: Any
    name: str = field(metadata={"static": True})
    needs: tuple[str, ...] = field(metadata={"static": True})

    unrolled: ClassVar[int] = 1

    def __call__(self, point: Array) -> Array:
        """Return radiance and its derivative, shape (..., 6)."""

        def radiance(values: Array) -> Array:
            return SCENES[self.name].at(values).with_size(SIDE, SIDE)(point)

        return jnp.concatenate(jax.jvp(radiance, (self.values,), (self.direction,)), axis=-1)


def _image(scene: Any, sampler: str, spp: int, key: int) -> NDArray[np.float64]:
    made = CANDIDATES[sampler].make(len(scene.needs), SIDE, SIDE, spp, key)
    return scene_images.replicate(scene, made, SIDE, spp)


def _both(moved: Moved, sampler: str, spp: int, key: int) -> tuple[NDArray, NDArray]:
    """Return an image, and its derivative."""
    found = _image(moved, sampler, spp, key)
    return found[..., :3], found[..., 3:]


def _moved(name: str, values: Array, of: int = 0) -> Moved:
    """Return a scene with its derivative with respect to a parameter."""
    scene = SCENES[name]
    return Moved(values, jnp.zeros_like(values).at[of].set(1.0), name, scene.at(scene.start).needs)


def _differences(name: str) -> Callable[[str, int, int], NDArray[np.float64]]:
    """Return what makes derivatives with respect to the first parameter by differences of points."""
    scene = SCENES[name]
    more, less = (scene.at(scene.start.at[0].add(step), ()) for step in (STEP, -STEP))

    def difference(sampler: str, spp: int, key: int) -> NDArray[np.float64]:
        return (_image(more, sampler, spp, key) - _image(less, sampler, spp, key)) / (2 * STEP)

    return difference


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure errors and times of all scenes, and optimise one."""
    size = SIZES[quality]
    gradients: dict[str, Errors] = {}
    images: dict[str, Errors] = {}
    biased: dict[str, Any] = {}
    for done, name in enumerate(size.scenes):
        gradients[name], images[name], biased[name] = _errors(name, size)
        progress(0.8 * (done + 1) / len(size.scenes))
    found = _optimise(size.shown)
    against = {
        "gradient: lines / Mitsuba": _ratios(gradients, LINES, MITSUBA),
        "gradient: lines / differences of points": _ratios(gradients, LINES, DIFFERENCES),
        "image: lines / points": _ratios(images, LINES, POINTS),
    }
    numbers = {
        "measured": {
            "error at equal time": {
                what: {name: judged.ratio(np.exp(logs), 1) for name, logs in of.items()}
                | {"all": judged.ratio(np.exp(np.mean(list(of.values()), axis=0)), 1)}
                for what, of in against.items()
                if of
            },
            "RMS error of derivatives": _table(gradients),
            "RMS error of images": _table(images),
            "Mitsuba": biased,
            "optimisation": {
                "loss, first and last": [found.losses[0], found.losses[-1]],
                "largest error of a parameter": [found.errors[0], found.errors[-1]],
            },
        },
        "note": NOTE.format(keys=size.keys, replicates=REPLICATES, reference=size.reference),
    }
    return _draw(size, found, gradients[size.shown], images[size.shown]), numbers


def _errors(name: str, size: Size) -> tuple[Errors, Errors, dict[str, Any]]:
    """Return errors of derivatives and of images, and what was measured of Mitsuba's mean and NaN."""
    scene, keys = SCENES[name], size.keys
    moved, difference = _moved(name, scene.start), _differences(name)
    exact = [_both(moved, BEST, size.reference, 2**20 + k) for k in range(REPLICATES)]
    image, slope = (diffusion.of_replicates(list(of), "") for of in zip(*exact, strict=True))
    lines, still = scene.at(scene.start).with_size(SIDE, SIDE), scene.at(scene.start, ())
    gradients, images = {}, {}
    for sampler, label in size.samplers.items():
        gradients[label] = _measure(lambda *of: _both(moved, *of)[1], sampler, size.lines, keys, slope)
        images[label] = _measure(partial(_image, lines), sampler, size.lines, keys, image)
    gradients[DIFFERENCES] = _measure(difference, BEST, size.points, keys, slope)
    images[POINTS] = _measure(partial(_image, still), BEST, size.points, keys, image)
    if not size.rivals or name in edges_by_mitsuba.LACKS or not edges_by_mitsuba.runs():
        return gradients, images, {}
    found, seconds = edges_by_mitsuba.derivatives(name, SIDE, size.rivals, keys)
    broken, found = np.isnan(found).any(axis=(2, 3, 4)).mean(), np.nan_to_num(found)
    errors = np.array([[diffusion.rms_error(one, slope) for one in of] for of in found])
    gradients[MITSUBA] = np.median(seconds, axis=1), errors
    means, of_lines = judged.interval(found[-1].mean(axis=(1, 2, 3))), float(slope.image.mean())
    return gradients, images, {"images with NaN": float(broken), "mean": means, "of lines": of_lines}


def _measure(
    call: Callable[..., NDArray], sampler: str, counts: tuple[int, ...], keys: int, exact: diffusion.Reference
) -> tuple[NDArray, NDArray]:
    seconds, errors = [], []
    for spp in counts:
        call(sampler, spp, 0)  # It compiles.
        made = [timed(call, sampler, spp, key) for key in range(1, keys + 1)]
        errors.append([diffusion.rms_error(image, exact) for image, _ in made])
        seconds.append(np.median([taken.clock for _, taken in made]))
    return np.array(seconds), np.array(errors)


def _ratios(errors: dict[str, Errors], one: str, other: str) -> dict[str, NDArray]:
    """Return logarithms of ratios of errors at equal time, of keys, by scene."""
    found = {}
    for name, of in errors.items():
        curves = [tuple(map(np.log, of[method])) for method in (one, other) if method in of]
        at = min(times.max() for times, _ in curves)
        if len(curves) == 2 and at >= max(times.min() for times, _ in curves):
            mine, theirs = (np.array([np.interp(at, times, key) for key in of.T]) for times, of in curves)
            found[name] = mine - theirs
    return found


def _table(errors: dict[str, Errors]) -> dict[str, Any]:
    return {
        name: {
            method: [{"seconds": t} | judged.interval(keys) for t, keys in zip(*measured, strict=True)]
            for method, measured in of.items()
        }
        for name, of in errors.items()
    }


class Found(NamedTuple):
    """An optimisation: losses and the largest errors of parameters by step, and pictures."""

    losses: list[float]
    errors: list[float]
    pictures: list[NDArray]
    """At the start, the end, and the target."""


def _optimise(name: str) -> Found:
    """Return what Adam makes of the wrong parameters."""
    scene, wrong = SCENES[name], WRONG[name]
    moved = [list(scene.parameters).index(parameter) for parameter in wrong]
    wanted = np.asarray(scene.start, np.float64)
    values = wanted.copy()
    values[moved] = list(wrong.values())
    target, _ = _both(_moved(name, scene.start), BEST, 4, 1)
    first, second = np.zeros(len(moved)), np.zeros(len(moved))
    losses, errors, pictures = [], [], []
    for step in range(STEPS + 1):
        here = jnp.asarray(values, jnp.float32)
        sides = [_both(_moved(name, here, j), BEST, 1, 2 + step) for j in moved]
        off = sides[0][0] - target
        losses.append(float(np.mean(off**2)))
        errors.append(float(abs(values - wanted).max()))
        if step in (0, STEPS):
            pictures.append(sides[0][0])
        gradient = np.array([2 * np.mean(off * slope) for _, slope in sides])
        first, second = 0.9 * first + 0.1 * gradient, 0.99 * second + 0.01 * gradient**2
        corrected = first / (1 - 0.9 ** (step + 1)), second / (1 - 0.99 ** (step + 1))
        values[moved] -= RATE * (1 - step / STEPS) * corrected[0] / (np.sqrt(corrected[1]) + 1e-8)
    return Found(losses, errors, [*pictures, target])


STYLES = {
    LINES: Style(BLUE, "o"),
    SAMPLERS["random"]: Style(ORANGE, "s"),
    MORE["Z, hash"]: Style(SKY, "v"),
    MORE["designed tiles"]: Style(PURPLE, "D"),
    DIFFERENCES: Style(VERMILLION, "^"),
    POINTS: Style(VERMILLION, "^"),
    MITSUBA: Style(GREEN, "P"),
}


def _draw(size: Size, found: Found, gradients: Errors, images: Errors) -> Figure:
    name = size.shown
    scene = SCENES[name]
    image, slope = _both(_moved(name, scene.start), BEST, size.drawn, 1)
    differences = _differences(name)(BEST, 4 * size.drawn, 1)
    most = float(np.quantile(abs(slope), 0.995))

    def signed(caption: str, of: NDArray) -> Panel:
        return Panel(caption, of.mean(axis=2), (-most, most))

    start, end, target = found.pictures
    panels = [
        Panel(f"{name}, by lines", shown(image)),
        signed("its derivative by lines", slope),
        signed("by differences of points", differences),
        Panel("optimisation: start", shown(start)),
        Panel(f"after {STEPS} steps", shown(end)),
        Panel("target", shown(target)),
    ]
    below = 1230
    figure = image_grid(
        "Lines see edges: their derivatives lead from a wrong pose to the target\n"
        f"derivatives with respect to {next(iter(scene.parameters))}: grey is 0; errors of '{name}'",
        panels,
        3,
        below,
    )
    width = round(figure.get_size_inches()[0] * 300) // 2
    upper = [add_axes(figure, k * width + 230, 790, width - 290, 350) for k in range(2)]
    for axes, values, y, color in (
        (upper[0], found.losses, "mean squared difference", BLACK),
        (upper[1], found.errors, "largest error of a parameter", GREY),
    ):
        axes.plot(range(len(values)), values, color=color, lw=1.2)
        name_axes(axes, "step", y, log="y")
    lower = [add_axes(figure, k * width + 230, 290, width - 290, 350) for k in range(2)]
    for axes, of, y in ((lower[0], gradients, "derivative"), (lower[1], images, "image")):
        for method, (seconds, errors) in of.items():
            means = dict(zip(seconds, errors.mean(axis=1), strict=True))
            curve(axes, means, STYLES[method], label=method)
        name_axes(axes, "seconds", f"RMS error, {y}", log="xy", few_decades=True)
        axes.xaxis.set_minor_formatter(NullFormatter())
    labels = {
        name: handle for axes in lower for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    down = figure.get_size_inches()[1] * 300
    figure.legend(
        list(labels.values()), list(labels), loc="lower center", frameon=False, ncols=4,
        bbox_to_anchor=(0.5, 20 / down),
    )  # fmt: skip
    return figure

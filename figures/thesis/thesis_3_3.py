"""Thesis Fig. 3.3 and 3.4: the recursion over the shutter, and blending against prediction."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures._errors import rms
from figures._rc import BLUE, GREY, VERMILLION
from figures.shared.rendered import predicted_scene
from figures.shared.rendered.diffusion import shown
from figures.shared.sheets.image_sheets import DPI, Panel, add_axes, image_grid
from qmcjax import tracing


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spp: int
    """Of what is sampled."""
    exact: int
    """Samples a pixel of what stands for the truth."""


SIZES = {"draft": Size(32, 16, 32), "paper": Size(96, 64, 1024)}
LEVELS = 3
CHECKS = 4
CONTRAST = 0.1

NOTE = (
    "The scene is ours: a box that slides and turns by 69 degrees above a checkerboard, its shadow and its "
    "reflection in a still sphere, {side} x {side} pixels, 9 intervals of the shutter. The first and the "
    "last image have {spp} random samples per pixel, the truth of an interval {exact} Owen-scrambled "
    "ones. The "
    "blend is the mean of the first and last image; the prediction has no sample of the middle. Errors are "
    "RMS over all pixels, and over those of the box in the middle of the shutter: what is missing in the "
    "prediction is mostly the shadow and the reflection. Corrected, {checks} samples of each pixel check it "
    "at a contrast of {contrast}, and where that fails there are {spp}. Pixels that failed are counted by "
    "level with as many checks at each."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the middle of the shutter by blending and prediction, and the recursion."""
    size = SIZES[quality]
    count = 2**LEVELS + 1
    scene = predicted_scene.scene()

    def found(checks: int) -> tracing.PredictorCorrector:
        return tracing.predictor_corrector(
            scene, size.side, size.side, (checks,) * LEVELS, size.spp, 1, contrast=CONTRAST
        )

    raw, corrected = found(0), found(CHECKS)
    progress(0.3)
    truth = []
    for which in range(count):
        truth.append(predicted_scene.sampled(size.side, size.exact, quality, count, which))
        progress(0.3 + 0.7 * (which + 1) / count)
    middle = count // 2
    images = {
        "linear blend": 0.5 * (raw.images[0] + raw.images[-1]),
        "prediction": raw.images[middle],
        "corrected": corrected.images[middle],
    }
    errors = {name: rms(image - truth[middle]) for name, image in images.items()}
    box = (predicted_scene.seen(size.side, 0.5).number == predicted_scene.BOX).reshape(size.side, size.side)
    of_box = {name: rms(image[box] - truth[middle][box]) for name, image in images.items()}
    blended, predicted, _ = of_box.values()
    apart = {
        str(2**level): float(np.mean([rms(a - b) for a, b in zip(truth, truth[2**level :], strict=False)]))
        for level in range(LEVELS, -1, -1)
    }
    full = corrected.samples == size.spp
    failed = {
        str(level): float(np.mean([full[step.middle] for step in corrected.steps if step.level == level]))
        for level in range(1, LEVELS + 1)
    }
    visited = sorted([0, count - 1, *(step.middle for step in raw.steps)])
    measured = {
        "rms error at the middle": errors,
        "rms error at the middle, box": of_box,
        "rms difference of images by intervals apart": apart,
        "part of pixels that failed by level": failed,
        "samples of each pixel and interval, mean": float(corrected.samples.mean()),
    }
    claims: dict[str, Any] = {
        "the recursion visits each interval once": visited == list(range(count)),
        "blending is a poor approximation: at least twice the error of the prediction, of what moves": (
            blended > 2 * predicted
        ),
        "images are more similar the nearer they are": all(b < a for a, b in pairwise(apart.values())),
        "the prediction gets better on lower levels: fewer pixels fail": all(
            b < a for a, b in pairwise(failed.values())
        ),
    }
    note = NOTE.format(side=size.side, spp=size.spp, exact=size.exact, checks=CHECKS, contrast=CONTRAST)
    panels = [
        Panel("first interval", shown(raw.images[0])),
        Panel("middle interval, truth", shown(truth[middle])),
        Panel("last interval", shown(raw.images[-1])),
    ]
    for name, image in images.items():
        caption = f"middle, {name}\nRMS error {errors[name]:.3f}, on the box {of_box[name]:.3f}"
        panels.append(Panel(caption, shown(image)))
    title = (
        "A prediction of the middle of the shutter (thesis, Fig. 3.3 and 3.4)\n"
        f"our scene, {size.side} x {size.side} pixels, {size.spp} samples per pixel"
    )
    figure = image_grid(title, panels, 3, 288, below=330)
    width = figure.get_size_inches()[0] * DPI
    _recursion(add_axes(figure, 90, 30, width - 110, 260), raw.steps, count)
    return figure, {"measured": measured, "claims": claims, "note": note}


def _recursion(axes: Axes, steps: tuple[tracing.Step, ...], count: int) -> None:
    """Draw which intervals each is predicted from, by level."""
    levels = {0: 0, count - 1: 0} | {step.middle: step.level for step in steps}
    for step in steps:
        for parent, color in ((step.left, BLUE), (step.right, VERMILLION)):
            arrow = {"arrowstyle": "-|>", "color": color, "lw": 1.0, "shrinkA": 9, "shrinkB": 9}
            axes.annotate("", (step.middle, -step.level), (parent, -levels[parent]), arrowprops=arrow)
    for number, level in levels.items():
        axes.plot([number, number], [-level, -LEVELS - 0.65], color=GREY, lw=0.6, ls=":", zorder=0)
        circle = {"boxstyle": "circle,pad=0.25", "fc": "white", "ec": "0.3"}
        axes.text(number, -level, f"$i_{number}$", ha="center", va="center", fontsize=9, bbox=circle)
    axes.set(xlim=(-0.6, count - 0.4), ylim=(-LEVELS - 0.7, 0.5), yticks=-np.arange(LEVELS + 1))
    axes.set_yticklabels(["sampled", *(f"level {level}" for level in range(1, LEVELS + 1))])
    axes.set_xticks([])
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.tick_params(length=0)
    axes.set_title("how the 9 intervals are predicted from one another")

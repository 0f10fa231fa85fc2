"""Images predicted from others: recursion, blending, moving triangles, corrections (Fig. 3.3 to 3.7)."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import ndimage

from figures._errors import rms
from figures._rc import BLUE, GREY, VERMILLION
from figures.shared.rendered import scene_images
from figures.shared.rendered.diffusion import shown
from figures.shared.sheets.image_sheets import DPI, Panel, add_axes, image_grid
from figures.thesis.chapter_3.predicted_images import (
    ROWS,
    Step,
    predict,
    project,
    triangles_between,
    what_is_hit,
)
from qmcjax import samplers, sequences, tracing
from qmcjax.tracing import motion

FLOOR, BOX, MIRROR = 0, 1, 2
"""Numbers of primitives; the walls are 3."""


def moved_camera(aside: float, upward: float) -> tracing.Camera:
    """Return the camera, moved there and back; one that stands still has the same program."""
    path = motion.linear_segments([0, 0.5, 1], [[0, 0, 0], [aside, upward, 0], [0, 0, 0]])
    return tracing.camera([0.0, 2.2, 4.6], [0.0, 0.45, 0.0], fov=36.0, motion=motion.affine(None, path))


CAMERA, SHAKEN = moved_camera(0.0, 0.0), moved_camera(0.3, 0.1)


def path() -> motion.Affine:
    """Return the motion of the box: on a straight line, and by 69 degrees."""
    up = jnp.array([0.0, 1.0, 0.0])
    keys = jnp.stack([motion.quaternion(up, angle) for angle in (-0.4, 0.8)])
    turn = motion.rotation_spline(jnp.array([0.0, 1.0]), keys)
    return motion.affine(turn, motion.linear_segments([0, 1], [[-0.9, 0.35, 0.5], [0.7, 0.35, 0.2]]))


def sliding_box(camera: tracing.Camera = CAMERA) -> tracing.DirectLight:
    """Return the scene, lit by a point light."""
    floor = tracing.rectangle(
        [-4, 0, -4], [8, 0, 0], [0, 0, 8], material=tracing.diffuse(tracing.checker(0.7, 0.35, scale=12))
    )
    box = tracing.box(
        [-0.4, 0.0, -0.3],
        [0.4, 0.5, 0.3],
        motion=path(),
        material=tracing.diffuse(tracing.checker([0.8, 0.25, 0.15], [0.9, 0.8, 0.5], scale=3)),
    )
    mirror = tracing.sphere([0.75, 0.6, -0.9], 0.6, material=tracing.mirror(0.9))
    walls = tracing.box([-5, -0.1, -2.5], [5, 6, 8], material=tracing.diffuse(0.6))
    light = tracing.point_light([-1.5, 4.0, 2.0], 60.0)
    return tracing.direct_light(tracing.world([floor, box, mirror, walls], [light]), camera, mirrors=1)


class Seen(NamedTuple):
    """What is in the middles of pixels, row by row."""

    number: NDArray[np.int32]
    """(n,): of primitives."""
    inside: NDArray[np.float32]
    """(n, 3): the point in object space."""


def first_hits(side: int, time: float, camera: tracing.Camera = CAMERA) -> Seen:
    """Return what the middles of side x side pixels see."""
    of, middles = sliding_box(camera), (np.arange(side) + 0.5) / side
    y, x = np.meshgrid(middles, middles, indexing="ij")
    given = {"x": x.ravel(), "y": y.ravel(), "time": np.full(side**2, time)}
    points = np.stack([given.get(name, np.zeros(side**2)) for name in of.needs], axis=-1)
    # One program for small images, too.
    wide = np.resize(points, (max(side**2, ROWS), len(of.needs)))
    _, inside, _, number = what_is_hit(of, jnp.asarray(wide, jnp.float32))
    return Seen(np.asarray(number)[: side**2], np.asarray(inside)[: side**2])


def render_interval(
    side: int,
    spp: int,
    quality: str,
    intervals: int = 1,
    which: int = 0,
    camera: tracing.Camera = CAMERA,
) -> NDArray[np.float64]:
    """Return the image of one of the intervals of the shutter by Owen-scrambled samples in each pixel."""
    shutter = np.array([which, which + 1]) / intervals
    of = sliding_box(replace(camera, shutter=shutter))
    sampler = samplers.independent(sequences.sobol(len(of.needs)), 1)
    return scene_images.render_image(of, sampler, side, spp, quality)


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spp: int
    """Of what is sampled."""
    exact: int
    """Samples a pixel of what stands for the truth."""


SIZES_3_3 = {"draft": Size(128, 8, 16), "paper": Size(128, 64, 512)}
APART_3_3 = {"draft": 32, "paper": 128}
"""Side of the images of all intervals that are compared with each other."""
LEVELS = 3
CHECKS = 4
CONTRAST = 0.1

NOTE_3_3 = (
    "The scene is ours: a box that slides and turns by 69 degrees above a checkerboard, its shadow and "
    "its reflection in a still sphere, {side} x {side} pixels, 9 intervals of the shutter. The first "
    "and the last image have {spp} random samples per pixel, the truth of an interval {exact} "
    "Owen-scrambled ones; the images of different intervals are compared on {apart} x {apart} pixels. The "
    "blend is the mean of the first and last image; the prediction has no sample of the middle. Errors are "
    "RMS over all pixels, and over those of the box in the middle of the shutter; the prediction mostly "
    "lacks the shadow and the reflection. 'Corrected': {checks} samples per pixel check the prediction at a "
    "contrast of {contrast}; where the check fails, the "
    "pixel gets {spp}. Failed pixels are counted by level, with as many checks on each."
)


def thesis_3_3(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the middle of the shutter by blending and prediction, and the recursion."""
    size = SIZES_3_3[quality]
    count = 2**LEVELS + 1
    scene = sliding_box()

    raw = predict(scene, size.side, (0,) * LEVELS, size.spp, 1, CONTRAST)
    corrected = predict(scene, size.side, (CHECKS,) * LEVELS, size.spp, 1, CONTRAST)
    progress(0.3)
    truth = []
    for which in range(count):
        truth.append(render_interval(APART_3_3[quality], size.exact, quality, count, which))
        progress(0.3 + 0.7 * (which + 1) / count)
    middle = count // 2
    exact = truth[middle]
    if len(exact) < size.side:
        exact = render_interval(size.side, size.exact, quality, count, middle)
    images = {
        "linear blend": 0.5 * (raw.images[0] + raw.images[-1]),
        "prediction": raw.images[middle],
        "corrected": corrected.images[middle],
    }
    errors = {name: rms(image - exact) for name, image in images.items()}
    box = (first_hits(size.side, 0.5).number == BOX).reshape(size.side, size.side)
    of_box = {name: rms(image[box] - exact[box]) for name, image in images.items()}
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
    given = size._asdict() | {"apart": APART_3_3[quality], "checks": CHECKS, "contrast": CONTRAST}
    note = NOTE_3_3.format(**given)
    panels = [
        Panel("first interval", shown(raw.images[0])),
        Panel("middle interval, truth", shown(exact)),
        Panel("last interval", shown(raw.images[-1])),
    ]
    for name, image in images.items():
        caption = f"middle, {name}\nRMS error {errors[name]:.3f}, on the box {of_box[name]:.3f}"
        panels.append(Panel(caption, shown(image)))
    title = (
        "Prediction has less than half the error of blending where things move\n"
        "thesis, Fig. 3.3 and 3.4; a box slides and turns; the middle of the shutter is predicted\n"
        f"{size.side} x {size.side} pixels, {size.spp} samples per pixel in the first and last interval"
    )
    figure = image_grid(title, panels, 3, 560)
    width = figure.get_size_inches()[0] * DPI
    _recursion(add_axes(figure, 140, 30, width - 180, 440), raw.steps, count)
    return figure, {"measured": measured, "claims": claims, "note": note}


def _recursion(axes: Axes, steps: tuple[Step, ...], count: int) -> None:
    """Draw which intervals each is predicted from, by level."""
    levels = {0: 0, count - 1: 0} | {step.middle: step.level for step in steps}
    for step in steps:
        for parent, color in ((step.left, BLUE), (step.right, VERMILLION)):
            arrow = {"arrowstyle": "-|>", "color": color, "lw": 1.0, "shrinkA": 9, "shrinkB": 9}
            axes.annotate("", (step.middle, -step.level), (parent, -levels[parent]), arrowprops=arrow)
    for number, level in levels.items():
        axes.plot([number, number], [-level, -LEVELS - 0.65], color=GREY, lw=0.6, ls=":", zorder=0)
        circle = {"boxstyle": "circle,pad=0.25", "fc": "white", "ec": "0.3"}
        axes.text(number, -level, f"$i_{number}$", ha="center", va="center", bbox=circle)
    axes.set(xlim=(-0.6, count - 0.4), ylim=(-LEVELS - 0.7, 0.5), yticks=-np.arange(LEVELS + 1))
    axes.set_yticklabels([f"{level}" for level in range(LEVELS + 1)])
    axes.set_ylabel("level")
    axes.set_xticks([])
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.tick_params(length=0)
    axes.set_title("Intervals of level 0 are sampled, the others predicted from two of the levels above")


SIZES_3_6 = {"draft": Size(128, 16, 16), "paper": Size(128, 64, 1024)}
MESH = 16
"""Pixels a side of the image whose triangles are drawn."""

NOTE_3_6 = (
    "The scene is that of Fig. 3.3, but the camera is shaken, there and back; three intervals of the "
    f"shutter, {{side}} x {{side}} pixels. The triangles are those of {MESH} x {MESH} pixels; where they "
    "stretch from the box to the background, the prediction is a guess. Areas that enter the image are "
    f"in no triangle: {{holes}} pixels, which get {{spp}} samples. If the camera moved on a straight "
    f"line, one of the two predictions would cover the border. {CHECKS} samples of each pixel check the "
    f"prediction at a contrast of {CONTRAST}; the error of predicted pixels, RMS, is {{failed:.3f}} "
    f"where that fails and {{kept:.3f}} elsewhere. A test compares the choice by parity."
)


def thesis_3_6(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a prediction with what it misses, the triangles it is made of, and the parity of pixels."""
    size = SIZES_3_6[quality]
    side = size.side

    scene = sliding_box(SHAKEN)
    raw = predict(scene, side, (0,), size.spp, 1, CONTRAST)
    checked = predict(scene, side, (CHECKS,), size.spp, 1, CONTRAST)
    progress(0.5)
    truth = render_interval(side, size.exact, quality, 3, 1, SHAKEN)
    holes = raw.samples[1] > 0
    parts: Any = ndimage.label(holes, np.ones((3, 3)))
    labels, count = parts
    border = np.ones_like(holes)
    border[3:-3, 3:-3] = False
    touching = set(np.unique(labels[border & holes]))
    bad = (checked.samples[1] == size.spp) & ~holes
    failed, kept = (rms(raw.images[1][which] - truth[which]) for which in (bad, ~bad & ~holes))
    measured = {
        "pixels that nothing is drawn in": int(holes.sum()),
        "part of pixels that failed": float(bad.mean()),
        "rms error of predictions": {"failed": failed, "kept": kept},
    }
    claims = {
        "what no triangle covers is at borders of the image": bool(holes.any())
        and touching == set(range(1, count + 1)),
        "the contrast criterion finds where predictions fail: three times the error of the others": (
            failed > 3 * kept
        ),
    }
    note = NOTE_3_6.format(side=side, holes=int(holes.sum()), spp=size.spp, failed=failed, kept=kept)
    off = abs(raw.images[1] - truth).max(axis=-1)
    marked = np.where(holes[..., None], [1.0, 0.0, 1.0], shown(raw.images[1]))
    panels = [
        Panel("predicted middle; magenta:\nno triangle is drawn there", marked),
        Panel("error of the prediction\n(white: 0.3)", np.where(holes, 0, off), (0.0, 0.3)),
        Panel("white: the check fails;\ngrey: there was no prediction", bad + 0.5 * holes),
    ]
    title = (
        "Checking the contrast finds the pixels whose prediction fails\n"
        "thesis, Fig. 3.6 and 3.7; pixels are moving triangles"
    )
    figure = image_grid(title, panels, 3, 740)
    places = [panel.get_position().bounds for panel in figure.axes]
    wide, high = figure.get_size_inches() * DPI
    left, middle, right = ([wide * x, 30, wide * w, high * h] for x, _, w, h in places)
    for place, time in ((left, 1 / 6), (middle, 1 / 2)):
        axes = add_axes(figure, *place)
        _mesh(axes, raw.images[0], time)
        axes.set_title("pixels of the first interval" if time < 0.5 else "moved to the middle")
    _parity(add_axes(figure, right[0] + 90, 130, right[2] - 120, right[3] - 120))
    progress(1.0)
    return figure, {"measured": measured, "claims": claims, "note": note}


def _mesh(axes: Axes, image: NDArray, time: float) -> None:
    """Draw the triangles between pixels of an image of the time 1/6, moved to another one."""
    number, inside = first_hits(MESH, 1 / 6, SHAKEN)
    turn, to = (np.asarray(a) for a in _placed(jnp.float32(time)))
    point = jnp.asarray(np.where((number == BOX)[:, None], inside @ turn.T + to, inside))
    u, v, depth = (np.asarray(a) for a in _project(point, jnp.full_like(point[:, 0], time)))
    block = len(image) // MESH
    colors = shown(image.reshape(MESH, block, MESH, block, 3).mean(axis=(1, 3))).reshape(-1, 3)
    triangles = triangles_between(MESH, MESH)
    order = np.argsort(-depth[triangles].mean(axis=1))
    triangles = triangles[order]
    corners = np.stack([u[triangles], 1 - v[triangles]], axis=-1)
    faces = colors[triangles].mean(axis=1)
    axes.add_collection(PolyCollection(list(corners), facecolors=faces, edgecolors="0.5", linewidths=0.3))
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
    axes.set_axis_off()


@jax.jit
def _placed(time: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the linear part and the translation of the box."""
    return path()(time)


@jax.jit
def _project(point: jax.Array, time: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    return project(SHAKEN, (point[:, 0], point[:, 1], point[:, 2]), jnp.ones_like(time), time)


def _parity(axes: Axes) -> None:
    """Draw which of the two predictions gives what is not averaged."""
    y, x = np.mgrid[:6, :6]
    second = (x ^ y) & 1
    axes.imshow(np.where(second, 0.75, 0.95), cmap="gray", vmin=0, vmax=1)
    for row, column in zip(y.ravel(), x.ravel(), strict=True):
        axes.text(column, row, str(second[row, column]), ha="center", va="center")
    axes.set(xticks=range(6), yticks=range(6), xlabel="x")
    axes.set_ylabel("y", labelpad=1)
    axes.set_title("not averaged: 0 is from the\nfirst interval, 1 from the last")

"""Thesis Fig. 3.6 and 3.7: pixels as triangles that move, the choice by parity, and what is not predicted."""

from collections.abc import Callable
from dataclasses import replace
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
from figures.shared.rendered import predicted_scene
from figures.shared.rendered.diffusion import shown
from figures.shared.rendered.predicted_scene import CAMERA
from figures.shared.sheets.image_sheets import DPI, Panel, add_axes, image_grid
from qmcjax import tracing
from qmcjax.tracing import motion


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spp: int
    exact: int


SIZES = {"draft": Size(48, 16, 32), "paper": Size(96, 64, 1024)}
SHAKEN = replace(
    CAMERA,
    motion=motion.affine(None, motion.linear_segments([0, 0.5, 1], [[0, 0, 0], [0.3, 0.1, 0], [0, 0, 0]])),
)
CHECKS = 4
CONTRAST = 0.1
MESH = 24
"""Pixels a side of the image whose triangles are drawn."""

NOTE = (
    "The scene is that of Fig. 3.3, but the camera is shaken, there and back; three intervals of the "
    f"shutter, {{side}} x {{side}} pixels. The triangles are those of {MESH} x {MESH} pixels; where they "
    "stretch, from the box to what is behind, the prediction is a guess. What comes into the image from "
    "beside is in no triangle: {holes} pixels, which get {spp} samples. Of a camera on a straight line, one "
    f"of the two predictions covers the border. {CHECKS} samples of each pixel check the prediction at a "
    f"contrast of {CONTRAST}; the error of predicted pixels, RMS, is {{failed:.3f}} where that fails and "
    "{kept:.3f} elsewhere. The choice by parity is that of the code, which a test compares."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a prediction with what it misses, the triangles it is made of, and the parity of pixels."""
    size = SIZES[quality]
    side = size.side

    def found(scene: Any, checks: int) -> tracing.PredictorCorrector:
        return tracing.predictor_corrector(scene, side, side, (checks,), size.spp, 1, contrast=CONTRAST)

    scene = predicted_scene.scene(SHAKEN)
    raw, checked = found(scene, 0), found(scene, CHECKS)
    progress(0.5)
    truth = predicted_scene.sampled(side, size.exact, quality, 3, 1, SHAKEN)
    holes = raw.samples[1] > 0
    parts: Any = ndimage.label(holes)
    labels, count = parts
    border = np.ones_like(holes)
    border[1:-1, 1:-1] = False
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
    note = NOTE.format(side=side, holes=int(holes.sum()), spp=size.spp, failed=failed, kept=kept)
    marked = np.where(holes[..., None], [1.0, 0.0, 1.0], shown(raw.images[1]))
    panels = [
        Panel("first interval", shown(raw.images[0])),
        Panel("predicted middle; magenta:\nno triangle is drawn there", marked),
        Panel("white: the prediction failed,\ngrey: there was none", bad + 0.5 * holes),
    ]
    title = "Pixels as moving triangles, and what is corrected (thesis, Fig. 3.6 and 3.7)"
    figure = image_grid(title, panels, 3, 288, below=380)
    width = figure.get_size_inches()[0] * DPI
    wide = (width - 60) / 3
    for place, time in enumerate((1 / 6, 1 / 2)):
        axes = add_axes(figure, 15 + place * (wide + 15), 35, wide, wide)
        _mesh(axes, raw.images[0], time)
        axes.set_title("pixels of the first interval" if place == 0 else "moved to the middle")
    _parity(add_axes(figure, 55 + 2 * (wide + 15), 70, wide - 60, wide - 60))
    progress(1.0)
    return figure, {"measured": measured, "claims": claims, "note": note}


def _mesh(axes: Axes, image: NDArray, time: float) -> None:
    """Draw the triangles between pixels of an image of the time 1/6, moved to another one."""
    start = np.float32(1 / 6)
    number, point = predicted_scene.seen(MESH, float(start), SHAKEN)
    (before, at), (after, to) = (
        tuple(np.asarray(a) for a in predicted_scene.path()(jnp.float32(t))) for t in (start, time)
    )
    moved = (point - at) @ np.linalg.inv(before).T @ after.T + to
    point = jnp.asarray(np.where((number == predicted_scene.BOX)[:, None], moved, point))
    u, v, depth = (np.asarray(a) for a in _projected(point, jnp.full_like(point[:, 0], time)))
    block = len(image) // MESH
    colors = shown(image.reshape(MESH, block, MESH, block, 3).mean(axis=(1, 3))).reshape(-1, 3)
    pixel = np.arange(MESH * MESH).reshape(MESH, MESH)
    a, b, c, d = pixel[:-1, :-1], pixel[:-1, 1:], pixel[1:, :-1], pixel[1:, 1:]
    triangles = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, c, b), (d, b, c))])
    order = np.argsort(-depth[triangles].mean(axis=1))
    triangles = triangles[order]
    corners = np.stack([u[triangles], 1 - v[triangles]], axis=-1)
    faces = colors[triangles].mean(axis=1)
    axes.add_collection(PolyCollection(list(corners), facecolors=faces, edgecolors="0.5", linewidths=0.3))
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
    axes.set_axis_off()


@jax.jit
def _projected(point: jax.Array, time: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    return SHAKEN.projected((point[:, 0], point[:, 1], point[:, 2]), jnp.ones_like(time), time)


def _parity(axes: Axes) -> None:
    """Draw which of the two predictions gives what is not averaged."""
    y, x = np.mgrid[:6, :6]
    second = (x ^ y) & 1
    axes.imshow(np.where(second, 0.75, 0.95), cmap="gray", vmin=0, vmax=1)
    for row, column in zip(y.ravel(), x.ravel(), strict=True):
        axes.text(column, row, str(second[row, column]), ha="center", va="center")
    axes.set(xticks=range(6), yticks=range(6), xlabel="x")
    axes.set_ylabel("y", labelpad=1)
    axes.set_title("0: from the first prediction,\n1: from the second")

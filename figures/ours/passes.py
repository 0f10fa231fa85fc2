"""Passes in each pixel until its error is small: how many each takes, with bias and without."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from matplotlib.figure import Figure

import qmcjax as qj
from figures._errors import rms
from figures.shared.image_grid import Panel, image_grid
from qmcjax import orders, samplers, scenes, sequences


class Size(NamedTuple):
    """How much is measured."""

    side: int
    passes: int
    keys: int


SIZES = {"draft": Size(64, 16, 1), "paper": Size(256, 64, 8)}
PER_PASS = 16
TOLERANCE = 0.01
SCENES = {"zone plate": scenes.zone_plate(1000.0), "ball": scenes.ball()}

NOTE = (
    "{side} x {side} pixels, passes of {per_pass} Owen-scrambled Sobol' samples along the Hilbert curve, "
    "until the standard error of a pixel and its neighbours is at most {tolerance}, at most {limit} samples. "
    "'mean error' is that of the whole image, with its standard error over {keys} keys: it should be no more "
    "than noise where the way is unbiased."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render with both ways, and draw images and numbers of passes."""
    size = SIZES[quality]
    passes: dict[str, dict[str, dict[str, float]]] = {}
    images, counts = [], []
    for done, (name, scene) in enumerate(SCENES.items(), start=1):
        passes[name] = {}
        for unbiased in (False, True):
            way = "unbiased" if unbiased else "biased"
            result, passes[name][way] = found = _until(scene, size, unbiased)
            of = found[1]
            images.append(
                Panel(
                    f"{name}, {way}\nRMS error {of['rms error']:.2g}, mean error {of['mean error']:.1e}",
                    np.asarray(result.image),
                    (0.0, float(np.max(result.image))),
                )
            )
            spent = np.asarray(result.counts) / PER_PASS
            caption = f"passes, black 0, white {size.passes}\nsaving {of['saving']:.1%} of the samples"
            counts.append(Panel(caption, spent, (0.0, float(size.passes))))
        progress(done / len(SCENES))
    title = (
        f"Passes of {PER_PASS} samples in each pixel until its standard error is {TOLERANCE}, "
        f"at most {size.passes}: {size.side} x {size.side} pixels"
    )
    return image_grid(title, images + counts, len(images), max(384, 2 * size.side)), {
        "measured": {"passes": passes},
        "note": NOTE.format(
            side=size.side,
            per_pass=PER_PASS,
            tolerance=TOLERANCE,
            limit=PER_PASS * size.passes,
            keys=size.keys,
        ),
    }


def _until(scene: Any, size: Size, unbiased: bool) -> tuple[Any, dict[str, float]]:
    """Return an image made of passes, and errors over several keys."""
    dims = len(scene.needs)
    exact = scene.reference(size.side, size.side)[0]
    order = orders.hilbert(size.side, size.side)

    def one_pass(key: jax.Array) -> samplers.Sampler:
        return samplers.contiguous(order, sequences.owen(sequences.sobol(dims), key), PER_PASS)

    results = [
        qj.render_adaptive(
            scene,
            samplers.randomized(one_pass, key, PER_PASS),
            size.side,
            size.side,
            PER_PASS * size.passes,
            tolerance=TOLERANCE,
            unbiased=unbiased,
        )
        for key in range(size.keys)
    ]
    errors = np.stack([np.asarray(result.image, np.float64) for result in results]) - exact
    means = errors.mean(axis=(1, 2))
    numbers = {
        "rms error": rms(errors),
        "largest rms error of a pixel": float(np.sqrt(np.mean(errors**2, axis=0)).max()),
        "saving": float(np.mean([result.saving for result in results])),
        "mean error": float(means.mean()),
    }
    if size.keys > 1:
        numbers["standard error of the mean error"] = float(means.std(ddof=1) / np.sqrt(size.keys))
    return results[0], numbers

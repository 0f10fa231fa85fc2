"""Thesis Fig. 5.10 and 5.12: one sample of the Sobol' sequence per pixel and frame."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from figures import _points
from qmcjax import samplers, sequences

SIDE, FRAMES = 8, 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw four frames of 8 x 8 pixels, and all of them together."""
    del quality, progress
    sampler = samplers.full_screen(sequences.sobol(2), SIDE, SIDE)
    y, x = (jnp.asarray(a.ravel()) for a in np.mgrid[0:SIDE, 0:SIDE].astype(np.uint32))
    pixels = np.stack([x, y], axis=1)
    frames = [
        (pixels + np.asarray(sampler(x, y, jnp.full_like(x, k), dtype=jnp.float64))) / SIDE
        for k in range(FRAMES)
    ]
    figure, axes = _points.panels(
        FRAMES + 1, "One sample per pixel in each frame of the Sobol' sequence (thesis Fig. 5.10, 5.12)"
    )
    for k, panel in enumerate(axes[:-1]):
        _points.grid(panel, SIDE, SIDE)
        _points.scatter(panel, frames[k], f"frame {k}", color=f"C{k}")
    _points.grid(axes[-1], SIDE, SIDE)
    for k in range(FRAMES):
        _points.scatter(axes[-1], frames[k], "superimposed", color=f"C{k}")
    measured = {f"frame {k} is a (0,6,2)-net": _points.holds_one_each(frames[k], 6) for k in range(FRAMES)}
    measured["the frames together are a (0,8,2)-net"] = _points.holds_one_each(np.concatenate(frames), 8)
    return figure, {
        "measured": measured,
        "printed": "always exactly one sample in each pixel, and each set is well stratified over the screen",
        "note": "The index follows from pixel and frame by solving linear equations over F2, without tables.",
    }

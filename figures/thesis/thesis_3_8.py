"""Thesis Fig. 3.8: images from points on the lens, each a perspective projection, and their mean."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._errors import rms
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import Panel, image_grid
from qmcjax import samplers, scenes, sequences, tracing
from qmcjax.core.pytrees import pytree

SIDE = {"draft": 32, "paper": 192}
SPP = {"draft": 4, "paper": 16}
"""Of each image from one point."""
MANY = {"draft": 256, "paper": 1024}
"""Samples per pixel over all of the lens."""
COUNTS = (4, 16, 64)
"""Points on the lens whose images are averaged."""

LINEAR = 1e-6

NOTE = (
    "{side} x {side} pixels, the package's row of balls with a thin lens; {spp} samples per pixel of each "
    "image from one point, {many} over all of the lens. A slice of the light field is what one point on the "
    "lens sees: its rays have one origin, and where they cross the plane of focus is linear in the pixel, "
    "to {residual:.0e} of the plane's distance: a perspective projection off the axis, as graphics hardware "
    "renders it. Points are the first of the Sobol' sequence. Means of few images show each object out of "
    "focus as often as there are points; RMS differences from the image over all of the lens are {errors}."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render from points on the lens, and average."""
    side, spp, scene = SIDE[quality], SPP[quality], scenes.defocus()
    lens = np.asarray(sequences.sobol(2).points(max(COUNTS)))
    slices = []
    for number, point in enumerate(lens):
        slices.append(scene_images.replicate(scene, _from_one_point(point, number), side, spp))
        progress(0.8 * (number + 1) / len(lens))
    every = samplers.independent(sequences.sobol(len(scene.needs)), 1)
    whole = scene_images.image(scene, every, side, MANY[quality])
    means = {count: np.mean(slices[:count], axis=0) for count in COUNTS}
    errors = {f"{count} points": rms(mean - whole) for count, mean in means.items()}
    residual = max(_not_linear(scene.estimator.camera, point) for point in lens)
    panels = [Panel(f"point {k + 1} on the lens", diffusion.shown(slices[k])) for k in range(4)]
    panels += [Panel(f"mean of {count} points", diffusion.shown(mean)) for count, mean in means.items()]
    panels.append(Panel("all of the lens", diffusion.shown(whole)))
    title = (
        "Each point on the lens sees a perspective image;\ntheir mean has depth of field (thesis, Fig. 3.8)"
    )
    numbers = {
        "measured": {"RMS difference from all of the lens": errors, "residual": residual},
        "claims": {
            "what a point on the lens sees is a perspective projection": residual < LINEAR,
            "the mean of more images is nearer to depth of field": all(
                more < fewer for fewer, more in pairwise(errors.values())
            ),
        },
        "note": NOTE.format(
            side=side,
            spp=spp,
            many=MANY[quality],
            residual=residual,
            errors=", ".join(f"{of:.4f} ({name})" for name, of in errors.items()),
        ),
    }
    return image_grid(title, panels, 4, 256), numbers


@pytree
@dataclass(frozen=True)
class _AtOnePoint:
    """Samples of six coordinates; those on the lens are one point."""

    sampler: Any
    point: Array | NDArray

    dims = 6

    def __call__(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: Any) -> Array:
        found = self.sampler(x, y, sample, tuple(range(6)), dtype)
        fixed = jnp.broadcast_to(jnp.asarray(self.point, dtype), (*found.shape[:-1], 2))
        return jnp.concatenate([found[..., :2], fixed, found[..., 4:]], axis=-1)[..., jnp.array(dims)]


def _from_one_point(point: NDArray, key: int) -> samplers.Sampler:
    """Return a sampler whose lens coordinates are those of one point."""
    free = samplers.independent(sequences.sobol(6), key)
    return samplers.as_sampler("sampler", _AtOnePoint(free, point))


def _not_linear(camera: tracing.Camera, point: NDArray) -> float:
    """Return how far the rays of a lens point are from a linear map of the screen to the plane of focus."""
    x, y = np.meshgrid(*[(np.arange(8, dtype=np.float32) + 0.5) / 8] * 2)
    x, y = x.ravel(), y.ravel()
    lens = tuple(jnp.full_like(jnp.asarray(x), part) for part in point)
    sight = camera.rays(jnp.asarray(x), jnp.asarray(y), jnp.zeros_like(x), lens)
    origin, direction = (np.stack([np.asarray(part, np.float64) for part in of]) for of in sight[:2])
    spread = np.ptp(origin, axis=1).max()
    forward = np.subtract(camera.target, camera.position, dtype=np.float64)
    forward /= np.linalg.norm(forward)
    crossed = (direction / (forward @ direction)).T
    of_screen = np.stack([x, y, np.ones_like(x)], axis=1).astype(np.float64)
    fit, *_ = np.linalg.lstsq(of_screen, crossed, rcond=None)
    return float(max(spread, np.abs(crossed - of_screen @ fit).max()))

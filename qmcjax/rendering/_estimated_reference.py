"""Estimates of exact images, for scenes without a closed form."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax import samplers, sequences
from qmcjax.core import checks, devices, draws
from qmcjax.core.checkpoints import Checkpoint
from qmcjax.rendering._render import rendered
from qmcjax.rendering._task import check_progress, opened, task
from qmcjax.scenes import as_scene

REPLICATES = 16
"""Number of independent images to average: the standard error of the mean is known to about 18 %."""

_DEVIATIONS = 5
"""The bound in standard errors."""


def estimated_reference(
    scene: Any,
    width: int,
    height: int,
    spp: int,
    key: Array | int,
    *,
    dtype: DTypeLike = jnp.float64,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | os.PathLike | Checkpoint | None = None,
    mesh: Mesh | None = None,
) -> tuple[NDArray[np.float64], float]:
    """Estimate the mean over each pixel from randomised replicates, with a bound on the errors.

    Each replicate has ``spp / 16`` samples in every pixel, points of the Sobol' sequence, Owen-scrambled
    independently for each pixel and replicate. So the estimate is unbiased up to rounding, and the variance
    of the replicates gives its standard error.

    Parameters
    ----------
    scene : Scene
    width, height : int, in [1, 65536]
    spp : int, samples per pixel of all replicates together, a multiple of 16; best 16 times a power of 2
    key : jax.random.key, or int in [0, 2**32)
    dtype : float32 or float64, of points, values and the sums of a replicate
    progress : callable, optional, called with the finished part in (0, 1], several times in a long run
    checkpoint : path or Checkpoint, optional, file that keeps finished work, as for :func:`qmcjax.render`
    mesh : jax.sharding.Mesh, optional, devices that share the pixels, as for :func:`qmcjax.render`

    Returns
    -------
    image : float64 ndarray, shape (height, width) or (height, width, 3)
    bound : float
        Five times the largest standard error of all values of the image, plus a bound on rounding.

    Notes
    -----
    The bound holds with a probability that depends on the scene: for errors that are nearly normal, a value
    with the largest standard error exceeds it with a probability of 1.6e-4, by Student's distribution with 15
    degrees of freedom. It does not cover features that no sample has hit, such as a light hit by one sample
    in a million.

    References
    ----------
    .. [1] A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995.

    Examples
    --------
    >>> from qmcjax import estimated_reference, scenes
    >>> scene = scenes.zone_plate(10.0)
    >>> image, bound = estimated_reference(scene, 8, 8, spp=4096, key=1)
    >>> exact, _ = scene.reference(8, 8)
    >>> print(abs(image - exact).max() < bound < 1e-3)
    True
    """
    scene = as_scene("scene", scene)
    spp = checks.integer("spp", spp, REPLICATES, checks.INDEX_LIMIT - 1)
    if spp % REPLICATES:
        raise ValueError(f"spp must be a multiple of the {REPLICATES} replicates, got {spp}")
    sobol = sequences.sobol(len(scene.needs))
    keys = draws.split(checks.prng_key("key", key), REPLICATES)
    dtype = checks.floating(dtype)
    tasks = [
        task(scene, samplers.independent(sobol, each), width, height, spp // REPLICATES, dtype)
        for each in keys
    ]
    check_progress(progress, tasks[0])
    mesh = devices.checked(mesh)
    saved = opened(checkpoint, "estimated_reference", tasks[0], mesh, key=keys, spp=spp)
    images = [] if saved is None else list(saved.state.pop("images", []))
    for number in range(len(images), REPLICATES):

        def report(part: float, number: int = number) -> None:
            if progress is not None:
                progress((number + part) / REPLICATES)

        if saved is not None:
            saved.outer = {"images": np.array(images, np.float64)}
        images.append(rendered(tasks[number], mesh, None if progress is None else report, saved))
        if saved is not None:
            saved.state = {}
    with jax.enable_x64(True):
        image, deviation, largest = _moments(images)
    error = float(deviation) / np.sqrt(REPLICATES)
    rounding = 4 * float(jnp.finfo(dtype).eps) * float(largest)
    return np.asarray(image), float(_DEVIATIONS * error + rounding)


@jax.jit
def _moments(images: list[Array]) -> tuple[Array, Array, Array]:
    """Return the mean of images in float64, their largest standard deviation, and the largest mean."""
    stack = jnp.stack([image.astype(jnp.float64) for image in images])
    mean = jnp.mean(stack, axis=0)
    return mean, jnp.std(stack, axis=0, ddof=1).max(), abs(mean).max()

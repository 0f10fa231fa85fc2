"""Independent images, their mean and its error: passes up to a tolerance, and references."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import nullcontext
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax import samplers, sequences
from qmcjax.core import checkpoints, checks, devices, draws
from qmcjax.core.checkpoints import Checkpoint
from qmcjax.rendering import _tolerances
from qmcjax.rendering._render import render, render_task
from qmcjax.rendering._task import check_progress, open_checkpoint, task
from qmcjax.scenes import Scene, as_scene


class Passes(NamedTuple):
    """The mean of independent images."""

    image: Array
    """Shape (height, width) or (height, width, 3): an estimate of the image, unbiased up to rounding."""
    variance: Array
    """The same shape: an unbiased estimate of the variance of each value of ``image``."""
    error: Array
    """Shape (): standard error of the whole image, root of the mean of ``variance`` plus the square of the
rounding error: the epsilon of the dtype times the largest value."""
    passes: int
    """Number of passes."""


def render_passes(
    scene: Scene,
    sampler: samplers.Randomized,
    width: int,
    height: int,
    passes: int,
    *,
    tolerance: _tolerances.Tolerance | None = None,
    relative: float | None = None,
    seconds: float | None = None,
    dtype: DTypeLike = jnp.float32,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    mesh: Mesh | None = None,
) -> Passes:
    """Average independently randomised passes of an image, up to an error or a time limit.

    Parameters
    ----------
    scene : Scene, as for :func:`render`
    sampler : Randomized
        Made by :func:`qmcjax.samplers.randomized`, or any object with ``of_pass(number)``, which returns the
        sampler of a pass. A pass has ``sampler.spp`` samples per pixel.
    width, height : int, in [1, 65536]
    passes : int, number of passes, or the maximum, at least 2
    tolerance : float or callable, optional
        Stop after two or more passes as soon as ``error`` is at most this, a positive number. A function is
        called with the means so far and their variances, float64 ndarrays of the image's shape, and returns
        the standard error that is allowed: a number, or one for each pixel or each of its channels. Rendering
        stops when the root mean square of the errors over the allowed ones is at most 1.
    relative : float, optional
        The same, with this fraction of the mean of the pixel's brightest channel as the allowed error, or
        with ``tolerance`` where that is larger: give a floor if pixels may be black.
    seconds : float, optional
        Stop after two or more passes as soon as this call has taken so long, a positive number.
    dtype : float32 or float64, dtype of the images; passes are added up in float64
    progress : callable, optional
        Called with the finished part in (0, 1] after each pass: the largest of the parts of all passes, of
        the time, and of the way to the tolerance.
    checkpoint : path or Checkpoint, optional
        File that keeps the passes, as for :func:`render`; ``passes``, tolerances and ``seconds`` may
        change. If your own function makes the sampler, pass a :class:`qmcjax.Checkpoint` with a label.
    mesh : jax.sharding.Mesh, optional
        Devices that share the pixels, as for :func:`qmcjax.render`. Several processes cannot agree on
        ``seconds``.

    Notes
    -----
    For a given number of passes, image and variance are unbiased up to rounding. With a tolerance both are
    biased: stopping depends on the passes so far, and errors are underestimated until a rare event occurs.
    Means are then too small for values that are rarely large, and variances are always too small. The bias
    vanishes with the tolerance; it is smallest if the number of passes hardly varies, as for many pixels that
    share the criterion. For an unbiased result, find the number of passes with one key, and render that many
    with another.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 4.2.

    Examples
    --------
    >>> from qmcjax import orders, render_passes, samplers, scenes, sequences
    >>> def sampler_of_key(key):
    ...     scrambled = sequences.owen(sequences.sobol(2), key)
    ...     return samplers.contiguous(orders.hilbert(16, 16), scrambled, spp=4)
    >>> sampler = samplers.randomized(sampler_of_key, key=1)
    >>> result = render_passes(scenes.checkerboard(), sampler, 16, 16, passes=100, tolerance=0.05)
    >>> print(bool(result.error <= 0.05), result.passes < 100)
    True True
    """
    scene = as_scene("scene", scene)
    if not callable(getattr(sampler, "of_pass", None)):
        raise TypeError(f"sampler must be made by samplers.randomized, got {checks.shown(sampler)}")
    passes = checks.integer("passes", passes, 2, checks.INDEX_LIMIT)
    _tolerances.check(tolerance, relative)
    if seconds is not None:
        checks.positive("seconds", seconds)
        if np.ndim(seconds):
            raise TypeError(f"seconds must be one number, got {checks.shown(seconds)}")
    if seconds is not None and devices.processes(devices.validate_mesh(mesh)) > 1:
        raise ValueError(f"seconds must be None for a mesh of several processes, got {seconds}")
    dtype = checks.floating(dtype)
    begin, state, saved = time.monotonic(), None, None
    if progress is not None or checkpoint is not None:
        first = task(scene, sampler.of_pass(0), width, height, sampler.spp, dtype)
        check_progress(progress, first)
        made_of = {"sampler": sampler, "first pass": first.sampler}
        saved = open_checkpoint(checkpoint, "render_passes", first, devices.validate_mesh(mesh), **made_of)
    if saved is not None:
        state = _resumed(saved.state, passes)

    def finished(state: _State) -> float:
        """Return the finished part, by the criterion that will stop first."""
        parts = [state.done / passes]
        if state.done > 1 and relative is None and tolerance is not None and not callable(tolerance):
            parts.append((float(tolerance) / max(float(state.error), float(tolerance))) ** 2)
        elif state.done > 1 and (relative is not None or tolerance is not None):
            mean, variance = np.asarray(state.mean), np.asarray(state.variance)
            rounded = variance + np.square(float(jnp.finfo(dtype).eps) * mean)
            parts.append(1 / max(_tolerances.missed(tolerance, relative, mean, variance, rounded).mean(), 1))
        if state.done > 1 and seconds is not None:
            parts.append((time.monotonic() - begin) / float(seconds))
        return min(max(parts), 1.0)

    part = 0.0 if state is None else finished(state)
    with saved or nullcontext():
        while part < 1:
            number = 0 if state is None else state.done
            # Outside the x64 context, which changes float32 programs.
            image = render(scene, sampler.of_pass(number), width, height, sampler.spp, dtype=dtype, mesh=mesh)
            with jax.enable_x64(True):
                state = _first(image) if state is None else _updated(image, state)
            part = max(part, finished(state))
            if saved is not None and saved.due(last=part == 1):
                saved.write(**state._asdict())
            if progress is not None:
                progress(part)
    assert state is not None
    with jax.enable_x64(True):
        image, variance, error = (each.astype(dtype) for each in state[:3])
    return Passes(image, variance, error, state.done)


class _State(NamedTuple):
    mean: Array
    variance: Array
    error: Array
    done: int


def _resumed(state: checkpoints.Arrays, passes: int) -> _State | None:
    if not state:
        return None
    done = int(state["done"])
    if done > passes:
        raise ValueError(f"passes must be at least the {done} that the checkpoint has, got {passes}")
    with jax.enable_x64(True):
        mean, variance, error = (jnp.asarray(state[name]) for name in ("mean", "variance", "error"))
        return _State(mean, variance, error, done)


def _first(image: Array) -> _State:
    mean = image.astype(jnp.float64)
    return _State(mean, jnp.zeros_like(mean), jnp.float64(jnp.inf), 1)


def _updated(image: Array, state: _State) -> _State:
    mean, variance, error = _added(image, state.mean, state.variance, jnp.float64(state.done))
    return _State(mean, variance, error, state.done + 1)


@jax.jit
def _added(image: Array, mean: Array, variance: Array, n: Array) -> tuple[Array, Array, Array]:
    """Add an image to the mean of n, whose variance is known if n > 1 (B. P. Welford, 1962)."""
    deviation = image.astype(mean.dtype) - mean
    # The sum of squared deviations, n (n - 1) times the variance, grows by n / (n + 1) times this one.
    variance = variance * ((n - 1) / (n + 1)) + jnp.square(deviation / (n + 1))
    mean = mean + deviation / (n + 1)
    rounding = float(jnp.finfo(image.dtype).eps) * abs(mean).max()
    return mean, variance, jnp.sqrt(jnp.mean(variance) + jnp.square(rounding))


REPLICATES = 16
"""Number of independent images to average, which gives the standard error to about 18 %."""

_DEVIATIONS = 5
"""The bound in standard errors."""


def estimated_reference(
    scene: Scene,
    width: int,
    height: int,
    spp: int,
    key: Array | int,
    *,
    dtype: DTypeLike = jnp.float64,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    mesh: Mesh | None = None,
) -> tuple[NDArray[np.float64], float]:
    """Estimate the mean over each pixel from randomised replicates, with a bound on the errors.

    Each replicate has ``spp / 16`` samples in every pixel: points of the Sobol' sequence, Owen-scrambled
    independently for each pixel and replicate. So the estimate is unbiased up to rounding, and the variance
    of the replicates gives its standard error.

    Parameters
    ----------
    scene : Scene
    width, height : int, in [1, 65536]
    spp : int, samples per pixel of all replicates together, a multiple of 16, preferably a power of 2
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
    The bound is probabilistic and depends on the scene: if errors are nearly normal, a value with the largest
    standard error exceeds it with probability 1.6e-4, by Student's distribution with 15 degrees of freedom.
    It does not cover features that no sample has hit, such as a light hit by one sample in a million.

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
    mesh = devices.validate_mesh(mesh)
    saved = open_checkpoint(checkpoint, "estimated_reference", tasks[0], mesh, key=keys, spp=spp)
    images = [] if saved is None else list(saved.state.pop("images", []))
    for number in range(len(images), REPLICATES):

        def report(part: float, number: int = number) -> None:
            if progress is not None:
                progress((number + part) / REPLICATES)

        if saved is not None:
            saved.outer = {"images": np.array(images, np.float64)}
        images.append(render_task(tasks[number], mesh, None if progress is None else report, saved))
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

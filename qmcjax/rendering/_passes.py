"""Independent passes of an image, their mean and its variance."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.rendering._render import render
from qmcjax.scenes import as_scene

__all__ = ["Passes", "render_passes"]


class Passes(NamedTuple):
    """The mean of independent images."""

    image: Array
    """Shape (height, width) or (height, width, 3): an unbiased estimate of the image."""
    variance: Array
    """The same shape: an unbiased estimate of the variance of each value of ``image``."""
    error: Array
    """Shape (): root of the mean of ``variance``, the standard error of the whole image."""
    passes: int
    """How many."""


def render_passes(
    scene: Any,
    sampler: Any,
    width: int,
    height: int,
    passes: int,
    *,
    tolerance: float | None = None,
    dtype: DTypeLike = jnp.float32,
) -> Passes:
    """Average freshly randomised passes of an image, until an error is reached.

    Parameters
    ----------
    scene : Scene
        As for :func:`render`.
    sampler : Randomized
        Made by :func:`qmcjax.samplers.randomized`, or any object whose ``of_pass(number)`` returns the
        sampler of a pass; a pass has ``sampler.spp`` samples per pixel.
    width, height : int
        In [1, 65536].
    passes : int
        Number of passes, or the most of them, at least 2.
    tolerance : float, optional
        Stop after two or more passes as soon as ``error`` is at most this.
    dtype : float32 or float64
        Of the images; passes are added up in float64.

    Returns
    -------
    Passes

    Raises
    ------
    TypeError
        If an argument is not what it is named for.
    ValueError
        If ``passes`` is out of range, ``tolerance`` is not positive, or as :func:`render` does.

    Notes
    -----
    For a given number of passes, image and variance are unbiased. With ``tolerance`` neither is:
    whether to stop depends on the passes seen, and small errors are estimated where chance has not shown a
    rare event yet. The means are then too small for values that are rarely large, and variances too small for
    all. The bias vanishes with the tolerance; what is left of it is least where the number of passes hardly
    varies, as for many pixels that share the criterion. To be unbiased, find the number of passes with one
    key, and render that many with another.

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
    if tolerance is not None:
        checks.positive("tolerance", tolerance)
        if np.ndim(tolerance):
            raise TypeError(f"tolerance must be one number, got {checks.shown(tolerance)}")
    dtype = checks.floating(dtype)

    def image(number: int) -> Array:
        return render(scene, sampler.of_pass(number), width, height, sampler.spp, dtype=dtype)

    done, of_pass = 1, image(0)
    with jax.enable_x64(True):
        mean = of_pass.astype(jnp.float64)
        variance, error = jnp.zeros_like(mean), jnp.float64(jnp.inf)
    while done < passes and (tolerance is None or float(error) > tolerance):
        # Outside the context: the program of an image in float32 is another there.
        of_pass = image(done)
        with jax.enable_x64(True):
            mean, variance, error = _updated(of_pass, mean, variance, jnp.float64(done))
        done += 1
    with jax.enable_x64(True):
        return Passes(mean.astype(dtype), variance.astype(dtype), error.astype(dtype), done)


@jax.jit
def _updated(image: Array, mean: Array, variance: Array, n: Array) -> tuple[Array, Array, Array]:
    """Add an image to the mean of n, whose variance is known if n > 1 (B. P. Welford, 1962)."""
    deviation = image.astype(mean.dtype) - mean
    # The sum of squared deviations, n (n - 1) times the variance, grows by n / (n + 1) times this one.
    variance = variance * ((n - 1) / (n + 1)) + jnp.square(deviation / (n + 1))
    return mean + deviation / (n + 1), variance, jnp.sqrt(jnp.mean(variance))

"""Errors of images after low-pass filtering, for an eye that does not resolve pixels."""

from __future__ import annotations

from typing import Any, cast

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._spectra.spectra import error_spectrum, radial_average

_WIDE = 0.4
"""About 1 / sqrt(2 pi): the Gaussian that is its own transform."""

_TERMS = 8
"""Both sums have fewer terms than this on each side: further terms are below 1e-60."""


def filtered_error(image: ArrayLike, reference: ArrayLike, sigma: float = 1.5) -> float:
    """Return the root mean square of an image's error after a Gaussian filter.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Of equal shape. The image is taken as periodic.
    sigma : float, standard deviation of the filter in pixels, positive

    Returns
    -------
    float
        At most the root mean square error. If JAX traces an image (``jit``, ``grad``, ``vmap``), an Array of
        its dtype, differentiable; the gradient is set to 0 where the error is 0.

    Notes
    -----
    Pixels are weighted by exp(-r^2 / (2 sigma^2)) at all distances r between them, normalised by their sum: a
    discrete filter. It is evaluated in the frequency domain, to rounding errors;
    ``scipy.ndimage.gaussian_filter`` truncates the same filter, which leaves too much of strongly attenuated
    waves. From ``sigma`` = 1.5 on, the factor for a wave of f cycles per pixel is within 2e-5 of the
    continuous Gaussian's exp(-2 (pi sigma f)^2).

    Examples
    --------
    >>> print(f"{filtered_error([[1.0, -1.0], [-1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]], 0.5):.4f}")
    0.3297
    """
    error = _arguments.error(image, reference)
    sigma = _arguments.positive("sigma", sigma)
    height, width = error.shape[:2]
    return weighted_rms(error, gaussian_transfer(height, sigma)[:, None] * gaussian_transfer(width, sigma))


def weighted_rms(error: Any, weights: NDArray[np.float64]) -> float:
    """Return the root mean square of an error, shape (height, width, channels), with its waves weighted."""
    traced = isinstance(error, Tracer)
    xp: Any = jnp if traced else np
    power = xp.square(xp.abs(xp.fft.fft2(error, axes=(0, 1)))).sum(axis=2)
    size = weights.size * error.size
    mean = xp.sum(np.square(weights).astype(power.dtype) * power) / size
    if not traced:
        return float(np.sqrt(mean))
    return _arguments.root(mean).astype(error.dtype)


def gaussian_transfer(size: int, sigma: float) -> NDArray[np.float64]:
    """Return the factors of the waves of one axis for a sampled Gaussian of sum 1.

    The weights exp(-k^2 / (2 sigma^2)) of all integers k, or by Poisson's formula a sum of Gaussians of the
    frequency: the shorter of both sums, with hardly any cancellation.
    """
    frequency = np.fft.fftfreq(size)
    k = np.arange(1, _TERMS)
    with np.errstate(over="ignore", under="ignore"):
        if sigma < _WIDE:
            weights = np.exp(-np.square(k / sigma) / 2)
            waves = np.cos(2 * np.pi * np.outer(frequency, k))
            return (1 + 2 * waves @ weights) / (1 + 2 * weights.sum())
        whole = np.arange(-_TERMS, _TERMS + 1)
        copies = np.exp(-2 * np.square(np.pi * sigma * (frequency[:, None] + whole))).sum(axis=1)
        return copies / copies[0]


def low_frequency_power(image: ArrayLike, reference: ArrayLike, cutoff: float = 1 / 16) -> float:
    """Return the mean radial power of an image's error below a frequency: 1 for white noise.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
    cutoff : float
        In cycles per pixel, in (0, 1/2], above one cycle per image. Annuli of :func:`radial_average` below it
        have equal weights; the mean is left out.

    Returns
    -------
    float
        If JAX traces an image, an Array of its dtype, differentiable.

    References
    ----------
    .. [1] R. Ulichney, "Digital Halftoning", 1987: the radially averaged power spectrum.
    """
    cutoff = _arguments.real("cutoff", cutoff, "in (0, 0.5]", lambda f: 0 < f <= 0.5)
    frequency, power = radial_average(error_spectrum(image, reference))
    below = frequency < cutoff * max(np.shape(image)[:2])
    if not below.any():
        raise ValueError(f"cutoff must be above one cycle per image, got {cutoff!r} for {np.shape(image)}")
    mean: Any = power[below].mean()
    return cast(Any, mean) if isinstance(mean, Tracer) else float(mean)

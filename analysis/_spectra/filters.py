"""Filters of periodic images in space and time, and errors of images after them or after a denoiser."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from qmcjax.core import checks

_WIDE = 0.4
"""About 1 / sqrt(2 pi): the Gaussian that is its own transform."""

_TERMS = 8
"""Both sums have fewer terms than this on each side: further terms are below 1e-60."""

_DIGITS = 53
"""Digits in base 2 of float64, which bound the memory of a moving average."""


SPACE, TIME = "(rows, columns) or (rows, columns, frames)", "(frames,)"
"""Shapes of taps, the first at the element itself."""


def moving_average(alpha: float) -> NDArray[np.float64]:
    """Return the taps of an exponential moving average: alpha (1 - alpha)^k for the frame k frames ago.

    Parameters
    ----------
    alpha : float, weight of a new frame, in [1e-5, 1]

    Returns
    -------
    float64 array, shape (frames,)
        For ``time`` of :func:`filtered_error` and of :class:`Filter`. About 37 / alpha frames; the weights of
        the omitted ones sum to at most 2^-53.

    Examples
    --------
    >>> print(moving_average(0.5)[:4])
    [0.5    0.25   0.125  0.0625]
    """
    alpha = _arguments.real("alpha", alpha, "in [1e-5, 1]", lambda a: 1e-5 <= a <= 1)
    frames = 1 if alpha == 1 else math.ceil(-_DIGITS * math.log(2) / math.log1p(-alpha))
    return alpha * np.power(1 - alpha, np.arange(frames, dtype=np.float64))


def validate_filter(name: str, of: Any, axes: str) -> float | NDArray[np.float64]:
    """Return the standard deviation of a Gaussian, 0 for none, or taps of these axes, or raise."""
    taps = _arguments.array(name, of, "a number or an array of numbers").astype(np.float64)
    if taps.ndim == 0:
        return _arguments.not_negative(name, of)
    if (
        taps.ndim not in ((2, 3) if axes == SPACE else (1,))
        or not np.isfinite(taps).all()
        or not taps.sum() > 0
    ):
        raise ValueError(
            f"{name} must be finite taps, of shape {axes} and a positive sum, got {checks.shown(of)}"
        )
    return taps


def transfer(shape: tuple[int, ...], of: float | NDArray[np.float64]) -> NDArray[Any]:
    """Return the factors of the waves of axes of time, space or both, for a known filter, of sum 1."""
    if not isinstance(of, np.ndarray):
        sides = [gaussian_transfer(size, of) if of else np.ones(size) for size in shape]
        return np.outer(*sides) if len(sides) == 2 else sides[0]
    whole = np.zeros(shape)
    np.add.at(whole, tuple(np.indices(of.shape) % np.reshape(shape, (-1, *[1] * len(shape)))), of)
    return np.fft.fftn(whole / of.sum())


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


class Filter(NamedTuple):
    """A filter of animated images, for :func:`expected_error`: one in space times one in time.

    Examples
    --------
    >>> from analysis import moving_average
    >>> accumulated = Filter(space=1.5, time=moving_average(0.1))
    """

    space: float | ArrayLike = 1.5
    """Standard deviation of a Gaussian in pixels, 0 for none; or taps, shape (rows, columns), or in space and
    time, shape (rows, columns, frames)."""
    time: float | ArrayLike = 0.0
    """Standard deviation of a Gaussian in frames, 0 for none; or taps, shape (frames,), as ``np.ones(n)``."""
    weight: float = 1.0
    """Weight of the mean square error, at least 0: weights are divided by their sum."""


def as_filters(filters: Any) -> list[Filter]:
    """Return filters with known weights of a positive sum; a number or an array is one of weight 1."""
    several = isinstance(filters, list | tuple) and not isinstance(filters, Filter)
    known: Any = list(filters) if several else [filters]
    if not known or not all(isinstance(one, Filter | numbers.Real) or hasattr(one, "shape") for one in known):
        wanted = "a standard deviation, an array of taps, a Filter, or a list of these"
        raise TypeError(f"filters must be {wanted}, got {checks.shown(filters)}")
    known = [one if isinstance(one, Filter) else Filter(one) for one in known]
    known = [one._replace(weight=_arguments.not_negative("filters.weight", one.weight)) for one in known]
    if not sum(one.weight for one in known) > 0:
        raise ValueError(f"filters must have a positive sum of weights, got {checks.shown(filters)}")
    return known


def autocorrelation(shape: tuple[int, ...], filters: Any) -> NDArray[np.float64]:
    """Return the mean autocorrelation of filters on a torus (height, width, frames): the weights of pairs."""
    known, total = as_filters(filters), np.zeros(())
    for one in known:
        taps = validate_filter("filters.space", one.space, SPACE)
        space = transfer(shape[: max(np.ndim(taps), 2)], taps)
        time = transfer(shape[2:], validate_filter("filters.time", one.time, TIME))
        if space.ndim == 3:
            pairs = np.fft.ifftn(np.square(np.abs(space * time))).real
        else:
            of_space, of_time = (np.fft.ifftn(np.square(np.abs(part))).real for part in (space, time))
            pairs = of_space[:, :, None] * of_time
        total = total + one.weight / sum(other.weight for other in known) * pairs
    return total


def filtered_error(
    image: ArrayLike, reference: ArrayLike, sigma: float = 1.5, time: float | ArrayLike | None = None
) -> float:
    """Return the root mean square error of an image, or of many frames, after a low-pass filter.

    Parameters
    ----------
    image : float ArrayLike, shape (height, width) or (height, width, channels)
        With ``time``, frames of these, shape (frames, height, width[, channels]). Treated as periodic in
        space, and in time: the frames repeat forever, which puts a filter with memory into its steady state.
    reference : float ArrayLike, of the same shape
        With ``time``, also of the shape of one frame, for all frames.
    sigma : float
        Standard deviation of a Gaussian filter in pixels, 0 for none.
    time : float or float ArrayLike, shape (n,), optional
        The filter in time, as in :class:`Filter`: the standard deviation of a Gaussian in frames, 0 for none,
        or the weights of the current frame, the previous one, and so on, which are divided by their sum:
        ``np.ones(n)`` averages n frames, :func:`moving_average` gives an exponential average.

    Returns
    -------
    float
        For non-negative weights, at most the root mean square error. If JAX traces an image (``jit``,
        ``grad``, ``vmap``), an Array of its dtype, differentiable; the gradient is set to 0 if the error is
        0.

    Notes
    -----
    The filter is discrete: pixels are weighted by exp(-r^2 / (2 sigma^2)) at all distances r between them,
    normalised by their sum. It is evaluated in the frequency domain, to rounding errors;
    ``scipy.ndimage.gaussian_filter`` truncates the same filter, which attenuates high frequencies too little.
    For ``sigma`` of 1.5 and more, the factor for a wave of f cycles per pixel is within 2e-5 of that of the
    continuous Gaussian, exp(-2 (pi sigma f)^2).

    Errors that are independent between frames are multiplied by the root of the sum of squared weights:
    n^(-1/2) for the average of n frames, (alpha / (2 - alpha))^(1/2) for a moving average over many more than
    1 / alpha.

    Examples
    --------
    >>> print(f"{filtered_error([[1.0, -1.0], [-1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]], 0.5):.4f}")
    0.3297
    >>> from analysis import moving_average
    >>> flicker = np.array([1.0, -1.0, 1.0, -1.0]).reshape(4, 1, 1)
    >>> print(f"{filtered_error(flicker, [[0.0]], sigma=0, time=moving_average(0.5)):.4f}")
    0.3333
    """
    in_time = None if time is None else validate_filter("time", time, TIME)
    error = _arguments.error(image, reference, animated=in_time is not None)
    *frames, height, width, _ = error.shape
    weights: Any = transfer((height, width), _arguments.not_negative("sigma", sigma))
    if in_time is not None:
        weights = np.abs(transfer(tuple(frames), in_time))[:, None, None] * weights
    return weighted_rms(error, weights)


def weighted_rms(error: Any, weights: NDArray[np.float64]) -> float:
    """Return the root mean square of an error, shape (..., channels), with its waves weighted."""
    traced = isinstance(error, Tracer)
    xp: Any = jnp if traced else np
    power = xp.square(xp.abs(xp.fft.fftn(error, axes=tuple(range(weights.ndim))))).sum(axis=-1)
    size = weights.size * error.size
    mean = xp.sum(np.square(weights).astype(power.dtype) * power) / size
    if not traced:
        return float(np.sqrt(mean))
    return _arguments.root(mean).astype(error.dtype)


def perceived_error(image: ArrayLike, reference: ArrayLike, distance: float = 2000.0) -> float:
    """Return the root mean square of an image's error, weighted by the contrast sensitivity of the eye.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Of equal shape. The image is treated as periodic.
    distance : float
        From the eye to the image, in pixel widths; positive. At 60 cm from pixels of 0.3 mm it is 2000: 35
        pixels per degree. At larger distances coarser noise becomes invisible.

    Returns
    -------
    float
        At most the root mean square error, its limit as ``distance`` goes to 0. If JAX traces an image, an
        Array of its dtype, differentiable; the gradient is set to 0 if the error is 0.

    Notes
    -----
    The sensitivity to f cycles per degree is that of [1]_, 2.6 (0.0192 + 0.114 f) exp(-(0.114 f)^1.1),
    divided by its maximum near 8 cycles per degree, and 1 below the maximum. The lower sensitivity of the eye
    at low frequencies is measured for patterns at threshold and depends on the distance, while images are
    viewed from many distances. Without it the weights are those of a low-pass filter, and a wrong mean counts
    fully, as is usual for dithering.

    References
    ----------
    .. [1] J. L. Mannos, D. J. Sakrison, "The effects of a visual fidelity criterion on the encoding of
       images", IEEE Transactions on Information Theory 20(4), 1974.

    Examples
    --------
    >>> checks = [[1.0, -1.0], [-1.0, 1.0]]
    >>> print(f"{perceived_error(checks, [[0.0, 0.0], [0.0, 0.0]], distance=2000):.4f}")
    0.3313
    """
    error = _arguments.error(image, reference)
    distance = _arguments.positive("distance", distance)
    height, width = error.shape[:2]
    per_pixel = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)[None, :])
    per_degree = per_pixel * distance * np.tan(np.radians(1))
    return weighted_rms(error, _band(np.maximum(per_degree, _PEAK)) / _band(np.array(_PEAK)))


def _band(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sensitivity at frequencies in cycles per degree."""
    u = 0.114 * frequency
    return 2.6 * (0.0192 + u) * np.exp(-(u**1.1))


_PEAK = 7.890914609139
"""The zero of the derivative, 1 - (0.0192 + u) 1.1 u^0.1 at u = 0.114 f."""


def denoised_error(
    image: ArrayLike,
    reference: ArrayLike,
    denoiser: Callable[..., Any],
    albedo: ArrayLike | None = None,
    normal: ArrayLike | None = None,
) -> float:
    """Return the root mean square error of an image after a denoiser.

    Parameters
    ----------
    image : float ArrayLike, shape (height, width) or (height, width, 3)
        Of linear light. A grey image has three equal channels for the denoiser.
    reference : float ArrayLike, of the same shape
    denoiser : callable
        From a float32 image (height, width, 3) to such an image, perhaps with other values than these: any
        filter, or that of :func:`qmcjax.bridges.oidn.denoiser`.
    albedo, normal : ArrayLike, optional
        What is seen in each pixel. If given, they are further arguments of the denoiser, in this order.

    Returns
    -------
    float
        If JAX traces an image, an Array of its dtype, differentiable if the denoiser is; the gradient is set
        to 0 if the error is 0.

    Notes
    -----
    A Gaussian filter forgives errors of high frequency, see :func:`filtered_error`. Denoisers that look for
    similar surroundings, learned or not, may take regular errors for a texture and keep them: samplers that
    are best after the one are not always best after the other.

    Examples
    --------
    A median filter removes single wrong pixels, but not a pattern:

    >>> import numpy as np
    >>> from scipy.ndimage import median_filter
    >>> median = lambda image: median_filter(image, (3, 3, 1), mode="wrap")
    >>> grey = np.zeros((8, 8))
    >>> one, stripes = grey.copy(), grey.copy()
    >>> one[3, 4], stripes[::2] = 1, 1
    >>> print(denoised_error(one, grey, median), f"{denoised_error(stripes, grey, median):.3f}")
    0.0 0.707
    """
    error = _arguments.error(image, reference)
    if error.shape[2] not in (1, 3):
        raise ValueError(
            f"image must have shape (height, width) or (height, width, 3), got {np.shape(image)}"
        )
    traced = isinstance(error, Tracer)
    xp: Any = jnp if traced else np
    shape = (*error.shape[:2], 3)
    given, exact = (
        xp.broadcast_to(xp.asarray(each).reshape(error.shape), shape).astype(np.float32)
        for each in (image, reference)
    )
    others = (albedo,) if normal is None else (albedo, normal)
    others = () if normal is None and albedo is None else others
    checks.function("denoiser", denoiser, "of an image, and of what else is given", 1 + len(others))
    denoised = denoiser(given, *others)
    if np.shape(denoised) != shape:
        raise ValueError(f"denoiser must return an image of shape {shape}, got {np.shape(denoised)}")
    if traced:
        return _arguments.root(jnp.square(denoised - exact).mean()).astype(error.dtype)
    _arguments.check_finite("what denoiser returns", denoised := np.asarray(denoised, np.float64))
    return float(np.sqrt(np.square(denoised - exact).mean()))

"""Spectra of the error of an image, or of the power of a point set."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from qmcjax.core import checks


def error_spectrum(image: ArrayLike, reference: ArrayLike, *, animated: bool = False) -> NDArray[np.float64]:
    """Return the power spectrum of the error e of an image, ``|FFT(e - mean e)|^2 / (N var e)``.

    The mean over all frequencies is 1 for any size of the error, and so is the expectation at each frequency
    if the error is white noise. The image is treated as periodic, without a window.

    Parameters
    ----------
    image : float ArrayLike, shape (height, width) or (height, width, channels)
        If animated, frames of these, shape (frames, height, width[, channels]), periodic in time, too.
        Powers and variances of channels are summed before they are divided.
    reference : float ArrayLike, of the same shape
        If animated, also of the shape of one frame, for all frames.
    animated : bool
        Whether the first axis is time.

    Returns
    -------
    float64 array, shape (height, width) or (frames, height, width)
        In the layout of ``numpy.fft.fftn``: element [0, 0], the mean, is removed and hence 0. For frames,
        :func:`radial_average` computes the power over frequencies in time and in space. If JAX traces an
        image (``jit``, ``grad``, ``vmap``), of its dtype, and differentiable.

    Raises
    ------
    ValueError
        If the error is constant. If JAX traces it, the spectrum is 0 instead.

    Examples
    --------
    >>> print(error_spectrum([[1.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]))
    [[0. 4.]
     [0. 0.]]
    """
    channels = _arguments.error(image, reference, animated=checks.flag("animated", animated))
    axes = tuple(range(channels.ndim - 1))
    mean = (0,) * len(axes)
    traced = isinstance(channels, Tracer)
    if not traced and (channels == channels[mean]).all():
        raise ValueError(f"image must differ from reference by more than a constant, got {channels[mean]}")
    xp: Any = jnp if traced else np
    channels = channels - channels.mean(axis=axes, keepdims=True)
    power = xp.square(xp.abs(xp.fft.fftn(channels, axes=axes))).sum(axis=-1)
    total = xp.square(channels).sum()
    if traced:
        return (power.at[mean].set(0) / jnp.where(total > 0, total, jnp.inf)).astype(channels.dtype)
    power[mean] = 0.0
    return power / total


def radial_average(spectrum: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean power in annuli of width 1 around the zero frequency, which is omitted.

    Parameters
    ----------
    spectrum : float ArrayLike, shape (height, width) or (frames, height, width)
        In the layout of ``numpy.fft.fft2``, such as from :func:`error_spectrum` or :func:`point_spectrum`.
        With frames, one for each frequency in time, ``numpy.fft.fftfreq(frames)`` cycles per frame.

    Returns
    -------
    frequency : float64 array, shape (max(height, width) // 2,)
        1, 2, ... up to the Nyquist frequency: cycles per longer side of the image. Annulus k contains
        frequencies in [k - 1/2, k + 1/2); the corners beyond the last are omitted.
    power : float64 array, of the same shape, or (frames, max(height, width) // 2)
        The mean of each annulus. If JAX traces the spectrum, of its dtype, and differentiable.

    Notes
    -----
    Frequencies are measured in space, not in elements of the array: if an image is not square, frequencies
    along its shorter side are farther apart, and an annulus contains fewer.

    Examples
    --------
    >>> frequency, power = radial_average([[9.0, 1.0], [3.0, 5.0]])
    >>> print(frequency, power)
    [1.] [3.]
    """
    array = _validate_spectrum(spectrum, (2, 3))
    height, width = array.shape[-2:]
    annulus = _annuli(height, width)
    frequency = np.arange(1, max(height, width) // 2 + 1)
    count = np.bincount(annulus.ravel())
    times = array.reshape(-1, height, width)
    places = annulus + len(count) * np.arange(len(times))[:, None, None]
    total = _sums(places, times).reshape(*array.shape[:-2], -1)[..., frequency]
    count = count[frequency]
    return frequency.astype(np.float64), total / count.astype(total.dtype).reshape(
        (1,) * (total.ndim - 1) + (-1,)
    )


def radial_anisotropy(spectrum: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the variation of the power along annuli of width 1: variance / mean^2, in decibels.

    The power of one realisation of isotropic noise is exponentially distributed at each frequency, with an
    anisotropy of about 0 dB; that of a mean of m realisations is about -10 log10(m) dB [1]_.

    Parameters
    ----------
    spectrum : float ArrayLike, shape (height, width)
        In the layout of ``numpy.fft.fft2``, such as from :func:`error_spectrum` or :func:`point_spectrum`.

    Returns
    -------
    frequency : float64 array, shape (max(height, width) // 2,), the annuli of :func:`radial_average`
    anisotropy : float64 array, of the same shape
        10 log10(s^2 / mean^2), where s^2 is the sum of squared deviations divided by their number less 1:
        -inf if all are equal, NaN for annuli with a single value or zeros only. If JAX traces the spectrum,
        of its dtype, and differentiable; gradients of these elements are 0.

    Notes
    -----
    If frequencies k and -k have the same power, as for points and for real images, an annulus of 2m values
    has m different ones: the expectation of s^2 is smaller than the variance, by the factor (2m - 2) / (2m -
    1).

    References
    ----------
    .. [1] R. Ulichney, "Dithering with blue noise", Proceedings of the IEEE 76(1), 1988, Sect. II.

    Examples
    --------
    >>> frequency, anisotropy = radial_anisotropy([[9.0, 1.0], [3.0, 5.0]])
    >>> print(frequency, anisotropy.round(3))
    [1.] [-3.522]
    """
    array = _validate_spectrum(spectrum, (2,))
    annulus = _annuli(*array.shape)
    frequency, mean = radial_average(array)
    wanted = (annulus >= 1) & (annulus <= len(frequency))
    place = annulus[wanted] - 1
    squares = _sums(place, (array[wanted] - mean[place]) ** 2)
    count = np.bincount(place)
    xp: Any = jnp if isinstance(squares, Tracer) else np
    variance = squares / np.maximum(count - 1, 1).astype(squares.dtype)
    # Rounding may move the mean of a single value away from it.
    spread = (variance > 0) & (count > 1)
    ratio = xp.where(spread, variance, 1) / xp.square(xp.where(spread, mean, 1))
    limit = xp.where((count > 1) & (variance == 0) & (mean != 0), -np.inf, np.nan).astype(squares.dtype)
    return frequency, xp.where(spread, 10 * xp.log10(ratio), limit)


def low_frequency_power(image: ArrayLike, reference: ArrayLike, cutoff: float = 1 / 16) -> float:
    """Return the mean radial power of an image's error below a cutoff frequency: 1 for white noise.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
    cutoff : float
        In cycles per pixel, in (0, 1/2], above one cycle per image. Annuli of :func:`radial_average` below it
        have equal weights; the zero frequency is omitted.

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


def mean_spectrum(
    make: Callable[[Any], ArrayLike], keys: Iterable[Any]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of random spectra and its standard error, element by element.

    Parameters
    ----------
    make : Callable
        From a key to a spectrum of points or of an error image, or to anything computed from it, such as a
        radial average. All must have the same shape. Only one at a time is stored.
    keys : Iterable, at least two keys, for independent realisations

    Returns
    -------
    mean, standard_error : float64 arrays, of the shape that ``make`` returns
        The standard error is the root of the sample variance (divisor m - 1) over the number m of keys.

    Examples
    --------
    >>> mean, error = mean_spectrum(lambda key: [key, 2 * key], [1, 3])
    >>> print(mean, error)
    [2. 4.] [1. 2.]
    """
    checks.function("make", make, "from a key to an array")
    try:
        if isinstance(keys, str):
            raise TypeError
        keys = iter(keys)
    except TypeError:
        raise TypeError(f"keys must be an iterable of keys, got {checks.shown(keys)}") from None
    count, mean, squares = 0, np.zeros(()), np.zeros(())
    for key in keys:
        made = make(key)
        spectrum = _arguments.array("make(key)", made, "an array of real numbers").astype(np.float64)
        if count and spectrum.shape != mean.shape:
            raise ValueError(
                f"make must return the same shape for all keys, got {mean.shape} and {spectrum.shape}"
            )
        count += 1
        deviation = spectrum - mean
        mean = mean + deviation / count
        squares = squares + deviation * (spectrum - mean)
    if count < 2:
        raise ValueError(f"keys must be at least two, got {count}")
    return mean, np.sqrt(squares / (count - 1) / count)


def _validate_spectrum(spectrum: ArrayLike, axes: tuple[int, ...]) -> Any:
    array = _arguments.real_array("spectrum", spectrum)
    if array.ndim not in axes or np.prod(array.shape[-2:]) < 2 or not array.size:
        shapes = " or ".join(["(height, width)", "(frames, height, width)"][: len(axes)])
        raise ValueError(f"spectrum must have shape {shapes}, more than one value, got {array.shape}")
    if not isinstance(array, Tracer) and not np.isfinite(array).all():
        raise ValueError(f"spectrum must be finite, got {array[~np.isfinite(array)][0]}")
    return array


def _sums(place: NDArray[np.int64], values: Any) -> Any:
    """Return the sums of the values in each place."""
    if isinstance(values, Tracer):
        return jax.ops.segment_sum(values.ravel(), place.ravel(), int(place.max()) + 1)
    return np.bincount(place.ravel(), weights=values.ravel())


def _annuli(height: int, width: int) -> NDArray[np.int64]:
    """Return the number of the annulus of each element: 0 is that around the mean."""
    longer = max(height, width)
    radius = np.hypot(_frequencies(height, longer)[:, None], _frequencies(width, longer)[None, :])
    return np.floor(radius + 0.5).astype(np.int64)


def _frequencies(size: int, longer: int) -> NDArray[np.float64]:
    """Return the frequencies of one axis, in cycles per ``longer`` pixels."""
    return np.rint(np.fft.fftfreq(size) * size) * longer / size

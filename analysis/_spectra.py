"""How the error of an image is distributed over frequencies."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["error_spectrum", "radial_average"]


def error_spectrum(image: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """Return the power spectrum of the error e of an image, |FFT(e - mean e)|^2 / (N var e).

    The mean over all frequencies is 1, whatever the size of the error, and so is the expectation at
    each of them if the error is white noise. The image is taken as periodic: there is no window.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Both of one shape. Powers and variances of channels are added up before they are divided.

    Returns
    -------
    float64 array, shape (height, width)
        In the layout of ``numpy.fft.fft2``: element [0, 0] is the mean, which is removed, hence 0.

    Raises
    ------
    ValueError
        If the shapes differ, a value is not finite, or the error is constant.

    Examples
    --------
    >>> print(error_spectrum([[1.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]))
    [[0. 4.]
     [0. 0.]]
    """
    given, exact = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    if given.shape != exact.shape:
        raise ValueError(f"image and reference must have one shape, got {given.shape} and {exact.shape}")
    if given.ndim not in (2, 3) or given.size == 0:
        raise ValueError(f"image must have shape (height, width) or (height, width, 3), got {given.shape}")
    channels = (given - exact).reshape(*given.shape[:2], -1)
    if not np.isfinite(channels).all():
        raise ValueError("image and reference must be finite")
    if (channels == channels[0, 0]).all():
        raise ValueError(f"image must differ from reference by more than a constant, got {channels[0, 0]}")
    channels = channels - channels.mean(axis=(0, 1))
    power = np.square(np.abs(np.fft.fft2(channels, axes=(0, 1)))).sum(axis=2)
    power[0, 0] = 0.0
    return power / np.square(channels).sum()


def radial_average(spectrum: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean power in annuli of width 1 around the mean, which is left out.

    Parameters
    ----------
    spectrum : float ArrayLike, shape (height, width)
        In the layout of ``numpy.fft.fft2``, such as from :func:`error_spectrum`.

    Returns
    -------
    frequency : float64 array, shape (max(height, width) // 2,)
        1, 2, ... up to the Nyquist frequency: cycles per longer side of the image. Annulus k
        holds frequencies in [k - 1/2, k + 1/2); the corners beyond the last are left out.
    power : float64 array, of the same shape
        The mean of each annulus.

    Raises
    ------
    ValueError
        If the spectrum is not an array of rows and columns, or a single value.

    Notes
    -----
    Frequencies are measured in space, not in elements of the array: where an image is not square,
    the frequencies along its shorter side are farther apart, and fewer fall into an annulus.

    Examples
    --------
    >>> frequency, power = radial_average([[9.0, 1.0], [3.0, 5.0]])
    >>> print(frequency, power)
    [1.] [3.]
    """
    array = np.asarray(spectrum, np.float64)
    if array.ndim != 2 or array.size < 2:
        raise ValueError(f"spectrum must have shape (height, width), more than one value, got {array.shape}")
    height, width = array.shape
    longer = max(height, width)
    radius = np.hypot(_frequencies(height, longer)[:, None], _frequencies(width, longer)[None, :])
    annulus = np.floor(radius + 0.5).astype(np.int64)
    count = np.bincount(annulus.ravel())
    total = np.bincount(annulus.ravel(), weights=array.ravel())
    wanted = slice(1, longer // 2 + 1)
    return np.arange(1.0, longer // 2 + 1), total[wanted] / count[wanted]


def _frequencies(size: int, longer: int) -> NDArray[np.float64]:
    """Return the frequencies of one axis, in cycles per ``longer`` pixels."""
    return np.rint(np.fft.fftfreq(size) * size) * longer / size

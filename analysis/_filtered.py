"""What is left of an image's error to an eye that does not tell pixels apart."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter

from analysis._spectra import checked_error, error_spectrum, radial_average

__all__ = ["filtered_error", "low_frequency_power"]


def filtered_error(image: ArrayLike, reference: ArrayLike, sigma: float = 1.5) -> float:
    """Return the root mean square of an image's error after a Gaussian filter.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Both of one shape. The image is taken as periodic.
    sigma : float
        Standard deviation of the filter in pixels, positive.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the shapes differ, a value is not finite, or ``sigma`` is not positive.

    Examples
    --------
    >>> print(f"{filtered_error([[1.0, -1.0], [-1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]], 0.5):.4f}")
    0.3297
    """
    error = checked_error(image, reference)
    if not 0 < sigma < np.inf:
        raise ValueError(f"sigma must be positive, got {sigma!r}")
    left = gaussian_filter(error, sigma, mode="wrap", axes=(0, 1))
    return float(np.sqrt(np.mean(np.square(left))))


def low_frequency_power(image: ArrayLike, reference: ArrayLike, cutoff: float = 1 / 16) -> float:
    """Return the mean radial power of an image's error below a frequency: white noise has 1.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
    cutoff : float
        In cycles per pixel, in (0, 1/2]. Annuli of :func:`radial_average` below it count alike, the mean is
        left out.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        As :func:`error_spectrum` does, or if ``cutoff`` is out of range or below the first annulus.

    References
    ----------
    .. [1] R. Ulichney, "Digital Halftoning", 1987: the radially averaged power spectrum.
    """
    frequency, power = radial_average(error_spectrum(image, reference))
    below = frequency < cutoff * max(np.shape(image)[:2])
    if not 0 < cutoff <= 0.5 or not below.any():
        raise ValueError(
            f"cutoff must be in (0, 0.5] and above one cycle per image, got {cutoff!r} for {np.shape(image)}"
        )
    return float(power[below].mean())

"""Errors of images as perceived from a distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._spectra.filtered import weighted_rms


def perceived_error(image: ArrayLike, reference: ArrayLike, distance: float = 2000.0) -> float:
    """Return the root mean square of an image's error, weighted by the contrast sensitivity of the eye.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Of equal shape. The image is taken as periodic.
    distance : float
        From the eye to the image, in pixel widths; positive. At 60 cm from pixels of 0.3 mm it is 2000: 35
        pixels per degree. The larger it is, the coarser is the noise that vanishes.

    Returns
    -------
    float
        At most the root mean square error, its limit as ``distance`` goes to 0. If JAX traces an image, an
        Array of its dtype, differentiable; the gradient is set to 0 where the error is 0.

    Notes
    -----
    The sensitivity to f cycles per degree is that of [1]_, 2.6 (0.0192 + 0.114 f) exp(-(0.114 f)^1.1),
    divided by its maximum near 8 cycles per degree, and 1 below the maximum. The lower sensitivity of the eye
    at low frequencies is measured for patterns at threshold and depends on the distance, while images are
    viewed from many; without it the weights are those of a low-pass filter, and a wrong mean counts in full,
    as is usual for dithering.

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
    return weighted_rms(error, _sensitivity(per_pixel * distance * np.tan(np.radians(1))))


def _sensitivity(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sensitivity at frequencies in cycles per degree, 1 up to that of the maximum."""
    from_peak = np.maximum(frequency, _PEAK)
    return _band(from_peak) / _band(np.array(_PEAK))


def _band(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    u = 0.114 * frequency
    return 2.6 * (0.0192 + u) * np.exp(-(u**1.1))


_PEAK = 7.890914609139
"""The zero of the derivative, 1 - (0.0192 + u) 1.1 u^0.1 at u = 0.114 f."""

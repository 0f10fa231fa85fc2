"""Filters of periodic images in space and time as factors of their waves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checks

_WIDE = 0.4
"""About 1 / sqrt(2 pi): the Gaussian that is its own transform."""

_TERMS = 8
"""Both sums have fewer terms than this on each side: further terms are below 1e-60."""

_DIGITS = 53
"""Digits in base 2 of float64, which bound the memory of a moving average."""


SPACE, TIME = "(rows, columns)", "(frames,)"
"""Shapes of taps, the first at the element itself."""


def moving_average(alpha: float) -> NDArray[np.float64]:
    """Return the taps of an exponential moving average: alpha (1 - alpha)^k for the frame k frames ago.

    Parameters
    ----------
    alpha : float, weight of a new frame, in [1e-5, 1]

    Returns
    -------
    float64 array, shape (frames,)
        For ``time`` of :func:`filtered_error` and of :class:`Filter`. Frames whose weights sum to less than
        2^-53 are left out: there are about 37 / alpha.

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
    if taps.ndim != (2 if axes == SPACE else 1) or not np.isfinite(taps).all() or not taps.sum() > 0:
        raise ValueError(
            f"{name} must be finite taps, of shape {axes} and a positive sum, got {checks.shown(of)}"
        )
    return taps


def transfer(shape: tuple[int, ...], of: float | NDArray[np.float64]) -> NDArray[Any]:
    """Return the factors of the waves of one axis, time, or of two, space, for a known filter, of sum 1."""
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

"""Filters of images in space and time, as weights of pairs of pixels."""

from __future__ import annotations

import math
import numbers
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._spectra.filtered import gaussian_transfer
from qmcjax.core import checks


class Filter(NamedTuple):
    """A filter of animated images, for :func:`expected_error`: one in space times one in time.

    Examples
    --------
    >>> after_10_frames = Filter(space=1.5, time=0.1 * 0.9 ** np.arange(100))
    """

    space: float | ArrayLike = 1.5
    """Standard deviation of a Gaussian in pixels, 0 for none; or taps, shape (rows, columns)."""
    time: float | ArrayLike = 0.0
    """Standard deviation of a Gaussian in frames, 0 for none; or taps, shape (frames,)."""
    weight: float = 1.0
    """Of the mean square error, at least 0: weights are divided by their sum."""


def autocorrelation(shape: tuple[int, ...], filters: Any) -> NDArray[np.float64]:
    """Return the mean autocorrelation of filters on a torus (height, width, frames): the weights of pairs."""
    known: Any = filters
    if isinstance(known, numbers.Real):
        known = Filter(float(known))
    known = [known] if isinstance(known, Filter) else known
    if not isinstance(known, list | tuple) or not known or not all(isinstance(one, Filter) for one in known):
        wanted = "a standard deviation, a Filter, or a list of Filter"
        raise TypeError(f"filters must be {wanted}, got {checks.shown(filters)}")
    weights = [
        _arguments.real("filters.weight", one.weight, "finite and at least 0", lambda w: 0 <= w < math.inf)
        for one in known
    ]
    if not sum(weights) > 0:
        raise ValueError(f"filters must have a positive sum of weights, got {weights}")
    total: Any = 0.0
    for one, weight in zip(known, weights, strict=True):
        space, time = _transfer("space", shape[:2], one.space), _transfer("time", shape[2:], one.time)
        pairs = [np.fft.ifftn(np.square(np.abs(part))).real for part in (space, time)]
        total = total + weight / sum(weights) * pairs[0][:, :, None] * pairs[1]
    return total


def _transfer(name: str, shape: tuple[int, ...], of: Any) -> NDArray[Any]:
    """Return the transform of a filter of sum 1."""
    if np.ndim(of) == 0:
        sigma = _arguments.real(f"filters.{name}", of, "finite and at least 0", lambda s: 0 <= s < math.inf)
        sides = [gaussian_transfer(size, sigma) if sigma else np.ones(size) for size in shape]
        return np.outer(*sides) if len(sides) == 2 else sides[0]
    taps = _arguments.array(f"filters.{name}", of, "an array of real numbers").astype(np.float64)
    if taps.ndim != len(shape) or not np.isfinite(taps).all() or not taps.sum() > 0:
        axes = "(rows, columns)" if len(shape) == 2 else "(frames,)"
        raise ValueError(
            f"filters.{name} must be finite taps, of shape {axes} and a positive sum, got {checks.shown(of)}"
        )
    whole = np.zeros(shape)
    np.add.at(whole, tuple(np.indices(taps.shape) % np.reshape(shape, (-1, *[1] * len(shape)))), taps)
    return np.fft.fftn(whole / taps.sum())

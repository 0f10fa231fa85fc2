"""Filters of images in space and time, as weights of pairs of pixels."""

from __future__ import annotations

import numbers
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._spectra.transfers import SPACE, TIME, transfer, validate_filter
from qmcjax.core import checks


class Filter(NamedTuple):
    """A filter of animated images, for :func:`expected_error`: one in space times one in time.

    Examples
    --------
    >>> from analysis import moving_average
    >>> accumulated = Filter(space=1.5, time=moving_average(0.1))
    """

    space: float | ArrayLike = 1.5
    """Standard deviation of a Gaussian in pixels, 0 for none; or taps, shape (rows, columns)."""
    time: float | ArrayLike = 0.0
    """Standard deviation of a Gaussian in frames, 0 for none; or taps, shape (frames,), as ``np.ones(n)``."""
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
    weights = [_arguments.not_negative("filters.weight", one.weight) for one in known]
    if not sum(weights) > 0:
        raise ValueError(f"filters must have a positive sum of weights, got {weights}")
    total: Any = 0.0
    for one, weight in zip(known, weights, strict=True):
        space = transfer(shape[:2], validate_filter("filters.space", one.space, SPACE))
        time = transfer(shape[2:], validate_filter("filters.time", one.time, TIME))
        pairs = [np.fft.ifftn(np.square(np.abs(part))).real for part in (space, time)]
        total = total + weight / sum(weights) * pairs[0][:, :, None] * pairs[1]
    return total

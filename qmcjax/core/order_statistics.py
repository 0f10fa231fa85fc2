"""An interval of the median, from independent values of any distribution."""

import numpy as np
from numpy.typing import NDArray


def rank(count: int, level: float) -> int:
    """Return the largest k for which the k-th smallest and largest of some values enclose their median.

    With a probability of at least ``level``, whatever the distribution. 0 if there is none: it takes
    1 - log2(1 - level) values.
    """
    from scipy.special import bdtr

    # The median lies outside if fewer than k values are on one of its sides.
    ranks = np.arange(1, count // 2 + 1)
    return int(np.count_nonzero(1 - 2 * bdtr(ranks - 1, count, 0.5) >= level))


def interval(values: NDArray, level: float) -> tuple[NDArray, NDArray]:
    """Return the interval of the median: ``values`` of shape (count, ...) to low and high, shape (...)."""
    place = rank(len(values), level)
    ordered = np.sort(values, axis=0)
    return ordered[place - 1], ordered[len(values) - place]

"""An interval of the median, from independent values of any distribution."""

from typing import Any

import numpy as np


def rank(count: int, level: float) -> int:
    """Return the largest k for which the k-th smallest and largest of some values enclose their median.

    With a probability of at least ``level``, whatever the distribution. 0 if there is none: it takes
    1 - log2(1 - level) values.
    """
    from scipy.special import bdtr

    # The median lies outside if fewer than k values are on one of its sides.
    ranks = np.arange(1, count // 2 + 1)
    return int(np.count_nonzero(1 - 2 * bdtr(ranks - 1, count, 0.5) >= level))


def interval(values: Any, level: float, xp: Any = np) -> tuple[Any, Any]:
    """Return the interval of the median: ``values`` of shape (count, ...) to low and high, shape (...).

    ``xp``: NumPy, or its like for the arrays.
    """
    place = rank(len(values), level)
    ordered = xp.sort(values, axis=0)
    return ordered[place - 1], ordered[len(values) - place]

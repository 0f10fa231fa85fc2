"""Statements about means, judged by intervals: true, false, or neither."""

import numpy as np
from numpy.typing import ArrayLike

from figures.making.schema import UNDECIDED
from qmcjax.core import student


def below(values: ArrayLike, limit: float) -> bool | str:
    """Return whether the mean of independent values is below a limit, by its interval of 95 %.

    `UNDECIDED` if the interval contains the limit.
    """
    low, high = student.interval(np.asarray(values, np.float64))
    return True if high < limit else False if low > limit else UNDECIDED


def smaller(first: ArrayLike, second: ArrayLike, factor: float = 1.0) -> bool | str:
    """Return whether positive values are below ``factor`` times others of the same keys, on average."""
    ratios = np.asarray(first, np.float64) / np.asarray(second, np.float64)
    return below(np.log(ratios), float(np.log(factor)))

"""Student's t intervals for a mean, and for all differences of several means by Holm's procedure."""

import numpy as np
from numpy.typing import NDArray

ERROR = 0.05
"""Probability that an interval, or one of several joint comparisons, is wrong."""

FEWEST = 4
"""Smallest number of values: fewer do not show whether they are nearly normal."""


def interval(values: NDArray[np.float64], error: float = ERROR) -> tuple[float, float]:
    """Return a confidence interval, of 95 %, for the mean of independent values, infinite for fewer than 4.

    The values must be nearly normal: heavy tails make the interval too long, skewness too short.
    """
    from scipy.special import stdtrit

    half = stdtrit(max(1, len(values) - 1), 1 - error / 2) * _standard_error(values)
    return float(values.mean() - half), float(values.mean() + half)


def differences(
    values: NDArray[np.float64], margin: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return intervals for the differences of all pairs of means.

    If an interval lies above the margin, the first mean is larger by more than the margin: with 95 %
    confidence, all these statements about one set of samples are true, and each single interval contains its
    difference.

    ``values``: float64 array, shape (..., conditions, samples, n): value k of one sample is paired with value
    k of the others. Differences of pairs must be independent over k and nearly normal for each condition.
    ``margin``: not negative. Returns ``low, high``, float64 arrays, shape (..., samples, samples): ends of
    the interval of the mean of sample i minus that of sample j, least and largest over the conditions.

    Notes
    -----
    Holm's procedure [1]_ visits the pairs by decreasing statistic, as long as they differ at a level of 5 %
    divided by the number of remaining pairs. All intervals have the level at which it ends. The statistic of
    a pair is the smallest over all conditions: a pair differs if it does under each condition.

    References
    ----------
    .. [1] S. Holm, "A Simple Sequentially Rejective Multiple Test Procedure", 1979.
    """
    from scipy.special import stdtrit

    count, n = values.shape[-2:]
    of_pairs = values[..., :, None, :] - values[..., None, :, :]
    mean, error = of_pairs.mean(axis=-1), _standard_error(of_pairs)
    # Without variance the sign decides.
    above = mean - margin
    signs = np.where(above > 0, np.inf, -np.inf)
    statistic = np.divide(above, error, out=signs, where=error > 0).min(axis=-3)
    first, second = np.triu_indices(count, 1)
    pairs = np.maximum(statistic[..., first, second], statistic[..., second, first])
    left = np.arange(max(1, len(first)), 0, -1)
    needed = stdtrit(max(1, n - 1), 1 - ERROR / 2 / left)
    differ = np.logical_and.accumulate(-np.sort(-pairs, axis=-1) > needed[: len(first)], axis=-1).sum(axis=-1)
    half = needed[np.minimum(differ, len(left) - 1), None, None, None] * error
    return (mean - half).min(axis=-3), (mean + half).max(axis=-3)


def _standard_error(values: NDArray[np.float64]) -> NDArray[np.float64]:
    n = values.shape[-1]
    if n < FEWEST:
        return np.full(values.shape[:-1], np.inf)
    return values.std(axis=-1, ddof=1) / np.sqrt(n)

"""Kinds of intervals over a hundred integrands: coverage, widths, and what a tolerance promises."""

import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.shared.integrands import hundred_integrands
from figures.shared.integrands.hundred_integrands import DIMS, together
from qmcjax import integrate, sequences

LEVEL, ALL = 0.95, "all"
FEW, MANY = "few", "many"
BERNSTEIN = "empirical Bernstein"
"""Not a kind of integrate: of the replicates of "betting"."""

CASES = (
    *((kind, FEW) for kind in ("student", "median", "quantile")),
    *((kind, MANY) for kind in ("student", "median", "quantile", "betting", BERNSTEIN)),
)
"""Kinds of intervals, and few or many replicates."""

REPLICATES = 8
"""With a tolerance."""

TOLERATED = 0.5
"""Tolerances are this part of the mean width of Student's intervals of few replicates."""

Case = tuple[str, str]


class Intervals(NamedTuple):
    """Intervals of all integrands over some keys."""

    held: NDArray[np.bool_]
    """Whether they hold the integral, shape (keys, integrands)."""
    width: NDArray[np.float64]
    """Shape (keys, integrands)."""


class Stopped(NamedTuple):
    """What came back for each key and integrand with a tolerance: arrays of shape (keys, integrands)."""

    held: NDArray[np.bool_]
    """Whether the last interval holds the integral."""
    within: NDArray[np.bool_]
    """Whether the middle of the last interval is within the tolerance of the integral."""
    reached: NDArray[np.bool_]
    n: NDArray[np.int64]
    of_class: NDArray[np.str_]
    """Shape (integrands,)."""


def bernstein(values: NDArray[np.float64], level: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the empirical Bernstein interval of the mean of values in [0, 1], by predictable weights.

    Of several such intervals this is the narrowest known: theorem 2 of Waudby-Smith and Ramdas, "Estimating
    Means of Bounded Random Variables by Betting", 2024. ``values``: shape (count, ...), to low and high.
    """
    count = len(values)
    number = np.arange(1, count + 1.0).reshape(count, *(1,) * (values.ndim - 1))
    mean = (0.5 + np.cumsum(values, axis=0)) / (number + 1)
    variance = (0.25 + np.cumsum((values - mean) ** 2, axis=0)) / (number + 1)
    mean, variance = (
        np.concatenate([np.full_like(of[:1], at), of[:-1]]) for of, at in ((mean, 0.5), (variance, 0.25))
    )
    needed = math.log(2 / (1 - level))
    weight = np.minimum(np.sqrt(2 * needed / (count * variance)), 0.5)
    penalty = ((values - mean) ** 2 * (-np.log1p(-weight) - weight)).sum(axis=0)
    half = (needed + penalty) / weight.sum(axis=0)
    middle = (weight * values).sum(axis=0) / weight.sum(axis=0)
    return np.maximum(middle - half, 0), np.minimum(middle + half, 1)


def measured(
    sizes: Mapping[str, tuple[int, int]], keys: Iterable[int], progress: Callable[[float], None]
) -> dict[Case, Intervals]:
    """Return the intervals of all cases. ``sizes``: few and many replicates, and points of each."""
    sequence, keys = sequences.sobol(DIMS), list(keys)
    exact = np.array([each.integral for each in hundred_integrands.integrands()])
    found: dict[Case, list[tuple]] = {case: [] for case in CASES}
    for k, key in enumerate(keys):
        for kind, size in CASES:
            if kind == BERNSTEIN:
                continue
            replicates, n = sizes[size]
            limits = (0.0, 1.0) if kind == "betting" else None
            made = integrate(
                together, sequence, n, replicates=replicates, key=key, interval=kind, limits=limits
            )
            found[kind, size].append(made.interval(LEVEL))
            if kind == "betting":
                found[BERNSTEIN, size].append(bernstein(np.asarray(made.means), LEVEL))
        progress((k + 1) / len(keys))
    ends = {case: np.asarray(of, np.float64) for case, of in found.items()}
    return {
        case: Intervals((of[:, 0] <= exact) & (exact <= of[:, 1]), of[:, 1] - of[:, 0])
        for case, of in ends.items()
    }


def stopped(
    kind: str,
    width: NDArray[np.float64],
    keys: Iterable[int],
    most: int,
    every: int,
) -> Stopped:
    """Integrate each integrand, or every other, ..., to its tolerance with at most so many points.

    ``width``: mean width of Student's intervals of each integrand.
    """
    sequence, keys = sequences.sobol(DIMS), list(keys)
    chosen = list(zip(hundred_integrands.integrands(), TOLERATED * width, strict=True))[::every]
    level = 1 - (1 - LEVEL) / (1 + max(0, most.bit_length() - 11))  # of 1024 points, 2048, ...
    found = np.empty((len(keys), len(chosen), 4))
    for k, key in enumerate(keys):
        for j, (each, tolerance) in enumerate(chosen):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # "not reached" is counted here
                made = integrate(
                    each.integrand,
                    sequence,
                    most,
                    replicates=REPLICATES,
                    key=key,
                    interval=kind,
                    tolerance=float(tolerance),
                )
            low, high = map(float, made.interval(level))
            off = abs((low + high) / 2 - each.integral)
            found[k, j] = (
                low <= each.integral <= high,
                off <= tolerance,
                (high - low) / 2 <= tolerance,
                made.n,
            )
    held, within, reached, n = np.moveaxis(found, -1, 0)
    classes = np.array([each.of_class for each, _ in chosen])
    return Stopped(held > 0, within > 0, reached > 0, n.astype(int), classes)


def by_class(values: NDArray, classes: NDArray[np.str_]) -> dict[str, float]:
    """Return the means over keys and the integrands of each class, and over all integrands."""
    means = {name: float(values[:, classes == name].mean()) for name in dict.fromkeys(classes.tolist())}
    return means | {ALL: float(values.mean())}

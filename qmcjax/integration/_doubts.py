"""What makes intervals unreliable: values that are all equal, heavy tails, and too few places for points.

References
----------
.. [1] J. R. M. Hosking, J. R. Wallis, "Parameter and Quantile Estimation for the Generalized Pareto
   Distribution", Technometrics 29, 1987.
"""

from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from qmcjax.integration._intervals import RULES, most_unseen

LEAST = float(np.finfo(np.float32).tiny / np.finfo(np.float32).eps)
"""Added to the magnitude of values, since processors may flush subnormal numbers to 0."""

_PLACES = 1024
"""Number of places along a side from which intervals are reliable."""


def doubt(estimate: Any) -> str | None:
    """Return why the intervals of an estimate are unreliable, or None."""
    equal = np.concatenate([np.isinf(leaf).ravel() for leaf in jax.tree.leaves(estimate.unseen)])
    if equal.any():
        count = estimate.n * estimate.replicates
        where = f" of {equal.sum()} of the function's {equal.size} numbers" if equal.size > 1 else ""
        missed = most_unseen(estimate.replicates, estimate.level) / count
        return (
            f"all {count} values seen{where} are equal, and an event with a probability below "
            f"{missed:.2g} may have been missed: pass limits, or more points"
        )
    places = 0.5 / max(float(estimate.displacement), LEAST)
    if places < _PLACES:
        return (
            f"points have about {places:.2g} different places along a side of bounds: "
            "pass a wider dtype, or move the origin"
        )
    rule, tail = RULES[estimate.kind], largest(estimate.tail)
    return f"values are heavy-tailed (index {tail:.2g}): {rule.advice}" if tail > rule.heavy else None


def largest(tree: Any) -> float:
    """Return the largest number of a tree, at least 0."""
    return max(float(np.max(leaf, initial=0)) for leaf in jax.tree.leaves(tree))


def tail_index(values: NDArray) -> NDArray:
    """Return the index of the heavier tail of each column, shape (count, columns), or 0.

    For an index c, values above v have a probability like v**(-1 / c). Their excesses over a large value are
    generalised Pareto, which gives c by L-moments [1]_: here of the 128 largest of 4096 values. 0 if the 32
    largest alone have a negative index, since narrow peaks look heavy from afar; for fewer than 512 values;
    and if at most half of the largest are distinct (counts).
    """
    found = np.zeros(values.shape[1])
    most = min(len(values) // 16, 128)
    if most < 32:
        return found
    for side in (values, -values):
        largest = np.sort(np.partition(side, -most - 1, axis=0)[-most - 1 :], axis=0)
        highest, high = (_pareto_index(largest[-count - 1 :]) for count in (max(most // 4, 16), most))
        found = np.maximum(found, np.where(highest > 0, high, 0))
    return found


def _pareto_index(ordered: NDArray) -> NDArray:
    excesses = ordered[1:] - ordered[0]
    count = len(excesses)
    distinct = np.count_nonzero(np.diff(ordered, axis=0), axis=0) > count // 2
    weights = (2 * np.arange(count) - (count - 1)) / (count - 1)
    mean, half_difference = excesses.mean(axis=0), (weights[:, None] * excesses).mean(axis=0)
    return np.where(distinct, 2 - mean / np.where(distinct, half_difference, 1), 0)

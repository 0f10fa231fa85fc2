"""Indicators of rare and common events: do intervals hold the probability, or say they are not sure."""

import warnings
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.special import stdtrit

from qmcjax import integrate, sequences
from qmcjax.core.pytrees import frozen_pytree

DIMS = 4
LEVEL = 0.95
PROBABILITIES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5)
"""Complements are tried as well."""

LIMITS = (0.0, 1.0)
LEAST = 1e-5
"""Tolerances are a fifth of the probability of the event or its complement, and not less than this."""

_OFFSET = np.modf(np.sqrt([2.0, 3.0, 5.0, 7.0]))[0]
"""Moves events off the grids of the points."""


def _corner(dims: int) -> Callable[[Array, Array], Array]:
    return lambda points, p: jnp.all(points[:, :dims] < p ** (1 / dims), axis=1)


def _centred(points: Array) -> Array:
    return jnp.mod(points + jnp.asarray(_OFFSET, points.dtype)[None], 1) - 0.5


EVENTS: dict[str, Callable[[Array, Array], Array]] = {
    "1-D, end": lambda points, p: points[:, 0] < p,
    "1-D, inside": lambda points, p: abs(_centred(points)[:, 0]) < p / 2,
    "2-D corner": _corner(2),
    "2-D disc": lambda points, p: jnp.sum(_centred(points)[:, :2] ** 2, axis=1) < p / np.pi,
    "2-D diagonal": lambda points, p: abs(jnp.mod(points[:, 0] - points[:, 1], 1) - 0.5) < p / 2,
    "3-D corner": _corner(3),
    "4-D corner": _corner(4),
    "4-D cube": lambda points, p: jnp.all(abs(_centred(points)) < p**0.25 / 2, axis=1),
}
"""Sets of points with the probability p."""


@frozen_pytree
class Event:
    """Whether points are in an event; all have the same program."""

    which: Array
    """int32: number of the event."""
    p: Array
    inside: Array
    """Whether it is the event, or its complement."""

    def __call__(self, points: Array) -> Array:
        """Return bools, shape (rows,)."""
        return jax.lax.switch(self.which, list(EVENTS.values()), points, self.p) == self.inside


class Held(NamedTuple):
    """Of the trials of each event, probability, and itself or its complement: parts, shape (events, p, 2)."""

    held: NDArray[np.float64]
    """By intervals."""
    unsure: NDArray[np.float64]
    """Missed by intervals that say that they are not sure."""
    alone: NDArray[np.float64]
    """By Student's interval of the means alone."""


def _together(points: Array) -> Array:
    """Return whether points are in each event, shape (rows, events, probabilities, 2)."""
    hits = [[event(points, jnp.asarray(p, points.dtype)) for p in PROBABILITIES] for event in EVENTS.values()]
    made = jnp.moveaxis(jnp.asarray(hits), -1, 0)
    return jnp.stack([made, ~made], axis=-1)


EXACT = np.stack([PROBABILITIES, np.subtract(1, PROBABILITIES)], axis=-1)[None]


def cell(n: int, replicates: int, limits: bool, trials: int) -> Held:
    """Return parts of trials, each of which has a key of its own."""
    counts = np.zeros((3, len(EVENTS), len(PROBABILITIES), 2))
    quantile = stdtrit(replicates - 1, (1 + LEVEL) / 2)
    how = {"replicates": replicates, "limits": LIMITS if limits else None}
    for key in jax.random.split(jax.random.key(n + replicates + 2**25 * limits), trials):
        found = integrate(_together, sequences.sobol(DIMS), n, key=key, **how)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # "all values are equal" is counted
            low, high = found.interval(LEVEL)
        held = (low <= EXACT) & (EXACT <= high)
        off = abs(found.means.mean(axis=0) - EXACT)
        error = found.means.std(axis=0, ddof=1) / np.sqrt(replicates)
        counts += held, ~held & ~np.isfinite(found.unseen), off <= quantile * error + found.rounding
    return Held(*counts / trials)


def stop_at_tolerance(keys: range, most: int, limits: bool, which: tuple[int, ...]) -> NDArray[np.bool_]:
    """Integrate all events of some probabilities, by their numbers, to their tolerances.

    Return which reach them, and whether the middle of the interval is within the tolerance, for each event,
    probability, itself or its complement, and key.
    """
    made = np.empty((2, len(EVENTS), len(which), 2, len(keys)), bool)
    how = {"replicates": 8, "limits": LIMITS if limits else None}
    for place in np.ndindex(made.shape[1:]):
        event, j, inside, key = place
        p = PROBABILITIES[which[j]]
        tolerance = max(p / 5, LEAST)
        function = Event(jnp.int32(event), jnp.float32(p), jnp.asarray(bool(inside)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # "not reached" is counted
            given = {"key": keys[key], "tolerance": tolerance, **how}
            found = integrate(function, sequences.sobol(DIMS), most, **given)
            low, high = found.interval(found.level)
        off = abs((low + high) / 2 - (p if inside else 1 - p))
        made[(slice(None), *place)] = found.reached, off <= tolerance
    return made

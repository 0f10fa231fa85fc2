"""Points per second of measures, beside the programs that a user would take instead."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]
from scipy.stats import qmc

import analysis
from figures.shared.timing.measure_scaling import Call, Points, random, sobol
from figures.shared.turns import in_turns, median
from qmcjax import sequences

CALLS = {"draft": 1, "paper": 7}
BUDGET = 6.0
"""Seconds after which no further calls are made."""

NOTE = (
    "Measures: medians of calls after the first, both programs in turns for the same points, float64. "
    "cKDTree is built with boxsize=1 and called with two workers; scipy's L2 star discrepancy is the value "
    "alone, ours includes the gradient."
)


class Peer(NamedTuple):
    """A measure, what a user would take instead, and numbers of points by quality."""

    measure: Call
    peer: Call
    name: str
    dims: int
    draft: int
    paper: int


def lattice(n: int, dims: int, block: int) -> Points:
    return np.asarray(sequences.lattice(dims).points(n, block * n, dtype=jnp.float64))


def clustered(n: int, dims: int, key: int) -> Points:
    """Return points in 16 clusters."""
    rng = np.random.default_rng(key)
    return (rng.random((16, dims))[rng.integers(0, 16, n)] + 0.02 * rng.normal(size=(n, dims))) % 1


FAMILIES: dict[str, Callable[[int, int, int], Points]] = {
    "Sobol'": sobol,
    "random": random,
    "lattice": lattice,
    "clustered": clustered,
}


def nearest_by_tree(points: Points) -> float:
    distances, _ = cKDTree(points, boxsize=1.0).query(points, k=2, workers=2)
    return float(np.asarray(distances)[:, 1].min())


def scipy_l2_star(points: Points) -> float:
    return float(qmc.discrepancy(points, method="L2-star"))


PEERS = {
    f"min distance, {dims}-D": Peer(analysis.min_distance, nearest_by_tree, "cKDTree", dims, 2**14, 2**20)
    for dims in (2, 3)
} | {
    "L2 star and gradient, 2-D": Peer(
        jax.value_and_grad(analysis.l2_star_discrepancy), scipy_l2_star, "scipy", 2, 2**9, 2**14
    ),
}


def measured(quality: str) -> dict[str, dict[str, float]]:
    """Return points per second by measure and points, ours and the peer's."""
    rates: dict[str, dict[str, float]] = {}
    with jax.enable_x64(True):
        for name, case in PEERS.items():
            n = getattr(case, quality)
            calls: dict[str, Callable[[Any], Any]] = {"qmcjax": case.measure, case.name: case.peer}
            for family, draw in FAMILIES.items():
                taken = in_turns(calls, CALLS[quality], BUDGET, partial(draw, n, case.dims))
                rates[f"{name}, {n} points, {family}"] = {who: n / median(of) for who, of in taken.items()}
    return rates

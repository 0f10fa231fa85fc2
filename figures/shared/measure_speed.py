"""Seconds that measures take, peers, and gradients: ``python -m figures.shared.measure_speed draft``.

A process of its own, so that nothing else of a figure's is in it. Prints JSON: medians of calls after the
first, each for other points; the first call, which compiles, apart.
"""

import json
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]
from scipy.stats import qmc

import analysis
from qmcjax import sequences

CALLS = {"draft": 1, "paper": 7}
BUDGET = 6.0
"""Seconds after which no further calls are made."""

Points = NDArray[np.float64]
Measure = Callable[[Any], Any]


def sobol(n: int, dims: int, block: int) -> Points:
    return np.asarray(sequences.sobol(dims).points(n, block * n, dtype=jnp.float64))


def random(n: int, dims: int, key: int) -> Points:
    return np.random.default_rng(key).random((n, dims))


def lattice(n: int, dims: int, block: int) -> Points:
    return np.asarray(sequences.lattice(dims).points(n, block * n, dtype=jnp.float64))


def clustered(n: int, dims: int, key: int) -> Points:
    """Return points in 16 clusters."""
    rng = np.random.default_rng(key)
    return (rng.random((16, dims))[rng.integers(0, 16, n)] + 0.02 * rng.normal(size=(n, dims))) % 1


def on_device(n: int, dims: int, key: int) -> jax.Array:
    return jnp.asarray(random(n, dims, key))


FAMILIES = {"Sobol'": sobol, "random": random, "lattice": lattice, "clustered": clustered}


class Absolute(NamedTuple):
    """A measure, and the seconds that it should take at most."""

    measure: Measure
    dims: int
    draft: int
    paper: int
    asked: float


class Relative(NamedTuple):
    """A measure, what a user would take instead, and how many times as fast as that it should be at least."""

    measure: Measure
    peer: Measure
    dims: int
    draft: int
    paper: int
    asked: float


class Gradient(NamedTuple):
    """A differentiable measure. Drafts take the first ones only."""

    measure: Measure
    dims: int
    paper: int


def nearest_by_tree(points: Points) -> float:
    distances, _ = cKDTree(points, boxsize=1.0).query(points, k=2, workers=2)
    return float(np.asarray(distances)[:, 1].min())


def scipy_l2_star(points: Points) -> float:
    return float(qmc.discrepancy(points, method="L2-star"))


def spectrum(resolution: int, method: Any) -> Measure:
    return lambda points: jnp.square(analysis.point_spectrum(points, resolution, method)).sum()


ABSOLUTE = {
    "star, 2-D, 2^14": Absolute(analysis.star_discrepancy, 2, 2**10, 2**14, 0.05),
    "star, 2-D, 2^16": Absolute(analysis.star_discrepancy, 2, 2**12, 2**16, 0.25),
    "star, 3-D, 4096": Absolute(analysis.star_discrepancy, 3, 2**9, 2**12, 0.3),
}
RELATIVE = {
    "min distance, 2-D, 2^20 / cKDTree": Relative(
        analysis.min_distance, nearest_by_tree, 2, 2**14, 2**20, 2.5
    ),
    "min distance, 3-D, 2^20 / cKDTree": Relative(
        analysis.min_distance, nearest_by_tree, 3, 2**14, 2**20, 2.5
    ),
    "L2 star, 2-D, 2^14, value and gradient / scipy's value": Relative(
        jax.value_and_grad(analysis.l2_star_discrepancy), scipy_l2_star, 2, 2**9, 2**14, 8.0
    ),
}
ASKED_RATIO = 4.0
DRAFT_GRADIENTS, DRAFT_POINTS = 2, 2**8
GRADIENTS = {
    "soft min distance, 2-D": Gradient(analysis.soft_min_distance, 2, 2**11),
    "spectrum 65 x 65, direct": Gradient(spectrum(65, "direct"), 2, 2**14),
    "spectrum 129 x 129, FFT": Gradient(spectrum(129, "fft"), 2, 2**14),
    "spectrum 17 x 17 x 17, direct": Gradient(spectrum(17, "direct"), 3, 2**11),
    "soft min distance, 3-D": Gradient(analysis.soft_min_distance, 3, 2**11),
    "Riesz energy, 2-D": Gradient(analysis.riesz_energy, 2, 2**11),
    "Riesz energy, 3-D": Gradient(analysis.riesz_energy, 3, 2**11),
    **{
        f"{name}, 2-D": Gradient(getattr(analysis, f"{name}_discrepancy"), 2, 2**14)
        for name in ("l2_star", "centered", "wraparound", "periodic", "symmetric", "mixture")
    },
    **{
        f"l2_star, {dims}-D": Gradient(analysis.l2_star_discrepancy, dims, 2**11)
        for dims in (1, 3, 4, 8, 16, 64)
    },
    "mixture, 8-D": Gradient(analysis.mixture_discrepancy, 8, 2**11),
}


def seconds(
    calls: list[Measure], draw: Callable[[int], Any], repeats: int
) -> tuple[list[float], list[float]]:
    """Return the first and the median of the later times of each call, in turns for the same points."""
    times: list[list[float]] = [[] for _ in calls]
    begin = time.perf_counter()
    for i in range(repeats + 1):
        points = jax.block_until_ready(draw(i))
        for call, taken in zip(calls, times, strict=True):
            start = time.perf_counter()
            jax.block_until_ready(call(points))
            taken.append(time.perf_counter() - start)
        if i and time.perf_counter() - begin > BUDGET:
            break
    return [taken[0] for taken in times], [float(np.median(taken[1:])) for taken in times]


def main(quality: str) -> None:
    """Measure and print."""
    repeats = CALLS[quality]
    absolute, relative, gradients = {}, {}, {}
    with jax.enable_x64(True):
        for name, case in ABSOLUTE.items():
            n = getattr(case, quality)
            absolute[name] = {"n": n, "asked": case.asked, "seconds": {}}
            for family, draw in FAMILIES.items():
                _, (taken,) = seconds([case.measure], partial(draw, n, case.dims), repeats)
                absolute[name]["seconds"][family] = taken
        for name, case in RELATIVE.items():
            n = getattr(case, quality)
            entry = relative[name] = {"n": n, "asked": case.asked, "seconds": {}, "peer": {}, "ratio": {}}
            for family, draw in FAMILIES.items():
                _, both = seconds([case.measure, case.peer], partial(draw, n, case.dims), repeats)
                entry["seconds"][family], entry["peer"][family] = both
                entry["ratio"][family] = both[1] / both[0]
        listed = list(GRADIENTS.items())
        for name, case in listed if quality == "paper" else listed[:DRAFT_GRADIENTS]:
            n = case.paper if quality == "paper" else DRAFT_POINTS
            calls = [case.measure, jax.value_and_grad(case.measure)]
            first, both = seconds(calls, partial(on_device, n, case.dims), repeats)
            gradients[name] = {
                "n": n,
                "value": both[0],
                "value and gradient": both[1],
                "ratio": both[1] / both[0],
                "first calls": first,
            }
    print(json.dumps({"seconds": absolute, "against peers": relative, "gradients": gradients}))


if __name__ == "__main__":
    main(sys.argv[1])

"""Time, memory, peers and gradients of measures of points: ``python -m figures.shared.measure_cost draft``.

A process of its own, since the peak of its memory is read. Prints JSON.
"""

import json
import sys
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
from figures.shared.peak_memory import peak_of
from figures.shared.turns import Seconds, in_turns, median, timed
from qmcjax import sequences

Points = NDArray[np.float64]
Call = Callable[[Any], Any]

CALLS = {"draft": 1, "paper": 7}
BUDGET = 6.0
"""Seconds after which no further calls are made beside peers or with gradients."""


class Measure(NamedTuple):
    """A measure, its dimensions, and the numbers of points as exponents of 2, the last by quality."""

    call: Call
    dims: int
    first: int
    draft: int
    paper: int
    theory: tuple[float, int]
    """The exponents of n, and of its logarithm."""
    compiles: bool = False
    """Whether JAX compiles it for each n: the second call is measured, and drafts do without."""


def spectrum(resolution: int, method: Any) -> Call:
    return lambda points: analysis.point_spectrum(points, resolution, method)


MEASURES = {
    "star discrepancy, 2-D": Measure(analysis.star_discrepancy_bounds, 2, 14, 17, 22, (1.5, 0)),
    "star discrepancy, bounds, 3-D": Measure(analysis.star_discrepancy_bounds, 3, 19, 0, 24, (1.0, 0)),
    "min distance, 2-D": Measure(analysis.min_distance, 2, 14, 18, 24, (1.0, 1)),
    "min distance, 3-D": Measure(analysis.min_distance, 3, 14, 18, 24, (1.0, 1)),
    "L2 star discrepancy, 2-D": Measure(analysis.l2_star_discrepancy, 2, 16, 0, 24, (1.0, 1)),
    "L2 star discrepancy, 3-D": Measure(analysis.l2_star_discrepancy, 3, 16, 0, 22, (1.0, 2)),
    "dispersion, 2-D": Measure(analysis.dispersion, 2, 16, 0, 22, (1.0, 1)),
    "spectrum 65 x 65, FFT": Measure(spectrum(65, "fft"), 2, 16, 0, 22, (1.0, 0), True),
    "spectrum 17 x 17 x 17, direct": Measure(spectrum(17, "direct"), 3, 16, 0, 22, (1.0, 0), True),
}


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


class Peer(NamedTuple):
    """A measure, what a user would take instead, and how many times as fast as that it should be at least."""

    measure: Call
    peer: Call
    dims: int
    draft: int
    paper: int
    asked: float


def nearest_by_tree(points: Points) -> float:
    distances, _ = cKDTree(points, boxsize=1.0).query(points, k=2, workers=2)
    return float(np.asarray(distances)[:, 1].min())


def scipy_l2_star(points: Points) -> float:
    return float(qmc.discrepancy(points, method="L2-star"))


PEERS = {
    f"min distance, {dims}-D, 2^20 / cKDTree": Peer(
        analysis.min_distance, nearest_by_tree, dims, 2**14, 2**20, 2.5
    )
    for dims in (2, 3)
} | {
    "L2 star, 2-D, 2^14, value and gradient / scipy's value": Peer(
        jax.value_and_grad(analysis.l2_star_discrepancy), scipy_l2_star, 2, 2**9, 2**14, 8.0
    ),
}


def power(resolution: int, method: Any) -> Call:
    return lambda points: jnp.square(analysis.point_spectrum(points, resolution, method)).sum()


def of_image(measure: Callable[[Any, Any], Any]) -> Call:
    """Return a compiled measure of the coordinates of points, as an image of 128 rows."""
    return jax.jit(lambda points: measure(points.reshape(128, -1), np.zeros((128, points.size // 128))))


ASKED_RATIO = 4.0
DRAFT_GRADIENTS, DRAFT_POINTS = 2, 2**8
GRADIENTS: dict[str, tuple[Call, int, int]] = {
    "soft min distance, 2-D": (analysis.soft_min_distance, 2, 2**11),
    "spectrum 65 x 65, direct": (power(65, "direct"), 2, 2**14),
    "spectrum 129 x 129, FFT": (power(129, "fft"), 2, 2**14),
    "spectrum 17 x 17 x 17, direct": (power(17, "direct"), 3, 2**11),
    "soft min distance, 3-D": (analysis.soft_min_distance, 3, 2**11),
    "Riesz energy, 2-D": (analysis.riesz_energy, 2, 2**11),
    "Riesz energy, 3-D": (analysis.riesz_energy, 3, 2**11),
    **{
        f"{name}, 2-D": (getattr(analysis, f"{name}_discrepancy"), 2, 2**14)
        for name in ("l2_star", "centered", "wraparound", "periodic", "symmetric", "mixture")
    },
    **{f"l2_star, {dims}-D": (analysis.l2_star_discrepancy, dims, 2**11) for dims in (1, 3, 4, 8, 16, 64)},
    "mixture, 8-D": (analysis.mixture_discrepancy, 8, 2**11),
    "star, 2-D": (analysis.star_discrepancy, 2, 2**14),
    "star, 3-D": (analysis.star_discrepancy, 3, 2**9),
    "soft star, 2-D": (analysis.soft_star_discrepancy, 2, 2**7),
    "min distance, 2-D": (analysis.min_distance, 2, 2**16),
    "nearest distances, 2-D": (lambda points: jnp.sum(analysis.nearest_distances(points)), 2, 2**14),
    "dispersion, 2-D": (analysis.dispersion, 2, 2**14),
    "filtered error, 128 x 256": (of_image(analysis.filtered_error), 2, 2**14),
    "perceived error, 128 x 256": (of_image(analysis.perceived_error), 2, 2**14),
    "error spectrum, 128 x 256": (of_image(lambda *of: jnp.sum(analysis.error_spectrum(*of) ** 2)), 2, 2**14),
    "low frequencies, 128 x 256": (of_image(analysis.low_frequency_power), 2, 2**14),
}
"""Differentiable measures, dimensions and numbers of points. Drafts take the first ones only."""


def scaling(measure: Measure, last: int) -> dict[str, Any]:
    """Return time and memory up to 2^last points."""
    rows: dict[str, Any] = {key: [] for key in ("n", "seconds", "processor seconds", "bytes")}
    every = sobol(2**last, measure.dims, 0)
    for m in range(last, measure.first - 1, -2)[::-1]:
        if measure.compiles or not rows["n"]:  # for other points, or to load what Numba compiled
            jax.block_until_ready(measure.call(random(2**m, measure.dims, m)))
        taken: list[Seconds] = []
        rows["bytes"].append(
            peak_of(lambda given: taken.append(timed(measure.call, given)[1]), every[: 2**m])  # noqa: B023
        )
        rows["n"].append(2**m)
        rows["seconds"].append(taken[0].clock)
        rows["processor seconds"].append(taken[0].processors)
    return rows | {"theory": measure.theory, "dims": measure.dims}


def seconds(calls: list[Call], draw: Callable[[int], Any], repeats: int) -> list[float]:
    """Return the median of the times of each call after the first, in turns for the same points."""
    taken = in_turns(dict(zip(map(str, calls), calls, strict=True)), repeats, BUDGET, draw)
    return [median(of) for of in taken.values()]


def main(quality: str) -> None:
    """Measure and print."""
    repeats, draft = CALLS[quality], quality == "draft"
    peers: dict[str, dict[str, Any]] = {}
    gradients = {}
    with jax.enable_x64(True):
        scaled = {
            name: scaling(measure, getattr(measure, quality))
            for name, measure in MEASURES.items()
            if getattr(measure, quality) >= measure.first
        }
        for name, case in PEERS.items():
            n = getattr(case, quality)
            entry = peers[name] = {"n": n, "asked": case.asked, "seconds": {}, "peer": {}, "ratio": {}}
            for family, draw in FAMILIES.items():
                ours, theirs = seconds([case.measure, case.peer], partial(draw, n, case.dims), repeats)
                entry["seconds"][family], entry["peer"][family] = ours, theirs
                entry["ratio"][family] = theirs / ours
        for name, (call, dims, most) in list(GRADIENTS.items())[: DRAFT_GRADIENTS if draft else None]:
            n = DRAFT_POINTS if draft else most
            value, both = seconds([call, jax.value_and_grad(call)], partial(on_device, n, dims), repeats)
            gradients[name] = {"n": n, "value": value, "value and gradient": both, "ratio": both / value}
    print(json.dumps({"scaling": scaled, "against peers": peers, "gradients": gradients}))


if __name__ == "__main__":
    main(sys.argv[1])

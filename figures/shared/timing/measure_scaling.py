"""Time and memory of measures over numbers of points, in a separate process: its peak of memory is read."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

import analysis
from figures.shared.costs import Seconds, peak_of, timed
from qmcjax import sequences

Points = NDArray[np.float64]
Call = Callable[[Any], Any]


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
    "L2 star discrepancy, 2-D": Measure(analysis.l2_star_discrepancy, 2, 12, 0, 16, (2.0, 0), True),
    "L2 star discrepancy, 3-D": Measure(analysis.l2_star_discrepancy, 3, 12, 0, 16, (2.0, 0), True),
    "dispersion, 2-D": Measure(analysis.dispersion, 2, 16, 0, 22, (1.0, 1)),
    "spectrum 65 x 65, FFT": Measure(spectrum(65, "fft"), 2, 16, 0, 22, (1.0, 0), True),
    "spectrum 17 x 17 x 17, direct": Measure(spectrum(17, "direct"), 3, 16, 0, 22, (1.0, 0), True),
}


def sobol(n: int, dims: int, block: int) -> Points:
    return np.asarray(sequences.sobol(dims).points(n, block * n, dtype=jnp.float64))


def random(n: int, dims: int, key: int) -> Points:
    return np.random.default_rng(key).random((n, dims))


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


def measure(quality: str) -> dict[str, dict[str, Any]]:
    """Return time and memory by measure."""
    with jax.enable_x64(True):
        return {
            name: scaling(measure, getattr(measure, quality))
            for name, measure in MEASURES.items()
            if getattr(measure, quality) >= measure.first
        }

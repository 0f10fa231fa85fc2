"""Time and memory of measures of millions of points: ``python -m figures.shared.measure_scaling draft``.

A process of its own, since the peak of its memory is read. Prints JSON.
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

import analysis
from figures.shared.peak_memory import peak_of
from qmcjax import sequences

Points = NDArray[np.float64]


class Measure(NamedTuple):
    """A measure, its dimensions, and the numbers of points as exponents of 2, the last by quality."""

    call: Callable[[Points], Any]
    dims: int
    first: int
    draft: int
    paper: int
    theory: tuple[float, int]
    """The exponents of n, and of its logarithm."""
    compiles: bool = False
    """Whether JAX compiles it for each n: the second call is measured, and drafts do without."""


def spectrum(resolution: int, method: Any) -> Callable[[Points], Any]:
    return lambda points: analysis.point_spectrum(points, resolution, method)


MEASURES = {
    "star discrepancy, 2-D": Measure(analysis.star_discrepancy_bounds, 2, 17, 17, 22, (1.5, 0)),
    "star discrepancy, bounds, 3-D": Measure(analysis.star_discrepancy_bounds, 3, 19, 0, 24, (1.0, 0)),
    "min distance, 2-D": Measure(analysis.min_distance, 2, 14, 18, 24, (1.0, 1)),
    "min distance, 3-D": Measure(analysis.min_distance, 3, 14, 18, 24, (1.0, 1)),
    "L2 star discrepancy, 2-D": Measure(analysis.l2_star_discrepancy, 2, 16, 0, 24, (1.0, 1)),
    "L2 star discrepancy, 3-D": Measure(analysis.l2_star_discrepancy, 3, 16, 0, 22, (1.0, 2)),
    "dispersion, 2-D": Measure(analysis.dispersion, 2, 16, 0, 22, (1.0, 1)),
    "spectrum 65 x 65, FFT": Measure(spectrum(65, "fft"), 2, 16, 0, 22, (1.0, 0), True),
    "spectrum 17 x 17 x 17, direct": Measure(spectrum(17, "direct"), 3, 16, 0, 22, (1.0, 0), True),
}


def timed(measure: Measure, taken: list[tuple[float, float]], given: Points) -> None:
    """Measure, and note the seconds of the call, and those of all processors."""
    start, busy = time.perf_counter(), time.process_time()
    jax.block_until_ready(measure.call(given))
    taken.append((time.perf_counter() - start, time.process_time() - busy))


def main(quality: str) -> None:
    """Measure and print."""
    measured: dict[str, dict[str, Any]] = {}
    with jax.enable_x64(True):
        for name, measure in MEASURES.items():
            last = getattr(measure, quality)
            if last < measure.first:
                continue
            rows = measured[name] = {key: [] for key in ("n", "seconds", "processor seconds", "bytes")}
            rows |= {"theory": measure.theory, "dims": measure.dims}
            every = np.asarray(sequences.sobol(measure.dims).points(2**last, dtype=jnp.float64))
            for m in range(last, measure.first - 1, -2)[::-1]:
                if measure.compiles or not rows["n"]:  # for other points, or to load what Numba compiled
                    others = np.random.default_rng(m).random((2**m, measure.dims))
                    jax.block_until_ready(measure.call(others))
                taken: list[tuple[float, float]] = []
                call = partial(timed, measure, taken)
                rows["bytes"].append(peak_of(call, every[: 2**m]))
                rows["n"].append(2**m)
                rows["seconds"].append(taken[0][0])
                rows["processor seconds"].append(taken[0][1])
            print(f"{name} done", file=sys.stderr)
    print(json.dumps(measured))


if __name__ == "__main__":
    main(sys.argv[1])

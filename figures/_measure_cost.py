"""Time and memory of the measures of points: ``python -m figures._measure_cost draft``.

A process of its own, since the peak of its memory is read. Prints JSON.
"""

import ctypes
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

import analysis
from qmcjax import sequences

CALLS = {"draft": 1, "paper": 3}
RESOLUTION = 65


class Measure(NamedTuple):
    """A measure, dimensions, and the numbers of points, as exponents of 2: the least, the most by quality."""

    call: Callable[[Any], Any]
    dims: int
    least: int
    draft: int
    paper: int


def gradient(measure: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return value and gradient of a measure in float64."""
    differentiated = jax.jit(jax.value_and_grad(measure))

    def call(points: NDArray[np.float64]) -> Any:
        with jax.enable_x64(True):
            return differentiated(jnp.asarray(points))

    return call


def in_float64(measure: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a measure that takes float64 points where JAX has no 64-bit types."""

    def call(points: NDArray[np.float64]) -> Any:
        with jax.enable_x64(True):
            return measure(points)

    return call


MEASURES = {
    "star discrepancy, 2-D": Measure(analysis.star_discrepancy, 2, 8, 12, 17),
    "star discrepancy, 3-D": Measure(analysis.star_discrepancy, 3, 6, 9, 12),
    "L2 star, 2-D": Measure(analysis.l2_star_discrepancy, 2, 8, 12, 18),
    "L2 star, 5-D": Measure(analysis.l2_star_discrepancy, 5, 7, 10, 14),
    "L2 star, 2-D, with gradient": Measure(gradient(analysis.l2_star_discrepancy), 2, 8, 12, 18),
    "centred, 2-D": Measure(analysis.centered_discrepancy, 2, 8, 11, 15),
    "min distance, 2-D": Measure(analysis.min_distance, 2, 10, 15, 22),
    "min distance, 3-D": Measure(analysis.min_distance, 3, 10, 14, 21),
    "nearest distances, 2-D": Measure(analysis.nearest_distances, 2, 10, 14, 19),
    "dispersion, 2-D": Measure(analysis.dispersion, 2, 8, 12, 17),
    "dispersion, 3-D": Measure(analysis.dispersion, 3, 7, 10, 14),
    "soft min distance, 2-D": Measure(in_float64(analysis.soft_min_distance), 2, 7, 11, 14),
    "spectrum 65 x 65, direct": Measure(
        lambda points: analysis.point_spectrum(points, RESOLUTION, "direct"), 2, 8, 12, 16
    ),
    "spectrum 65 x 65, FFT": Measure(
        lambda points: analysis.point_spectrum(points, RESOLUTION, "fft"), 2, 8, 14, 20
    ),
    "t, 2-D, by counting": Measure(analysis.t_value, 2, 8, 12, 18),
}


def peak_of(call: Callable[[Any], Any], points: Any) -> int | None:
    """Return by how many bytes a call raises the memory in use at most, where the system tells (Linux)."""
    if sys.platform != "linux":
        return None
    # What earlier calls freed goes back to the system, and the peak so far is forgotten.
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc has it
    if trim is not None:
        trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    before = _status("VmRSS")
    jax.block_until_ready(call(points))
    return _status("VmHWM") - before


def _status(key: str) -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{key}:")[1].split()[0]) * 1024


def main(quality: str) -> None:
    """Measure on random points, new ones in each call, and print."""
    measured: dict[str, dict[str, list]] = {}
    step = 1 if quality == "paper" else 2
    for name, measure in MEASURES.items():
        rows = measured[name] = {"n": [], "seconds": [], "bytes": []}
        for m in range(measure.least, getattr(measure, quality) + 1, step):
            sets = [
                np.asarray(sequences.uniform(measure.dims, key).points(2**m, dtype=jnp.float64))
                for key in range(CALLS[quality] + 1)
            ]
            jax.block_until_ready(measure.call(sets[0]))  # compiles
            times = []
            for points in sets[1:]:
                start = time.perf_counter()
                jax.block_until_ready(measure.call(points))
                times.append(time.perf_counter() - start)
            rows["n"].append(2**m)
            rows["seconds"].append(float(np.median(times)))
            rows["bytes"].append(peak_of(measure.call, sets[1]))
        print(f"{name} done", file=sys.stderr)
    print(json.dumps(measured))


if __name__ == "__main__":
    main(sys.argv[1])

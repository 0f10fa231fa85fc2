"""Images by us and by the programs a user would take instead, in a separate process.

The checkerboard and the zone plate, with one scrambled Sobol' sequence in contiguous blocks of pixels: times
of the calls after the first, each with a new key, that of the first, and errors.
"""

import contextlib
import subprocess
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import qmcjax as qj
from figures._cpp import compiled
from figures._errors import rms
from figures.shared import costs
from qmcjax import orders, samplers, scenes, sequences

SIZES = {"draft": (128, (4, 16), 2), "paper": (512, (4, 16, 64, 256), 7)}
"""Side of the image, samples per pixel, calls after the first."""

SCENES = {"checkerboard": scenes.checkerboard(), "zone_plate": scenes.zone_plate()}

ROWS = 16
"""Of pixels that NumPy and torch hold the samples of at a time: more do not fit into the cache."""

Render = Callable[[int], NDArray[np.float32]]
"""Makes an image, by key."""


def ours(name: str, side: int, spp: int, adaptive: bool = False) -> Render:
    """Return our rendering along the Hilbert curve, which may skip constant pixels."""
    order, sobol = orders.hilbert(side, side), sequences.sobol(2)

    def render(key: int) -> NDArray[np.float32]:
        sampler = samplers.contiguous(order, sequences.owen(sobol, key), spp)
        if adaptive:
            return np.asarray(qj.render_adaptive(SCENES[name], sampler, side, side, spp).image)
        return np.asarray(qj.render(SCENES[name], sampler, side, side, spp))

    return render


def in_rows(xp: Any, draw: Callable[[int], Any], name: str, side: int, spp: int) -> NDArray[np.float32]:
    """Return an image, some rows at a time, by the functions of NumPy or torch."""
    image = np.empty((side, side), np.float32)
    columns = xp.arange(side)[None, :, None]
    for y in range(0, side, ROWS):
        count = min(ROWS, side - y)
        points = draw(count * side * spp).reshape(count, side, spp, 2)
        rows = xp.arange(y, y + count)[:, None, None]
        values = value(xp, name, (points[..., 0] + columns) / side, (points[..., 1] + rows) / side)
        image[y : y + count] = values.mean(2)
    return image


def value(xp: Any, name: str, x: Any, y: Any) -> Any:
    """Evaluate a scene with the functions of NumPy or torch."""
    if name == "zone_plate":
        return 0.5 + 0.5 * xp.sin(1600.0 * (x * x + y * y))
    depth = 8.0 / y
    half = 0.5 * (xp.floor((x - 0.5) * depth) + xp.floor(depth))
    return 1.0 - 2.0 * (half - xp.floor(half))


def numpy_and_scipy(name: str, side: int, spp: int) -> Render:
    """Return the rendering of NumPy with scipy's engine."""
    from scipy.stats import qmc

    def render(key: int) -> NDArray[np.float32]:
        engine = qmc.Sobol(2, scramble=True, rng=key)
        return in_rows(np, engine.random, name, side, spp)

    return render


def torch_engine(name: str, side: int, spp: int) -> Render | None:
    """Return the rendering of torch on the CPU, if it is installed."""
    with contextlib.suppress(ImportError):
        import torch  # pyright: ignore[reportMissingImports]

        def render(key: int) -> NDArray[np.float32]:
            engine = torch.quasirandom.SobolEngine(2, scramble=True, seed=key)
            return in_rows(torch, engine.draw, name, side, spp)

        return render
    return None


def cpp(program: Path, name: str, side: int, spp: int) -> Callable[[int], tuple[float, NDArray[np.float32]]]:
    """Return the rendering of the C++ reference, which takes its own time, also after another image."""
    path = program.with_name("image.raw")

    def timed(key: int) -> tuple[float, NDArray[np.float32]]:
        command = [str(program), name, str(side), str(spp), str(key), str(path)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return float(done.stdout), np.fromfile(path, np.float32).reshape(side, side)

    return timed


def timed(render: Render) -> Callable[[int], tuple[float, NDArray[np.float32]]]:
    """Return an image with the time it takes, after one that wakes its threads and fills the caches.

    The first turn's only call compiles.
    """

    def run(key: int) -> tuple[float, NDArray[np.float32]]:
        if key > 0:
            render(-key % 2**32)
        image, seconds = costs.timed(render, key)
        return seconds.clock, image

    return run


@cache
def reference(name: str, height: int, width: int) -> tuple[NDArray[np.float64], float]:
    """Return the exact image of a scene."""
    return SCENES[name].reference(width, height)


def error(name: str, image: NDArray[np.float32]) -> float:
    """Return the root mean square error of an image."""
    exact, _ = reference(name, *image.shape)
    return rms(image - exact)


def measure(quality: str) -> dict[str, Any]:
    """Return a row for each image; the programs take turns, with a new key in each."""
    warnings.simplefilter("ignore")
    side, counts, calls = SIZES[quality]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        program = compiled(Path(folder))
        for name in SCENES:
            for spp in counts:
                programs = {
                    "qmcjax": timed(ours(name, side, spp)),
                    "qmcjax, adaptive": timed(ours(name, side, spp, adaptive=True)),
                    "NumPy + scipy": timed(numpy_and_scipy(name, side, spp)),
                }
                torch = torch_engine(name, side, spp)
                if torch is not None:
                    programs["torch"] = timed(torch)
                if program is not None:
                    programs["C++, OpenMP"] = cpp(program, name, side, spp)
                found = {who: [run(0)] for who, run in programs.items()}
                for key in range(1, calls + 1):
                    for who, run in programs.items():
                        found[who].append(run(key))
                for who, results in found.items():
                    seconds = [result[0] for result in results]
                    errors = [error(name, image) for _, image in results]
                    row = {"scene": name, "spp": spp, "program": who, "seconds": seconds[1:]}
                    rows.append(row | {"first": seconds[0], "error": rms(errors)})
    return {"side": side, "rows": rows}

"""Frames by us and by what a user would take instead: ``python -m figures._peers draft``.

The checkerboard and the zone plate, with one scrambled Sobol' sequence in contiguous blocks of pixels. Prints
JSON: times of the calls after the first, each with a new key, that of the first, and errors.
"""

import contextlib
import json
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

import qmcjax as qj
from figures._cpp import compiled
from qmcjax import orders, samplers, scenes, sequences

SIZES = {"draft": (128, (16,), 2), "paper": (512, (4, 16, 64, 256), 7)}
"""Side of the image, samples per pixel, calls after the first."""

SCENES = {"checkerboard": scenes.checkerboard(), "zone_plate": scenes.zone_plate()}

ROWS = 16
"""Of pixels that NumPy and torch hold the samples of at a time: more do not fit into the cache."""

Frame = Callable[[int], NDArray[np.float32]]


def ours(name: str, side: int, spp: int) -> Frame:
    """Return our frame by key, along the Hilbert curve."""
    order, sobol = orders.hilbert(side, side), sequences.sobol(2)

    def frame(key: int) -> NDArray[np.float32]:
        sampler = samplers.contiguous(order, sequences.owen(sobol, key), spp)
        return np.asarray(qj.render(SCENES[name], sampler, side, side, spp))

    return frame


def adaptive(name: str, side: int, spp: int) -> Frame:
    """Return our frame where constant pixels are skipped."""
    order, sobol = orders.hilbert(side, side), sequences.sobol(2)

    def frame(key: int) -> NDArray[np.float32]:
        sampler = samplers.contiguous(order, sequences.owen(sobol, key), spp)
        return np.asarray(qj.render(SCENES[name], sampler, side, side, spp, adaptive=True).image)

    return frame


def in_rows(xp: Any, draw: Callable[[int], Any], name: str, side: int, spp: int) -> NDArray[np.float32]:
    """Return a frame, some rows at a time, by the functions of NumPy or torch."""
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


def numpy_and_scipy(name: str, side: int, spp: int) -> Frame:
    """Return a frame of NumPy with scipy's engine."""
    from scipy.stats import qmc

    def frame(key: int) -> NDArray[np.float32]:
        engine = qmc.Sobol(2, scramble=True, rng=key)
        return in_rows(np, engine.random, name, side, spp)

    return frame


def torch_frame(name: str, side: int, spp: int) -> Frame | None:
    """Return a frame of torch on the CPU, if it is installed."""
    with contextlib.suppress(ImportError):
        import torch  # pyright: ignore[reportMissingImports]

        def frame(key: int) -> NDArray[np.float32]:
            engine = torch.quasirandom.SobolEngine(2, scramble=True, seed=key)
            return in_rows(torch, engine.draw, name, side, spp)

        return frame
    return None


def cpp(program: Path, name: str, side: int, spp: int, calls: int) -> dict:
    """Measure the C++ reference."""
    image = program.with_name("image.raw")
    command = [str(program), name, str(side), str(spp), str(calls), str(image)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {
        "seconds": [float(line) for line in done.stdout.split()],
        "first": None,
        "error": error(name, np.fromfile(image, np.float32).reshape(side, side)),
    }


def error(name: str, image: NDArray[np.float32]) -> float:
    """Return the root mean square error of an image."""
    exact = SCENES[name].reference(*image.shape)[0]
    return float(np.sqrt(np.mean((image - exact) ** 2)))


def measured(name: str, frame: Frame, calls: int) -> dict:
    """Measure a frame of several keys."""
    times, errors = [], []
    for key in range(calls + 1):
        start = time.perf_counter()
        image = frame(key)
        times.append(time.perf_counter() - start)
        errors.append(error(name, image))
    return {"seconds": times[1:], "first": times[0], "error": float(np.sqrt(np.mean(np.square(errors))))}


def main(quality: str) -> None:
    """Measure, all programs for one scene and number of samples after another, and print."""
    warnings.simplefilter("ignore")
    side, counts, calls = SIZES[quality]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        program = compiled(Path(folder))
        for name in SCENES:
            for spp in counts:
                frames = {
                    "qmcjax": ours(name, side, spp),
                    "qmcjax, adaptive": adaptive(name, side, spp),
                    "NumPy + scipy": numpy_and_scipy(name, side, spp),
                    "torch": torch_frame(name, side, spp),
                }
                for who, frame in frames.items():
                    if frame is not None:
                        few = calls if spp * side * side <= 2**22 or "qmcjax" in who else min(calls, 3)
                        rows.append({"scene": name, "spp": spp, "program": who} | measured(name, frame, few))
                if program is not None:
                    row = cpp(program, name, side, spp, calls)
                    rows.append({"scene": name, "spp": spp, "program": "C++, OpenMP"} | row)
    print(json.dumps({"side": side, "rows": rows, "devices": len(jax.devices())}))


if __name__ == "__main__":
    main(sys.argv[1])

"""Derivative images by Mitsuba's ``direct_projective``, in a separate process: see `measure`.

Each number of a scene moves along its central difference over two descriptions: so what moves is known
whatever the parameter is, vertices, transforms, radiance or the sensor.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from figures.shared import costs
from figures.shared.mitsuba_runs.mitsuba_process import as_native

MOVES = "vertex_positions", "to_world", "value", "x_fov"
"""How names of parameters end that may move."""


def measure(task: dict[str, Any]) -> list[list[float]]:
    """Save derivative images (counts, keys, side, side, 3), and return the seconds of each, (counts, keys).

    The task has a scene's description, those ``step`` before and after it, whether there are shadows, counts
    of samples per pixel, keys, and the file for images.
    """
    import drjit  # pyright: ignore[reportMissingImports]
    import mitsuba  # pyright: ignore[reportMissingImports]

    mitsuba.set_variant("llvm_ad_rgb")
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    with tempfile.TemporaryDirectory() as folder:
        scene, before, after = (
            # Equal parts would become one, whose name depends on threads.
            mitsuba.load_dict(as_native(mitsuba, task[name], Path(folder)), optimize=False)
            for name in ("scene", "before", "after")
        )
    given, low, high = (mitsuba.traverse(each) for each in (scene, before, after))
    slopes = {}
    for key in given.keys():
        if key.endswith(MOVES):
            numbers, less, more = (_numbers(of[key]) for of in (given, low, high))
            slope = (more - less) / (2 * task["step"])
            if abs(slope).max() > 1e-4:
                slopes[key] = numbers, slope
    assert slopes
    how = {"type": "direct_projective"} | ({} if task["shadows"] else {"sppi": 0})
    integrator = mitsuba.load_dict(how)

    def derivative(spp: int, seed: Any) -> Any:
        moved = mitsuba.Float(0.0)
        drjit.enable_grad(moved)
        for key, (numbers, slope) in slopes.items():
            given[key] = _moved(mitsuba, given[key], numbers, slope, moved)
        given.update()
        image = mitsuba.render(scene, given, integrator=integrator, spp=spp, seed=seed)
        drjit.set_grad(moved, 1.0)
        drjit.forward_to(image)
        return np.array(drjit.grad(image))

    images, seconds = [], []
    for spp in task["counts"]:
        derivative(spp, 2**20)
        found = [costs.timed(derivative, spp, seed) for seed in range(task["keys"])]
        images.append([image for image, _ in found])
        seconds.append([taken.clock for _, taken in found])
    np.savez(task["file"], images=np.array(images))
    return seconds


def _numbers(value: Any) -> np.ndarray:
    return np.array(getattr(value, "matrix", value), np.float64)


def _moved(mitsuba: Any, value: Any, numbers: np.ndarray, slope: np.ndarray, moved: Any) -> Any:
    if hasattr(value, "matrix"):
        one, other = (np.reshape(each, (4, 4)) for each in (numbers, slope))
        rows = [[float(one[i, j]) + moved * float(other[i, j]) for j in range(4)] for i in range(4)]
        return type(value)(mitsuba.Matrix4f(*(each for row in rows for each in row)))
    return type(value)(numbers.tolist()) + moved * type(value)(slope.tolist())

"""Images of Mitsuba 3 for a comparison: ``python -m figures.arena._mitsuba_process``.

The task comes in JSON at standard input: the path of a ``scene``, the longer ``side`` of its images, numbers
of samples ``spps``, the number of ``keys``, ``samplers`` as pairs of a kind and what it needs, the number of
``passes`` of the reference, and two files, ``result`` and ``kept``.
"""

import inspect
import io
import json
import statistics
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import analysis
from figures.making import store
from figures.shared.costs import timed
from figures.shared.imported_objects import imported
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.rivals import RIVALS, rotated
from qmcjax.bridges import mitsuba as bridge

DIMS = 8
"""Of our samplers: the pixel's, the lens', and those of a bounce. The plugin adds others."""

TIMED = 3
"""Renderings whose median is the time of an image."""

REFERENCE = "multijitter"
REFERENCE_KEY = 2**20


class Compared:
    """A scene on a film of its own, and samplers in it."""

    def __init__(self, task: dict[str, Any]) -> None:
        import mitsuba  # pyright: ignore[reportMissingImports]

        self.mitsuba: Any = mitsuba
        self.scene = mitsuba.load_file(task["scene"])
        width, height = (int(size) for size in self.scene.sensors()[0].film().crop_size())
        scale = task["side"] / max(width, height)
        self.size = max(1, round(scale * width)), max(1, round(scale * height))
        self.film = mitsuba.load_dict(mitsuba_scenes.film(*self.size))

    def sensor(self, kind: str, named: str, spp: int, key: int) -> Any:
        """Return a sensor with a sampler, made for a number of samples and a key."""
        if kind == "mitsuba":
            sampler = self.mitsuba.load_dict({"type": named, "sample_count": spp})
            if sampler.sample_count() != spp:
                raise ValueError(
                    f"spp must be a number that it takes, got {spp}: it takes {sampler.sample_count()}"
                )
        else:
            sampler = _made(kind, named, *self.size, spp, key)
        return bridge.sensor_with(self.scene, sampler, key=key, film=self.film)

    def image(self, sensor: Any, spp: int, seed: int = 0) -> NDArray[np.float32]:
        """Return an image in linear RGB."""
        made = self.mitsuba.render(self.scene, sensor=sensor, spp=spp, seed=seed)
        return np.array(made, np.float32)[..., :3]


def _made(kind: str, named: str, width: int, height: int, spp: int, key: int) -> Any:
    if kind == "rival":
        return RIVALS[named].make(DIMS, width, height, spp, key)
    if kind == "points":
        return rotated(analysis.read_points(named))(key)
    made = imported(named)
    if hasattr(made, "dims"):
        return made
    given = {"width": width, "height": height, "spp": spp, "key": key}
    return made(**{name: given[name] for name in inspect.signature(made).parameters})


def main() -> None:
    """Render what the task asks for, and write it to a file."""
    task = json.load(sys.stdin)
    bridge.register(task["variant"])
    compared = Compared(task)
    found: dict[str, Any] = {}
    for spp in task["spps"]:
        _render(compared, task, spp, found)
    for number, (kind, named) in enumerate(task["samplers"]):
        if kind in ("own", "points"):
            found[f"promises {number}"] = np.array(_broken(kind, named, *compared.size, task["spps"][-1]))
    mean, error, passes = _reference(compared, 4 * task["spps"][-1], task["passes"], Path(task["kept"]))
    np.savez(task["result"], reference=mean, error=error, passes=passes, **found)


def _broken(kind: str, named: str, width: int, height: int, spp: int) -> list[str]:
    """Return the promises that a user's sampler breaks."""
    try:
        sampler = _made(kind, named, width, height, spp, 0)
    except Exception as error:
        return [f"it cannot be made for {spp} samples: {error}"]
    return analysis.broken_promises(sampler, width, height, spp)


def _render(compared: Compared, task: dict[str, Any], spp: int, found: dict[str, Any]) -> None:
    """Add the images of all samplers with one number of samples, their times, or why there are none."""
    sensors, seconds = {}, {}
    for number, (kind, named) in enumerate(task["samplers"]):
        try:
            sensors[number] = compared.sensor(kind, named, spp, 0)
            first = [compared.image(sensors[number], spp)]
            for key in range(1, task["keys"]):
                seed = key if kind == "mitsuba" else 0
                other = sensors[number] if seed else compared.sensor(kind, named, spp, key)
                first.append(compared.image(other, spp, seed))
        except Exception as error:  # Whatever a user's code raises is what the user has to know.
            sensors.pop(number, None)
            found[f"why {number} {spp}"] = next(iter(str(error).splitlines()), type(error).__name__)
        else:
            found[f"images {number} {spp}"] = np.array(first)
    # In turns, after all have been compiled.
    for _ in range(TIMED):
        for number, sensor in sensors.items():
            _, taken = timed(compared.image, sensor, spp)
            seconds.setdefault(number, []).append(taken.clock)
    for number, taken in seconds.items():
        found[f"seconds {number} {spp}"] = statistics.median(taken)


def _reference(compared: Compared, spp: int, passes: int, kept: Path) -> tuple[NDArray, NDArray, int]:
    """Return the mean of passes and its standard error, pixel by pixel; each pass is kept in a file."""
    width, height = compared.size
    total, square, done = np.zeros((height, width, 3)), np.zeros((height, width, 3)), 0
    if kept.exists():
        with np.load(kept) as state:
            total, square, done = state["total"], state["square"], int(state["done"])
    sampler = compared.mitsuba.load_dict({"type": REFERENCE})
    sensor = bridge.sensor_with(compared.scene, sampler, film=compared.film)
    for number in range(done, passes):
        image = compared.image(sensor, spp, REFERENCE_KEY + number).astype(np.float64)
        total, square, done = total + image, square + image**2, number + 1
        buffer = io.BytesIO()
        np.savez(buffer, total=total, square=square, done=done)
        store.write(kept, buffer.getvalue())
    variance = np.maximum(square / done - (total / done) ** 2, 0) * done / (done - 1)
    return total / done, np.sqrt(variance / done), done


if __name__ == "__main__":
    main()

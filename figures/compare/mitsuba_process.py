"""Images of Mitsuba 3 for a comparison: ``python -m figures.compare.mitsuba_process``.

The task comes in JSON at standard input: the path of a ``scene``, the longer ``side`` of its images, numbers
of samples ``spps``, the number of ``keys``, ``samplers`` as the command line names entries, the number of
``passes`` of the reference, and two files, ``result`` and ``kept``.
"""

import io
import json
import statistics
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from figures.compare.entries import MITSUBA, Entry
from figures.compare.samplers import parse
from figures.making import store
from figures.shared.costs import timed
from figures.shared.mitsuba_runs import mitsuba_scenes
from qmcjax.bridges import mitsuba as bridge

DIMS = 8
"""Of our samplers: the pixel's, the lens', and those of a bounce. The plugin adds others."""

TIMED = 3
"""Renderings whose median is the time of an image."""

REFERENCE = "multijitter"
REFERENCE_KEY = 2**20


class Film:
    """A scene on a film of its own."""

    def __init__(self, scene: str, side: int) -> None:
        import mitsuba  # pyright: ignore[reportMissingImports]

        self.mitsuba: Any = mitsuba
        self.scene = mitsuba.load_file(scene)
        width, height = (int(size) for size in self.scene.sensors()[0].film().crop_size())
        scale = side / max(width, height)
        self.size = max(1, round(scale * width)), max(1, round(scale * height))
        self.film = mitsuba.load_dict(mitsuba_scenes.film(*self.size))

    def sensor(self, entry: Entry, spp: int, key: int) -> Any:
        """Return a sensor with a sampler, made for a number of samples and a key."""
        if entry.make is not None:
            sampler = entry.make(*self.size, spp, DIMS, key)
        else:
            sampler = self.mitsuba.load_dict({"type": entry.name.removeprefix(MITSUBA), "sample_count": spp})
            if sampler.sample_count() != spp:
                raise ValueError(
                    f"spp must be a number that it takes, got {spp}: it takes {sampler.sample_count()}"
                )
        return bridge.sensor_with(self.scene, sampler, key=key, film=self.film)

    def image(self, sensor: Any, spp: int, seed: int = 0) -> NDArray[np.float32]:
        """Return an image in linear RGB."""
        image = self.mitsuba.render(self.scene, sensor=sensor, spp=spp, seed=seed)
        return np.array(image, np.float32)[..., :3]


def main() -> None:
    """Render what the task asks for, and write it to a file."""
    task = json.load(sys.stdin)
    bridge.register(task["variant"])
    film, entries = Film(task["scene"], task["side"]), [parse(text) for text in task["samplers"]]
    result: dict[str, Any] = {}
    for spp in task["spps"]:
        result |= _render(film, entries, task["keys"], spp)
    mean, error = _reference(film, 4 * task["spps"][-1], task["passes"], Path(task["kept"]))
    np.savez(task["result"], reference=mean, error=error, **result)


def _render(film: Film, entries: list[Entry], keys: int, spp: int) -> dict[str, Any]:
    """Return the images of all samplers with one number of samples, their times, or why there are none."""
    sensors, seconds, result = {}, {}, {}
    for number, entry in enumerate(entries):
        try:
            sensors[number] = film.sensor(entry, spp, 0)
            images = [film.image(sensors[number], spp)]
            for key in range(1, keys):
                seed = 0 if entry.make else key
                sensor = sensors[number] if seed else film.sensor(entry, spp, key)
                images.append(film.image(sensor, spp, seed))
        except Exception as error:  # Whatever a user's code raises is what the user has to know.
            sensors.pop(number, None)
            result[f"why {number} {spp}"] = next(iter(str(error).splitlines()), type(error).__name__)
        else:
            result[f"images {number} {spp}"] = np.array(images)
    # In turns, after all have been compiled.
    for _ in range(TIMED):
        for number, sensor in sensors.items():
            _, taken = timed(film.image, sensor, spp)
            seconds.setdefault(number, []).append(taken.clock)
    return result | {f"seconds {number} {spp}": statistics.median(taken) for number, taken in seconds.items()}


def _reference(film: Film, spp: int, passes: int, kept: Path) -> tuple[NDArray, NDArray]:
    """Return the mean of passes and its standard error, pixel by pixel; each pass is kept in a file."""
    width, height = film.size
    total, square, done = np.zeros((height, width, 3)), np.zeros((height, width, 3)), 0
    if kept.exists():
        with np.load(kept) as state:
            total, square, done = state["total"], state["square"], int(state["done"])
    sampler = film.mitsuba.load_dict({"type": REFERENCE})
    sensor = bridge.sensor_with(film.scene, sampler, film=film.film)
    for number in range(done, passes):
        image = film.image(sensor, spp, REFERENCE_KEY + number).astype(np.float64)
        total, square, done = total + image, square + image**2, number + 1
        buffer = io.BytesIO()
        np.savez(buffer, total=total, square=square, done=done)
        store.write(kept, buffer.getvalue())
    variance = np.maximum(square / done - (total / done) ** 2, 0) * done / (done - 1)
    return total / done, np.sqrt(variance / done)


if __name__ == "__main__":
    main()

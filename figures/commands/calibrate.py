"""Short measurements of a rendering, for the model of what longer ones cost.

Workers are processes of their own, each on a core of its own where the system lets one choose: started by
``python -m figures.commands.calibrate SCENE SAMPLER CORE``, they read one task a line and
print what they measured.
"""

import contextlib
import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any

from figures.commands.cost_model import Sizes
from figures.making.this_machine import machine

SPP = (16, 64)
"""Samples per pixel in the fit; one size has those of MORE, too."""

MORE = (256, 1024)

DIMS = (2, 3, 4, 8)
"""Coordinates in the fit, as far as the sampler has them."""

HELD_DIMS = 6
"""Held out of it, if the sampler has so many."""

LONGEST = 0.5
"""Seconds, about, of the longest rendering in the fit."""

BASES = (256, 128, 64, 32)
"""Sides of the images in the middle: the largest that is fast enough is taken."""

TURNS = 5
"""Calls, at least, of which the median counts: the fastest of many is faster than that of few."""

AT_LEAST = 0.1
"""Seconds of calls."""

ROUNDS = 3
"""Of such calls, whose median counts: what disturbs one seldom disturbs two."""

Measured = list[tuple[Sizes, float]]


class Worker:
    """A process that renders on request."""

    def __init__(self, scene: str, sampler: str, core: int | None) -> None:
        start = time.perf_counter()
        # What is compiled is to be measured, not to be found.
        environment = {key: value for key, value in os.environ.items() if key != "JAX_COMPILATION_CACHE_DIR"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, scene, sampler, "" if core is None else str(core)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        try:
            self.about = self.answer()
        except RuntimeError:
            self.close()
            raise
        self.start = self.about["start"] or time.perf_counter() - start

    def ask(self, what: str, width: int, height: int, spp: int, dims: int) -> None:
        """Send a task: ``first`` compiles, ``typical`` is timed after it. ``dims`` 0 stands for the scene."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([what, width, height, spp, dims]) + "\n")
        self._process.stdin.flush()

    def answer(self) -> dict[str, Any]:
        """Wait for what it has to say, or raise a RuntimeError with its last words."""
        assert self._process.stdout is not None and self._process.stderr is not None
        line = self._process.stdout.readline()
        if not line:
            words = self._process.stderr.read().strip().splitlines()
            raise RuntimeError(f"a measurement failed: {words[-1] if words else 'its process ended'}")
        return json.loads(line)

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()


@contextlib.contextmanager
def workers(scene: str, sampler: str, cores: Sequence[int | None]) -> Iterator[list[Worker]]:
    """Start a worker for each core, and end them."""
    started: list[Worker] = []
    try:
        for core in cores:
            started.append(Worker(scene, sampler, core))
        yield started
    finally:
        for worker in started:
            worker.close()


def calibration(scene: str, sampler: str, progress: Callable[[float], None]) -> dict[str, Any]:
    """Measure start, compilation, times and memory, some of each held out of the fit.

    ``scene``, ``sampler``: names of the arena. ``progress``: called with the finished part in (0, 1]. Returns
    ``start`` and ``compilation`` in seconds, ``time``, ``held out``, ``memory`` and ``memory held out`` as
    lists of sizes with seconds or bytes, and what it was measured on.
    """
    cores = _cores()
    with workers(scene, sampler, [cores[0]]) as (worker,):
        about, starts = worker.about, [worker.start]
        base, compiled = _base(worker)
        first = [compiled]
        fit, held = _alone(base, about["dims"])
        measured: list[Measured] = [[], []]
        for done, (into, sizes) in enumerate([*((0, s) for s in fit), *((1, s) for s in held)], start=1):
            compiled, seconds = _timed([worker], sizes)
            measured[into].append((sizes, seconds))
            first.append(compiled)
            progress(0.7 * done / len([*fit, *held]))
    if len(cores) > 1 and about["platform"] == "cpu":
        with workers(scene, sampler, cores[:2]) as pair:
            starts += [worker.start for worker in pair]
            for into, sizes in ((0, (base, 64)), (0, (2 * base, 64)), (1, (3 * base // 2, 32))):
                wanted = Sizes(sizes[0] ** 2, sizes[1], 0, 2)
                measured[into].append((wanted, _timed(pair, wanted)[1]))
    progress(0.85)
    measured = [[(_with_dims(s, about["needs"]), value) for s, value in each] for each in measured]
    with workers(scene, sampler, [cores[0]]) as (worker,):
        memory = _memory(worker, base)
    progress(1.0)
    return {
        "machine": machine(),
        "device": about["device"],
        "one core": about["platform"] == "cpu" and cores[0] is not None,
        "start": statistics.median(starts),
        "compilation": max(first),  # Of several sizes one program may do.
        "time": measured[0],
        "held out": measured[1],
        "memory": [memory[0], memory[1], memory[3]],
        "memory held out": [memory[2]],
    }


def _cores() -> Sequence[int | None]:
    """Return the cores that may be chosen; where there is no choice, one place for all."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [None]


def _base(worker: Worker) -> tuple[int, float]:
    """Return the side of images in the middle, by the rate at a small one, and seconds of compilation."""
    compiled, seconds = _timed([worker], Sizes(64 * 64, 16, 0))
    rate = 64 * 64 * 16 / seconds
    base = next((base for base in BASES if (2 * base) ** 2 * SPP[1] <= LONGEST * rate), BASES[-1])
    return base, compiled


def _alone(base: int, dims: int) -> tuple[list[Sizes], list[Sizes]]:
    """Return sizes for one device, in the fit and held out. With dims 0 the scene is evaluated."""
    fit = [Sizes(side**2, spp, 0) for side in (base // 2, base, 2 * base) for spp in SPP]
    fit += [Sizes(base**2, spp, 0) for spp in MORE]
    fit += [Sizes(base**2, spp, d, 1, False) for d in DIMS if d <= dims for spp in SPP]
    held = [Sizes((3 * base // 2) ** 2, 32, 0), Sizes((4 * base) ** 2, 64, 0)]
    held.append(Sizes((base // 2) ** 2, 4 * MORE[-1], 0))
    if dims >= HELD_DIMS:
        held.append(Sizes(base**2, 32, HELD_DIMS, 1, False))
    return fit, held


def _with_dims(sizes: Sizes, needs: int) -> Sizes:
    return sizes if sizes.dims else sizes._replace(dims=needs)


def _timed(used: list[Worker], sizes: Sizes) -> tuple[float, float]:
    """Return the seconds that compilation takes, and those of a call, of the slowest worker."""
    side = math.isqrt(sizes.pixels)
    task = side, side // len(used), sizes.spp, sizes.dims
    found = []
    for what in ("first", *["typical"] * ROUNDS):
        for worker in used:
            worker.ask(what, *task)
        found.append(max(worker.answer()["seconds"] for worker in used))
    typical = statistics.median(found[1:])
    return max(found[0] - typical, 0.0), typical


def _memory(worker: Worker, base: int) -> Measured:
    """Return the largest memory of the process, for larger and larger images."""
    found = []
    for side in (2 * base, 4 * base, 6 * base, 8 * base):
        worker.ask("first", side, side, SPP[0], 0)
        found.append((Sizes(side**2, SPP[0], worker.about["needs"]), worker.answer()["peak"]))
    return found


def _serve(scene_name: str, sampler_name: str, core: str) -> None:
    """Be a worker."""
    if core:
        os.sched_setaffinity(0, {int(core)})  # Before XLA makes threads.
    import jax
    import numpy as np

    import qmcjax as qj
    from figures.shared.peak_memory import largest
    from figures.shared.rivals import RIVALS, SCENES
    from figures.shared.turns import typical
    from qmcjax import scenes

    scene = SCENES[scene_name]()
    needs = len(scene.needs)
    make = RIVALS[sampler_name].make

    @cache
    def coordinates(dims: int) -> Any:
        return scenes.function(lambda point: point.sum(axis=-1), tuple(f"u{j}" for j in range(dims)))

    def image(width: int, height: int, spp: int, dims: int) -> Callable[[int], Any]:
        rendered = coordinates(dims) if dims else scene
        sampler = make(dims or needs, width, height, spp, 1)
        return lambda turn: np.asarray(qj.render(rendered, sampler, width, height, spp))

    device = jax.devices()[0]
    # Time on the core, if all is done there: others may have their turns on it.
    clock = "processors" if core and device.platform == "cpu" else "clock"
    most = make(DIMS[-1], 64, 64, SPP[0], 1).dims
    begun = time.process_time() if clock == "processors" else None
    about = {
        "start": begun,
        "platform": device.platform,
        "device": device.device_kind,
        "needs": needs,
        "dims": most,
    }
    print(json.dumps(about), flush=True)
    for line in sys.stdin:
        what, *task = json.loads(line)
        least = (TURNS, AT_LEAST) if what == "typical" else (1, 0.0)
        took = typical(image(*task), *least, clock)
        print(json.dumps({"seconds": took, "peak": largest()}), flush=True)


if __name__ == "__main__":
    _serve(*sys.argv[1:])

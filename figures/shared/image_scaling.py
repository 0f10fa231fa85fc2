"""Time and memory of images over pixels and samples: ``python -m figures.shared.image_scaling draft``.

A process of its own, since the peak of its memory is read. Prints JSON.
"""

import json
import sys
import time

import jax
import numpy as np
from jax import Array
from jax.sharding import Mesh

from figures.shared.peak_memory import peak_of
from qmcjax import render, samplers, scenes

SIDES = {"draft": (64, 128), "paper": (64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384)}
AT = 4
"""Samples per pixel of the images over pixels."""
SPP = {"draft": (1, 4), "paper": tuple(4**k for k in range(10))}
SIDE = 128
"""Of the images over samples."""
SHARED = {"draft": (64, 2), "paper": (1024, 16)}
"""Side and samples per pixel of the images on a mesh of one device."""
WANTED, MOST = 0.25, {"draft": 1, "paper": 9}
"""Calls are repeated for so many seconds, and so often at most; the least time counts."""

Times = tuple[float, float]
"""Seconds of the clock, and of all processors."""


def image(side: int, spp: int, mesh: Mesh | None, key: int) -> Array:
    sampler = samplers.z(side, side, spp, int(key))
    return render(scenes.checkerboard(), sampler, side, side, spp, mesh=mesh)


def timed(taken: list[Times], side: int, spp: int, mesh: Mesh | None = None, key: int = 1) -> Array:
    """Return an image once it is finished, and note the time."""
    start, busy = time.perf_counter(), time.process_time()
    made = jax.block_until_ready(image(side, spp, mesh, key))
    taken.append((time.perf_counter() - start, time.process_time() - busy))
    return made


def measured(side: int, spp: int, most: int) -> dict[str, float | None]:
    """Return what an image costs once its program is compiled, memory beyond that of the image."""
    timed([], side, spp)
    taken: list[Times] = []
    peak = peak_of(lambda key: timed(taken, side, spp, None, key), 2)
    while len(taken) < most and sum(clock for clock, _ in taken) < WANTED:
        timed(taken, side, spp)
    seconds, busy = np.min(taken, axis=0)
    beyond = None if peak is None else max(peak - 4 * side**2, 0)
    return {"side": side, "spp": spp, "seconds": seconds, "processor seconds": busy, "beyond": beyond}


def overhead(side: int, spp: int, most: int) -> dict[str, float]:
    """Return by which part of the time a mesh of one device takes longer, with and without it in turns."""
    meshes = None, jax.sharding.Mesh(np.array(jax.devices()[:1]), ("device",))
    taken: tuple[list[Times], list[Times]] = [], []
    for mesh in meshes:
        timed([], side, spp, mesh)
    for _ in range(2 * most):
        for times, mesh in zip(taken, meshes, strict=True):
            timed(times, side, spp, mesh)
    plain, shared = (np.min(times, axis=0) for times in taken)
    clock, busy = shared / plain - 1
    return {"side": side, "spp": spp, "seconds": clock, "processor seconds": busy}


def main(quality: str) -> None:
    """Measure and print."""
    most = MOST[quality]
    found = {
        "pixels": [measured(side, AT, most) for side in SIDES[quality]],
        "spp": [measured(SIDE, spp, most) for spp in SPP[quality]],
        "overhead": overhead(*SHARED[quality], most),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])

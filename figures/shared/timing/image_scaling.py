"""Time and memory of images over pixels and samples, in a separate process: its peak of memory is read."""

from typing import Any

import jax
import numpy as np
from jax import Array
from jax.sharding import Mesh

from figures.shared.costs import Seconds, in_turns, peak_of, timed
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


def image(side: int, spp: int, mesh: Mesh | None = None, key: int = 1) -> Array:
    sampler = samplers.z(side, side, spp, int(key))
    return render(scenes.checkerboard(), sampler, side, side, spp, mesh=mesh)


def cost(side: int, spp: int, most: int) -> dict[str, float | None]:
    """Return what an image costs once its program is compiled, memory beyond that of the image."""
    timed(image, side, spp)
    taken: list[Seconds] = []

    def noted(key: int) -> Array:
        made, seconds = timed(image, side, spp, None, key)
        taken.append(seconds)
        return made

    peak = peak_of(noted, 2)
    while len(taken) < most and sum(seconds.clock for seconds in taken) < WANTED:
        noted(1)
    seconds, busy = np.min(taken, axis=0)
    beyond = None if peak is None else max(peak - 4 * side**2, 0)
    return {"side": side, "spp": spp, "seconds": seconds, "processor seconds": busy, "beyond": beyond}


def overhead(side: int, spp: int, most: int) -> dict[str, float]:
    """Return by which part of the time a mesh of one device takes longer, with and without it in turns."""
    meshes = {"plain": None, "shared": jax.sharding.Mesh(np.array(jax.devices()[:1]), ("device",))}
    calls = {name: lambda _, mesh=mesh: image(side, spp, mesh) for name, mesh in meshes.items()}
    plain, shared = (np.min(taken[1:], axis=0) for taken in in_turns(calls, 2 * most).values())
    clock, busy = shared / plain - 1
    return {"side": side, "spp": spp, "seconds": clock, "processor seconds": busy}


def measure(quality: str) -> dict[str, Any]:
    """Return what images cost over pixels and over samples, and what a mesh does."""
    most = MOST[quality]
    return {
        "pixels": [cost(side, AT, most) for side in SIDES[quality]],
        "spp": [cost(SIDE, spp, most) for spp in SPP[quality]],
        "overhead": overhead(*SHARED[quality], most),
    }

"""What playgrounds hold, unpacked; and the sums that they should render, by NumPy, sample after sample."""

import base64
import json
import re
import zlib
from functools import cache

import jax
import numpy as np

from figures.playground import SCENES, make_sampler, ours

SIDE = 128


@cache
def packed():
    """Return the script of the first page's playground."""
    return ours(SIDE)


def unpacked(script):
    """Return the description, and the bytes of the arrays as ``data["blob"]``."""
    text = re.fullmatch(r'window\.playgroundData = "([\w+/=]+)";\n', script)[1]
    data = zlib.decompress(base64.b64decode(text))
    end = 4 + int.from_bytes(data[:4], "little")
    return json.loads(data[4:end]) | {"blob": data[end:]}


def planes(data, place, count):
    found = np.frombuffer(data["blob"][slice(*place)], np.uint8).reshape(count, -1)
    return sum(plane.astype(np.uint32) << np.uint32(8 * k) for k, plane in enumerate(found))


def exact(data, scene):
    side = data["side"]
    if "levels" in scene:
        return planes(data, scene["levels"], 3).reshape(side, side) / data["levels"]
    parts = (data["blob"][slice(*scene[name])] for name in ("columns", "rows"))
    columns, rows = (np.frombuffer(part).reshape(-1, side) for part in parts)
    return columns.T @ rows


@cache
def _points(name, spp, key, side):
    """Return the points of all samples, float32 (spp, pixels, 4)."""
    y, x = np.divmod(np.arange(side**2, dtype=np.uint32), np.uint32(side))
    program = jax.jit(lambda sampler, sample: sampler(x, y, sample, (0, 1, 2, 3)))
    sampler = make_sampler(name, side, spp, key)
    return np.stack([np.asarray(program(sampler, np.uint32(sample))) for sample in range(spp)])


def sums(name, scene, spp, key, side=SIDE, first=None):
    """Return the sums of the first samples, or all, of a scene, in their order: float32, rounded for each."""
    y, x = np.divmod(np.arange(side**2, dtype=np.uint32), np.uint32(side))
    world, total = SCENES[scene](), np.zeros(side**2, np.float32)
    for points in _points(name, spp, key, side)[:first]:
        places = points[:, : len(world.needs)].copy()
        for axis, pixel in enumerate((x, y)):
            place = (pixel.astype(np.float32) + points[:, axis]) * np.float32(1 / side)
            places[:, axis] = np.minimum(place, np.float32(1 - 2.0**-24))
        total += np.asarray(world(places))
    return total

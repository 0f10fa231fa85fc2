"""Rays per second: our compiled search, and Embree."""

import os
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from figures.shared.costs import in_turns, median
from qmcjax import tracing
from qmcjax.core.pytrees import jit
from qmcjax.tracing.search.intersection import compiled, in_dtype, search

SIZES = {"draft": (2**8, (32,), 1), "paper": (2**18, (32, 512, 8192, 80000), 9)}
"""Rays of a call, triangles of the meshes, turns."""

AROUND = {32: 4, 512: 16, 8192: 64, 80000: 200}
"""Steps around a body, and from pole to pole one more: twice their product are its triangles."""

NOTE = (
    "Rays: {count} in a call, float32, {processors} processors; medians of {turns} turns in which both "
    "take one each. Coherent rays go through pixels in squares of 16 x 16, random ones from a sphere to "
    "points in it. An Embree call has one thread."
)

FAST = find_spec("numba") is not None
EMBREE = find_spec("embreex") is not None

Rays = tuple[NDArray[np.float32], NDArray[np.float32]]
Call = Callable[[int], Any]
Rates = dict[str, dict[str, dict[str, float]]]
"""By rays and program: per second, and per processor second."""


def measure(quality: str) -> tuple[Rates, str]:
    """Let both search in turns, and return their rates, and how they were measured."""
    count, meshes, turns = SIZES[quality]
    rates: Rates = {}
    for size in meshes:
        vertices = body(size)
        world = tracing.world([tracing.triangles(vertices)])
        for name, rays in (("coherent", coherent(count)), ("random", random(count))):
            calls: dict[str, Call] = {}
            if FAST:
                calls["compiled"] = lambda _, of=(world, *rays): _hits(*of)
            if EMBREE:
                calls["Embree"] = _embree(vertices, *rays)
            rates[f"{size} triangles, {name} rays"] = {
                name: {
                    "per second": count / median(taken),
                    "per processor second": count / max(min(one.processors for one in taken[1:]), 1e-9),
                }
                for name, taken in in_turns(calls, turns).items()
            }
    missing = "" if FAST else " numba is not installed: pip install qmcjax[fast]."
    missing += "" if EMBREE else " Embree is not installed: pip install embreex."
    return rates, NOTE.format(count=count, processors=os.cpu_count(), turns=turns) + missing


def body(triangles: int) -> NDArray[np.float32]:
    """Return a closed surface with bumps."""
    around = AROUND[triangles]
    polar = np.linspace(0, np.pi, around + 2)[:, None]
    turn = np.append(np.linspace(0, 2 * np.pi, around, endpoint=False), 0)
    radius = 0.8 + 0.1 * np.sin(5 * turn) * np.sin(polar) ** 2
    ring = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn], 2)
    at = radius[..., None] * ring
    at[0], at[-1] = [0, 0, 0.8], [0, 0, -0.8]
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    upper, lower = np.stack([a, b, c], 2)[:-1], np.stack([a, c, d], 2)[1:]
    return np.concatenate([upper.reshape(-1, 3, 3), lower.reshape(-1, 3, 3)]).astype(np.float32)


def coherent(count: int) -> Rays:
    """Return rays through the pixels of a square image."""
    side = int(count**0.5)
    tiles = np.arange(count).reshape(side // 16, side // 16, 16, 16)
    number = np.empty((side, side), int)
    number[:] = tiles.transpose(0, 2, 1, 3).reshape(side, side)
    place = np.argsort(number.reshape(-1))
    x, y = (2 * (place % side) + 1) / side - 1, (2 * (place // side) + 1) / side - 1
    direction = np.stack([x, y, np.full(count, 2.0)], axis=1).astype(np.float32)
    return np.tile(np.array([0.2, 0.3, -3], np.float32), (count, 1)), direction


def random(count: int) -> Rays:
    """Return rays from a sphere to points inside."""
    rng = np.random.default_rng(1)
    origin, target = rng.normal(size=(2, count, 3))
    origin *= 1.5 / np.linalg.norm(origin, axis=1, keepdims=True)
    target *= rng.uniform(size=(count, 1)) ** (1 / 3) / np.linalg.norm(target, axis=1, keepdims=True)
    return origin.astype(np.float32), (target - origin).astype(np.float32)


@jit()
def _hits(world: tracing.World, origin: Any, direction: Any) -> Any:
    """Return distances, infinite without a hit, and primitives."""
    start, way = ((a[..., 0], a[..., 1], a[..., 2]) for a in (origin, direction))
    time, limit = jnp.zeros(len(origin)), jnp.full(len(origin), jnp.inf)
    return search(in_dtype(world, origin.dtype), start, way, time, limit, False, compiled)


def _embree(vertices: NDArray[np.float32], origin: Any, direction: Any) -> Call:
    from embreex.mesh_construction import TriangleMesh  # pyright: ignore[reportMissingImports]
    from embreex.rtcore_scene import EmbreeScene  # pyright: ignore[reportMissingImports]

    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, vertices)
    return lambda _: scene.run(origin, direction)

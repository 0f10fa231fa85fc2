"""Rays per second: the ways to search in a world, and Embree."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from figures.shared.costs import in_turns, median
from qmcjax import scenes, tracing
from qmcjax.core.pytrees import jit
from qmcjax.tracing.search import program
from qmcjax.tracing.search.intersection import Intersector, compiled, in_dtype, search

SIZES = {"draft": (2**8, (32,), 1), "paper": (2**18, (32, 512, 8192, 80000), 9)}
"""Rays of a call, triangles of the meshes, turns."""

AROUND = {32: 4, 512: 16, 8192: 64, 80000: 200}
"""Steps around a body, and from pole to pole one more: twice their product are its triangles."""

LOOPED = 600
"""Primitives up to which fused loops are waited for."""

NOTE = (
    "Rays: {count} in a call, float32, {processors} processors; medians of {turns} turns in which all ways "
    "take one each. Coherent rays go through pixels in squares of 16 x 16, random ones from a sphere to "
    "points in it. An Embree call has one thread; 'all threads' call it with parts of the rays."
)

FAST = find_spec("numba") is not None
EMBREE = find_spec("embreex") is not None
WAYS = ("fused loops", "tree, JAX", "compiled", "Embree", "Embree, all threads")

Rays = tuple[NDArray[np.float32], NDArray[np.float32]]
Call = Callable[[], Any]


Rates = dict[str, dict[str, dict[str, float]]]
"""By rays and way: per second, per processor second, and the seconds of the first call."""


def measure(quality: str) -> tuple[Rates, str]:
    """Let all ways search in turns, and return their rates, and how they were measured."""
    count, meshes, turns = SIZES[quality]
    rates: Rates = {}
    for size in meshes:
        vertices = body(size)
        world = tracing.world([tracing.triangles(vertices)])
        for name, rays in (("coherent", coherent(count)), ("random", random(count))):
            ways = {way: partial(search, *rays) for way, search in _ways(world, False).items()}
            if EMBREE:
                ways |= _embree(vertices, *rays)
            rates[f"{size} triangles, {name} rays"] = time_rates(ways, count, turns)
    fastest = ("compiled",) if FAST else ("fused loops",)
    of_helicopter = fastest if quality == "draft" else WAYS
    rates["helicopter, primary and shadow rays"] = _helicopter(count, turns, of_helicopter)
    return rates, NOTE.format(count=count, processors=os.cpu_count(), turns=turns) + (
        "" if FAST else " numba is not installed: pip install qmcjax[fast]."
    ) + ("" if EMBREE else " Embree is not installed: pip install embreex.")


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


def _ways(world: tracing.World, any_hit: bool) -> dict[str, Callable[..., Any]]:
    """Return functions of origins, directions, times and limits that find distances and numbers."""
    trees = any(shape.tree is not None for shape, _ in world.batches())
    chosen = {}
    if world.count <= LOOPED:
        chosen["fused loops"] = without_trees(world), program.by_program
    if trees:
        chosen["tree, JAX"] = world, program.by_program
    if FAST:
        chosen["compiled"] = world, compiled

    def found(way: Any, origin: Any, direction: Any, time: Any = None, limit: Any = None) -> Any:
        count = len(origin)
        time = jnp.zeros(count) if time is None else time
        limit = jnp.full(count, jnp.inf) if limit is None else limit
        return jax.block_until_ready(intersections(way[0], origin, direction, time, limit, any_hit, way[1]))

    return {name: partial(found, way) for name, way in chosen.items()}


def without_trees(world: tracing.World) -> tracing.World:
    """Return a world whose triangles are tested one by one."""
    items = (replace(item, shapes=tuple(shape.alone() for shape in item.shapes)) for item in world.objects)
    return replace(world, objects=tuple(items))


@jit("any_hit", "method")
def intersections(
    world: tracing.World,
    origin: Any,
    direction: Any,
    time: Any,
    limit: Any,
    any_hit: bool,
    method: Intersector,
) -> Any:
    """Return distances, the limit without a hit, and primitives, -1 without one, by one method."""
    start, way = ((a[..., 0], a[..., 1], a[..., 2]) for a in (origin, direction))
    return search(in_dtype(world, origin.dtype), start, way, time, limit, any_hit, method)


def _embree(vertices: NDArray[np.float32], origin: Any, direction: Any) -> dict[str, Call]:
    from embreex.mesh_construction import TriangleMesh  # pyright: ignore[reportMissingImports]
    from embreex.rtcore_scene import EmbreeScene  # pyright: ignore[reportMissingImports]

    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, vertices)
    count = os.cpu_count() or 1
    pool = ThreadPoolExecutor(count)
    parts = list(zip(np.array_split(origin, count), np.array_split(direction, count), strict=True))

    def threads() -> None:
        list(pool.map(lambda part: scene.run(*part), parts))

    return {"Embree": lambda: scene.run(origin, direction), "Embree, all threads": threads}


def _helicopter(count: int, turns: int, ways: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Measure primary rays at random times, and those from their hits to the light."""
    scene = scenes.helicopter().estimator
    world, camera = scene.world, scene.camera
    side = int(count**0.5)
    rng = np.random.default_rng(2)
    _, direction = coherent(count)
    x, y = (direction[:, 0] + 1) / 2, (direction[:, 1] + 1) / 2
    time = jnp.asarray(rng.uniform(size=side * side), jnp.float32)
    sight = camera.rays(jnp.asarray(x), jnp.asarray(y), time, ())
    origin, way = (
        jnp.stack(jnp.broadcast_arrays(*part), axis=-1) for part in (sight.origin, sight.direction)
    )
    hit = tracing.nearest_hit(world, origin, way, time)
    light = jnp.asarray(world.lights[0].position, jnp.float32) - hit.point
    limit = jnp.where(hit.shape >= 0, jnp.float32(1), 0)
    nearest, shadow = _ways(world, False), _ways(world, True)

    def both(name: str) -> None:
        nearest[name](origin, way, time)
        shadow[name](hit.point, light, time, limit)

    return time_rates({name: partial(both, name) for name in nearest if name in ways}, 2 * count, turns)


def time_rates(ways: dict[str, Call], count: int, turns: int) -> dict[str, dict[str, float]]:
    """Return rays per second of medians, those of the least processor time, and seconds of the first call."""
    calls = {name: lambda _, call=call: call() for name, call in ways.items()}
    return {
        name: {
            "per second": count / median(taken),
            "per processor second": count / max(min(one.processors for one in taken[1:]), 1e-9),
            "seconds of the first call": taken[0].clock,
        }
        for name, taken in in_turns(calls, turns).items()
    }

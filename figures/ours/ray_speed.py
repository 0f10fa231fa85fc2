"""Rays a second: the ways to search in a world, and Embree."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.util import find_spec
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures.shared.turns import in_turns, median
from qmcjax import scenes, tracing
from qmcjax.tracing import ways

SIZES = {"draft": (2**12, (32,), 3), "paper": (2**18, (32, 512, 8192, 80000), 9)}
"""Rays of a call, triangles of the meshes, turns."""

AROUND = {32: 4, 512: 16, 8192: 64, 80000: 200}
"""Steps around a body, and from pole to pole one more: twice their product are its triangles."""

LOOPED = 600
"""Primitives up to which fused loops are waited for."""

FAST = find_spec("numba") is not None
EMBREE = find_spec("embreex") is not None
LOOKS = {
    "fused loops": ("C0", "o"),
    "tree, JAX": ("C1", "^"),
    "compiled": ("C2", "v"),
    "Embree": ("0.6", "s"),
    "Embree, all threads": ("0.3", "D"),
}
WAYS = tuple(LOOKS)

Rays = tuple[NDArray[np.float32], NDArray[np.float32]]
Call = Callable[[], Any]


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Let all ways search by turns, and draw bars."""
    count, meshes, turns = SIZES[quality]
    measured: dict[str, dict[str, dict[str, float]]] = {}
    total = len(meshes) + 1
    for done, size in enumerate(meshes, start=1):
        vertices = body(size)
        world = tracing.world([tracing.triangles(vertices)])
        for name, rays in (("coherent", coherent(count)), ("random", random(count))):
            ways = {way: partial(search, *rays) for way, search in _ways(world, False).items()}
            if EMBREE:
                ways |= _embree(vertices, *rays)
            measured[f"{size} triangles, {name}"] = _measured(ways, count, turns)
        progress(done / total)
    fastest = ("compiled",) if FAST else ("fused loops",)
    of_helicopter = fastest if quality == "draft" else WAYS
    measured["helicopter, primary + shadow"] = _helicopter(count, turns, of_helicopter)
    progress(1.0)
    numbers: dict[str, Any] = {
        "measured": {
            "rays a second": measured,
            "compiled / Embree per processor second": {
                name: ways["compiled"]["per processor second"] / ways["Embree"]["per processor second"]
                for name, ways in measured.items()
                if "compiled" in ways and "Embree" in ways
            },
        },
        "note": f"{count} rays a call in float32, {os.cpu_count()} processors; medians of {turns} turns in "
        "which all ways take one each, 'per processor second' the least time of all threads; the first call, "
        "which compiles, is apart. Drafts search in the helicopter in one way only, and say little. "
        "'Coherent' rays go through pixels in squares of 16 x 16, 'random' ones from a sphere to points in "
        "it. An Embree call has one thread; 'all threads' call it with parts of the rays."
        + ("" if FAST else " numba is not installed: pip install qmcjax[fast].")
        + ("" if EMBREE else " Embree is not installed: pip install embreex."),
    }
    return _drawn(measured), numbers


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
    chosen = {
        "fused loops": ways.loops if world.count <= LOOPED else None,
        "tree, JAX": ways.trees if trees else None,
        "compiled": ways.compiled if FAST else None,
    }

    def found(way: ways.Way, origin: Any, direction: Any, time: Any = None, limit: Any = None) -> Any:
        count = len(origin)
        time = jnp.zeros(count) if time is None else time
        limit = jnp.full(count, jnp.inf) if limit is None else limit
        return jax.block_until_ready(way(world, origin, direction, time, limit, any_hit))

    return {name: partial(found, way) for name, way in chosen.items() if way is not None}


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

    return _measured({name: partial(both, name) for name in nearest if name in ways}, 2 * count, turns)


def _measured(ways: dict[str, Call], count: int, turns: int) -> dict[str, dict[str, float]]:
    """Return rays a second of medians, those of the least processor time, and seconds of the first call."""
    calls = {name: lambda _, call=call: call() for name, call in ways.items()}
    return {
        name: {
            "per second": count / median(taken),
            "per processor second": count / max(min(one.processors for one in taken[1:]), 1e-9),
            "seconds of the first call": taken[0].clock,
        }
        for name, taken in in_turns(calls, turns).items()
    }


def _drawn(measured: dict[str, dict[str, dict[str, float]]]) -> Figure:
    figure = Figure(figsize=(12, 1.6 + 0.45 * len(measured)), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    names = [way for way in WAYS if any(way in ways for ways in measured.values())]
    for ax, unit in zip(panels, ("per second", "per processor second"), strict=True):
        for row, found in enumerate(measured.values()):
            rates = [of[unit] for of in found.values()]
            ax.plot([min(rates), max(rates)], [row, row], color="0.8", lw=1, zorder=0)
        for name in names:
            rows = [row for row, ways in enumerate(measured.values()) if name in ways]
            rates = [ways[name][unit] for ways in measured.values() if name in ways]
            color, marker = LOOKS[name]
            # Hollow, so that none hides another.
            ax.plot(rates, rows, marker, color=color, ms=6, mfc="none", mew=1.5, label=name)
        ax.set(xscale="log", xlabel=f"rays {unit}", title=f"Rays {unit} (further right is better)")
        ax.grid(axis="x", alpha=0.3)
    panels[0].set_yticks(np.arange(len(measured)), list(measured))
    panels[0].set_ylim(len(measured) - 0.5, -0.5)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure

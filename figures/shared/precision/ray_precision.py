"""Errors of rays in single precision: on surfaces, far away, small, huge, grazing."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from qmcjax import sequences, tracing

AWAY = tuple(10.0**k for k in range(-3, 7))
"""Distances of a body of size 1 from the origin of coordinates."""

SIZES = tuple(10.0**k for k in range(-12, 13, 2))
SLOPES = tuple(10.0**-k for k in range(8))
Curves = dict[str, dict[float, float]]
"""Errors, or parts of the rays, over what is stressed, by body and precision."""

NOTE = (
    "{count} rays each, from fixed keys, in float32 and float64. Bodies of size 1: rays from outside hit "
    "them, and their points are the origins of further rays. 'Leaving a body': of rays that leave a "
    "convex body at more than 3 degrees, the part that meets it again; 'entering it': of rays into it at "
    "more than 3 degrees, the part that meets nothing, or missed the body at first: a point so near to "
    "two surfaces that rounding cannot decide is on both. 'Size': a mesh of 320 triangles around the "
    "origin, all of it scaled; the part of the rays at points of its edges that miss it (squares of "
    "squares overflow, or underflow); and one triangle, seen from as far as it is large, or from 1 if it "
    "is larger: the part that misses it or, leaving it, meets it again. An origin within 16 units of "
    "rounding of its coordinates is on it. 'Grazing': rays from the height 1 at a plane, relative error "
    "of the distance against the exact one. 'Pictures': RMS difference over the mean between float32 and "
    "float64 of direct light on a sphere, a box and a mesh."
)


def _mesh() -> NDArray[np.float64]:
    """Return the triangles of a sphere, (320, 3, 3), with vertices at 162 even points."""
    k = np.arange(162) + 0.5
    points = _on_sphere(1 - 2 * k / 162, np.pi * (1 + 5**0.5) * k)
    triangles = points[ConvexHull(points).simplices]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = np.sum(normals * triangles[:, 0], axis=1) < 0
    return 0.5 * np.where(inward[:, None, None], triangles[:, ::-1], triangles)


def _bodies(place: NDArray[np.float64]) -> dict[str, tracing.Object]:
    return {
        "sphere": tracing.sphere(place, 0.5),
        "box": tracing.box(place - 0.5, place + 0.5),
        "mesh": tracing.triangles(_mesh() + place),
        "cylinder": tracing.cylinder(place - [0, 0.5, 0], [0, 1, 0], 0.5),
    }


def _directions(count: int, key: int) -> NDArray[np.float64]:
    u = np.asarray(sequences.owen(sequences.sobol(2), key).points(count), np.float64)
    return _on_sphere(1 - 2 * u[:, 0], 2 * np.pi * u[:, 1])


def _on_sphere(z: NDArray, angle: NDArray) -> NDArray[np.float64]:
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=-1)


def _in_both(measure: Callable[[Any], Curves]) -> Curves:
    """Return curves in both precisions, those of one body after each other."""
    with jax.enable_x64(True):
        wide = measure(jnp.float64)
    narrow = measure(jnp.float32)
    return {
        f"{name}, {kind}": curves[name]
        for name in narrow
        for kind, curves in (("float32", narrow), ("float64", wide))
    }


def leaving(count: int, side: float) -> Curves:
    """Return the part of the rays from points of a body, to one side, that goes wrong."""

    def measure(dtype: Any) -> Curves:
        curves: Curves = {}
        outwards, onwards = (jnp.asarray(_directions(count, key), dtype) for key in (1, 2))
        for away in AWAY:
            place = away * np.array([0.6, 0.64, 0.48])
            for name, body in _bodies(place).items():
                world = tracing.world([body])
                origin = jnp.asarray(place, dtype)[None] + 2 * outwards
                hit = tracing.nearest_hit(world, origin, -outwards)
                slope = jnp.sum(onwards * hit.normal, axis=1, keepdims=True)
                way = jnp.where(slope * side > 0, onwards, -onwards)
                again = tracing.any_hit(world, hit.point, way)
                counted = (hit.shape >= 0) & (abs(slope[:, 0]) > 0.05)
                wrong = again if side > 0 else ~again
                if side < 0:
                    wrong, counted = wrong | (hit.shape < 0), counted | (hit.shape < 0)
                if counted.any():
                    curves.setdefault(name, {})[away] = float(jnp.sum(wrong & counted) / jnp.sum(counted))
        return curves

    return _in_both(measure)


def sizes(count: int) -> Curves:
    """Return the part of rays at points of the edges of a mesh that miss it."""
    mesh = _mesh()
    edges = np.concatenate([mesh, np.roll(mesh, 1, axis=1)], axis=-1).reshape(-1, 6)
    chosen = edges[np.arange(count) % len(edges)]
    part = np.asarray(sequences.van_der_corput().points(count), np.float64)
    target = chosen[:, :3] + part * (chosen[:, 3:] - chosen[:, :3])
    origin = 2 * _directions(count, 3)
    # An edge of the silhouette may be missed: those are well in front of it.
    up = target / np.linalg.norm(target, axis=1, keepdims=True)
    origin = 1.5 * up + 0.3 * origin

    def measure(dtype: Any) -> Curves:
        curve = {}
        for size in SIZES:
            world = tracing.world([tracing.triangles(size * mesh)])
            start, end = jnp.asarray(size * origin, dtype), jnp.asarray(size * target, dtype)
            curve[size] = float(jnp.mean(~tracing.any_hit(world, start, end - start)))
        return {"mesh": curve, "lone triangle": _lone(count, dtype)}

    return _in_both(measure)


def _lone(count: int, dtype: Any) -> dict[float, float]:
    """Return the part of rays near the middle of one triangle that miss it, or meet it again.

    They are as long as it is, but no longer than 1: a huge one is seen from near by.
    """
    turn = np.linalg.qr(np.array([[1.0, 0.3, -0.2], [0.4, 1.0, 0.5], [-0.6, 0.1, 1.0]]))[0]
    corners = np.array([[-1.0, 0.0, -0.6], [1.0, 0.0, -0.6], [0.1, 0.0, 1.1]]) @ turn
    inwards, onwards, middle = (_directions(count, key) for key in (5, 6, 7))
    inwards, onwards = (way[np.abs(way[:, 1]) > 0.05] for way in (inwards, onwards))
    rays = min(len(inwards), len(onwards))
    up = [np.where(way[:rays, 1:2] > 0, way[:rays], -way[:rays]) @ turn for way in (inwards, onwards)]
    target = 0.4 * (middle[:rays] * [1.0, 0.0, 1.0]) @ turn
    curve = {}
    for size in SIZES:
        world = tracing.world([tracing.triangles(size * corners[None])])
        start = jnp.asarray(min(1.0, size) * (target + up[0]), dtype)
        hit = tracing.nearest_hit(world, start, jnp.asarray(-up[0], dtype))
        again = tracing.any_hit(world, hit.point, jnp.asarray(up[1], dtype))
        curve[size] = float(jnp.mean((hit.shape < 0) | again))
    return curve


def grazing(count: int) -> Curves:
    """Return relative errors of distances to a plane."""
    angle = 2 * np.pi * np.asarray(sequences.van_der_corput().points(count), np.float64)[:, 0]

    def measure(dtype: Any) -> Curves:
        curve = {}
        world = tracing.world([tracing.plane([0, 0, 0], [0, 1, 0])])
        for slope in SLOPES:
            slanted = np.stack([np.cos(angle), np.full_like(angle, -slope), np.sin(angle)], axis=-1)
            way = jnp.asarray(slanted, dtype)
            origin = jnp.broadcast_to(jnp.asarray([0, 1, 0], dtype), way.shape)
            distance = np.asarray(tracing.nearest_hit(world, origin, way).distance, np.float64)
            exact = -1 / np.asarray(way, np.float64)[:, 1]
            curve[slope] = float(np.max(abs(distance / exact - 1)))
        return {"plane": curve}

    return _in_both(measure)


def pictures(count: int) -> Curves:
    """Return how far pictures in float32 are from those in float64."""
    points = sequences.owen(sequences.sobol(2), 4).points(count)
    curve: Curves = {"direct light, float32": {}}
    for away in AWAY:
        place = away * np.array([0.6, 0.64, 0.48])
        bodies = _bodies(place)

        def at(x: float, y: float, z: float, place: Any = place) -> Any:
            return place + np.array([x, y, z])

        mesh = tracing.triangles(_mesh() + at(-1.0, 0.0, 0.2))
        parts = [bodies["sphere"], tracing.box(at(0.6, -0.5, -0.5), at(1.2, 0.3, 0.5)), mesh]
        world = tracing.world(parts, [tracing.point_light(at(1.0, 3.0, 3.0), 10.0)])
        scene = tracing.direct_light(world, tracing.camera(at(0.0, 0.5, 4.0), place))
        narrow = np.asarray(_values(scene, points), np.float64)
        with jax.enable_x64(True):
            wide = np.asarray(_values(scene, points.astype(jnp.float64)))
        difference = np.sqrt(np.mean((narrow - wide) ** 2)) / wide.mean()
        curve["direct light, float32"][away] = float(difference)
    return curve


@jax.jit
def _values(scene: Any, points: Any) -> Any:
    return scene(points)

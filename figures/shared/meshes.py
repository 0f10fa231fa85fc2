"""Triangle meshes made by code, with rays of a camera and rays through trees: what trees are measured on."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from analysis import trees
from qmcjax import scenes, tracing

Triangles = NDArray[np.float64]
"""(n, 3, 3): triangle, vertex, coordinate."""


class Mesh(NamedTuple):
    """Triangles and a camera."""

    triangles: Triangles
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float = 60.0
    """Degrees, up and across."""


def surface(points: NDArray) -> Triangles:
    """Return the triangles of a net of points, (rows, columns, 3), two for each mesh."""
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.stack([np.stack([a, b, c], 2), np.stack([a, c, d], 2)], 2).reshape(-1, 3, 3)


def quad(corner: Any, u: Any, v: Any, across: int, down: int) -> Triangles:
    """Return a rectangle as so many squares by so many."""
    s, t = np.linspace(0, 1, across + 1)[:, None, None], np.linspace(0, 1, down + 1)[None, :, None]
    return surface(np.asarray(corner, float) + s * np.asarray(u, float) + t * np.asarray(v, float))


def box(low: Any, high: Any, parts: int) -> Triangles:
    """Return a box whose faces have parts by parts squares."""
    low, edges = np.asarray(low, float), np.diag(np.subtract(high, low))
    faces = []
    for k in range(3):
        u, v, w = edges[k], edges[(k + 1) % 3], edges[(k + 2) % 3]
        faces += [quad(low, v, u, parts, parts), quad(low + w, u, v, parts, parts)]
    return np.concatenate(faces)


def sphere(center: Any, radius: float, parts: int) -> Triangles:
    """Return a sphere of 4 parts**2 triangles, but for the empty ones at its poles."""
    polar, turn = np.linspace(0, np.pi, parts + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * parts + 1)
    ring = [np.sin(polar) * np.cos(turn), np.cos(polar) + 0 * turn, np.sin(polar) * np.sin(turn)]
    return _solid(surface(np.asarray(center, float) + radius * np.stack(ring, axis=2)))


def cylinder(base: Any, axis: Any, radius: float, parts: int, along: int) -> Triangles:
    """Return a cylinder without ends, of 2 parts strips of so many squares."""
    axis = np.asarray(axis, float)
    frame = np.linalg.svd(axis[None] / np.linalg.norm(axis))[2][1:]
    turn = np.linspace(0, 2 * np.pi, 2 * parts + 1)[:, None]
    rim = np.asarray(base, float) + radius * (np.cos(turn) * frame[0] + np.sin(turn) * frame[1])
    return surface(rim[None] + np.linspace(0, 1, along + 1)[:, None, None] * axis)


def _solid(triangles: Triangles) -> Triangles:
    a, b, c = np.moveaxis(triangles, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return triangles[area > 1e-12 * area.max()]


def knot(p: int, q: int, along: int, around: int, thickness: float = 0.35) -> Triangles:
    """Return a tube around a torus knot."""

    def curve(t: NDArray) -> NDArray:
        r = 2 + np.cos(q * t)
        return np.stack([r * np.cos(p * t), r * np.sin(p * t), -np.sin(q * t)], axis=-1)

    t = np.linspace(0, 2 * np.pi, along + 1)
    tangent = curve(t + 1e-4) - curve(t - 1e-4)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    outward = curve(t) - (curve(t + 1e-2) + curve(t - 1e-2)) / 2
    outward -= np.sum(outward * tangent, axis=1, keepdims=True) * tangent
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    side = np.cross(tangent, outward)
    turn = np.linspace(0, 2 * np.pi, around + 1)[None, :, None]
    ring = np.cos(turn) * outward[:, None] + np.sin(turn) * side[:, None]
    return surface(curve(t)[:, None] + thickness * ring)


def rotations(count: int, key: int) -> NDArray[np.float64]:
    """Return random rotation matrices."""
    found = np.linalg.qr(np.random.default_rng(key).normal(size=(count, 3, 3)))[0]
    return found * np.sign(np.linalg.det(found))[:, None, None]


def rooms(floors: int, row: int, parts: int) -> Mesh:
    """Return floors of some rooms in a row, with doors, tables, chairs, books, lamps, pillars and blinds.

    Faces are parts by parts squares, floors and walls some more; 1 makes large and long triangles, as models
    of buildings have them.
    """
    rng = np.random.default_rng(1)
    found = []
    for floor in range(floors):
        for room in range(row):
            inside = _room(room, parts, rng) + _shell(room, parts)
            found.append(np.concatenate(inside) + np.array([0, 3.2 * floor, 0]))
    return Mesh(np.concatenate(found), (0.4, 1.7, 4.6), (9.0, 0.9, 1.6), 75.0)


def _shell(room: int, parts: int) -> list[Triangles]:
    x, more = 6.0 * room, parts * parts
    shell = [
        quad([x, 0, 0], [0, 0, 5], [6, 0, 0], more, more),
        quad([x, 3, 0], [6, 0, 0], [0, 0, 5], more, more),
        quad([x, 0, 0], [6, 0, 0], [0, 3, 0], more, more),
    ]
    if room:  # A wall with a door.
        shell += [
            box([x - 0.1, 0, 0], [x + 0.1, 3, 1.8], parts),
            box([x - 0.1, 0, 3], [x + 0.1, 3, 5], parts),
        ]
    return shell


def _room(room: int, parts: int, rng: np.random.Generator) -> list[Triangles]:
    x, few, round_ = 6.0 * room, max(1, parts // 2), parts + 5
    angle = rng.uniform(-0.4, 0.4)
    table = [box([-1.2, 0.72, -0.8], [1.2, 0.78, 0.8], parts)]
    table += [box([u, 0, w], [u + 0.1, 0.72, w + 0.1], few) for u in (-1.1, 1.0) for w in (-0.7, 0.6)]
    for seat in range(4):
        a, b = 1.1 * (seat % 2) - 0.9, -1.4 if seat < 2 else 1.0
        back = b if seat < 2 else b + 0.41
        table += [box([a, 0.42, b], [a + 0.45, 0.47, b + 0.45], few)]
        table += [
            box([a + 0.09 * k, 0.47, back], [a + 0.09 * k + 0.05, 1.0, back + 0.03], few) for k in range(5)
        ]
        for u in (0.02, 0.42):
            table += [cylinder([a + u, 0, b + w], [0, 0.42, 0], 0.02, round_, few) for w in (0.02, 0.42)]
    table.append(sphere([-0.4, 0.9, -0.2], 0.12, round_))
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    found = [np.concatenate(table) @ turn.T + np.array([x + 3.0, 0, 2.6])]
    for level in range(4):
        y = 0.5 + 0.5 * level
        found.append(box([x + 0.6, y, 0.02], [x + 5.4, y + 0.03, 0.35], parts))
        at = x + 0.65
        while at < x + 5.2:
            width, height = rng.uniform(0.02, 0.07), rng.uniform(0.25, 0.42)
            found.append(box([at, y + 0.03, 0.05], [at + width, y + 0.03 + height, 0.3], few))
            at += width + rng.choice([0.003, 0.003, 0.2])
    # Blinds: slats in front of the open side, each one long.
    found += [box([x + 0.2, 1.2 + 0.06 * k, 4.9], [x + 3.8, 1.21 + 0.06 * k, 4.95], few) for k in range(28)]
    found.append(sphere([x + 3, 2.3, 2.4], 0.25, round_))
    found.append(cylinder([x + 3, 2.5, 2.4], [0, 0.5, 0], 0.02, round_, few))
    found.append(cylinder([x + 5.6, 0, 4.4], [0, 3, 0], 0.15, round_, few))
    return found


def knots(detail: int) -> Mesh:
    """Return a crowd of torus knots, each turned by itself, on a square."""
    count = 25
    turned = rotations(count, 2)
    parts = []
    for k in range(count):
        one = knot(*((2, 3), (3, 2), (2, 5), (3, 4))[k % 4], 12 * detail, detail)
        aside = np.random.default_rng(k).normal(size=3) * [1, 0.6, 1]
        parts.append(one @ turned[k].T + (np.array([5.5 * (k % 5), 0, 5.5 * (k // 5)]) + aside))
    return Mesh(np.concatenate(parts), (-6.0, 11.0, -9.0), (11.0, 0.0, 10.0), 60.0)


def terrain(detail: int) -> Mesh:
    """Return a landscape of waves of random directions, whose heights fall with their lengths."""
    rng = np.random.default_rng(3)
    x, z = np.meshgrid(*[np.linspace(0, 10, 12 * detail + 1)] * 2, indexing="ij")
    y = np.zeros_like(x)
    for k in range(48):
        frequency = 0.6 * 1.09**k
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        y += 0.7 / frequency**1.1 * np.sin(frequency * (np.cos(angle) * x + np.sin(angle) * z) + phase)
    return Mesh(surface(np.stack([x, y, z], axis=2)), (-1.0, 3.4, -1.0), (5.0, 0.0, 5.5), 60.0)


def helicopter(detail: int) -> Mesh:
    """Return the helicopter of `scenes.helicopter`, in triangles, half-way through the shutter."""
    parts = [triangles for triangles, _ in helicopter_parts(detail, np.array([0.5]))]
    return Mesh(np.concatenate([part[0] for part in parts]), (5.5, 7.2, 8.6), (-0.3, 2.0, 0.0), 50.0)


def helicopter_parts(detail: int, times: NDArray) -> list[tuple[NDArray[np.float64], bool]]:
    """Return triangles of each object at some times, (k, n, 3, 3), and whether it moves; last the ground."""
    found: list[tuple[NDArray[np.float64], bool]] = []
    for item in scenes.helicopter().estimator.world.objects[:-1]:
        own = np.concatenate([_tessellate(shape, detail) for shape in item.shapes])
        matrix, translation = (np.asarray(a, np.float64) for a in item.motion(jnp.asarray(times)))
        found.append((np.einsum("tij,nvj->tnvi", matrix, own) + translation[:, None, None], True))
    ground = quad([-9, 0, -9], [0, 0, 18], [18, 0, 0], 4 * detail, 4 * detail)
    found.append((np.broadcast_to(ground, (len(times), *ground.shape)), False))
    return found


def _tessellate(shape: Any, detail: int) -> Triangles:
    if isinstance(shape, tracing.Triangles):
        found = np.asarray(shape.vertices, np.float64)
        for _ in range(max(0, int(np.log2(detail / 4)))):
            a, b, c = found[:, 0], found[:, 1], found[:, 2]
            d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
            found = np.stack([a, d, f, d, b, e, f, e, c, d, e, f], 1).reshape(-1, 3, 3)
        return _solid(found)
    if isinstance(shape, tracing.Rectangle):
        given = zip(np.asarray(shape.corner), np.asarray(shape.edge_u), np.asarray(shape.edge_v), strict=True)
        return np.concatenate([quad(a, u, v, 2 * detail, detail) for a, u, v in given])
    if isinstance(shape, tracing.Cylinder):
        given = zip(np.asarray(shape.base), np.asarray(shape.axis), np.asarray(shape.radius), strict=True)
        return np.concatenate([cylinder(a, u, float(r), detail, detail) for a, u, r in given])
    if isinstance(shape, tracing.Sphere):
        given = zip(np.asarray(shape.center), np.asarray(shape.radius), strict=True)
        return np.concatenate([sphere(a, float(r), detail) for a, r in given])
    given = zip(np.asarray(shape.center), np.asarray(shape.axis), np.asarray(shape.radius), strict=True)
    return np.concatenate([_disc(a, u, float(r), detail) for a, u, r in given])


def _disc(center: Any, axis: Any, radius: float, parts: int) -> Triangles:
    frame = np.linalg.svd(np.asarray(axis, float)[None])[2][1:]
    turn, out = np.linspace(0, 2 * np.pi, 2 * parts + 1)[:, None, None], np.linspace(0, radius, 3)[:, None]
    rings = out * (np.cos(turn) * frame[0] + np.sin(turn) * frame[1])
    return _solid(surface(np.asarray(center, float) + rings))


MESHES: dict[str, dict[str, Callable[[], Mesh]]] = {
    "rooms": {
        "draft": lambda: rooms(1, 2, 1),
        "paper": lambda: rooms(4, 3, 1),
        "large": lambda: rooms(20, 15, 1),
    },
    "rooms, tessellated": {
        "draft": lambda: rooms(1, 1, 2),
        "paper": lambda: rooms(1, 3, 5),
        "large": lambda: rooms(3, 9, 5),
    },
    "knots": {"draft": lambda: knots(3), "paper": lambda: knots(10), "large": lambda: knots(28)},
    "terrain": {"draft": lambda: terrain(4), "paper": lambda: terrain(14), "large": lambda: terrain(40)},
    "helicopter": {
        "draft": lambda: helicopter(5),
        "paper": lambda: helicopter(20),
        "large": lambda: helicopter(60),
    },
}
"""How they are made, by name and size: of drafts, of paper quality, and of its tables of whole trees."""


def made(name: str, size: str) -> Mesh:
    """Return a mesh."""
    return MESHES[name][size]()


def corners(triangles: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the boxes of triangles, (..., n, 3, 3)."""
    return triangles.min(axis=-2), triangles.max(axis=-2)


def camera_rays(mesh: Mesh, side: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rays through the centres of side x side pixels, the upper left first: (side * side, 3)."""
    toward = np.subtract(mesh.target, mesh.eye)
    toward /= np.linalg.norm(toward)
    right = np.cross(toward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    up, reach = np.cross(right, toward), np.tan(np.radians(mesh.fov / 2))
    place = ((np.arange(side) + 0.5) / side * 2 - 1) * reach
    way = toward + place[None, :, None] * right - place[:, None, None] * up
    return np.broadcast_to(mesh.eye, (side * side, 3)).astype(float), way.reshape(-1, 3)


class Rays(NamedTuple):
    """Arrays of shape (n, 3)."""

    origin: NDArray[np.float64]
    direction: NDArray[np.float64]


class Found(NamedTuple):
    """What rays came to."""

    visits: NDArray[np.int64]
    """How many nodes each ray visits."""
    distance: NDArray[np.float64]
    """Of the nearest hit, inf if there is none."""
    leaf: NDArray[np.int64]
    """Where that is."""


def trace(
    tree: trees.Tree,
    rays: Rays,
    distance: Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.float64]],
    time: NDArray[np.float64] | None = None,
) -> Found:
    """Send rays through a tree, and note what they hit."""
    nearest, hit = np.full(len(rays.origin), np.inf), np.zeros(len(rays.origin), np.int64)

    def noted(ray: NDArray[np.int64], leaf: NDArray[np.int64]) -> NDArray[np.float64]:
        found = distance(ray, leaf)
        closer = found < nearest[ray]
        nearest[ray[closer]], hit[ray[closer]] = found[closer], leaf[closer]
        return found

    return Found(trees.nodes_visited(tree, *rays, noted, time=time), nearest, hit)


def bounce(triangles: NDArray[np.float64], rays: Rays, found: Found, key: int) -> Rays:
    """Return rays from what was hit, in random directions as a diffuse surface scatters them."""
    hit = np.isfinite(found.distance)
    way = rays.direction[hit]
    a, b, c = np.moveaxis(triangles[found.leaf[hit]], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= -np.sign(np.sum(normal * way, axis=1, keepdims=True))
    # The normal and a point of the unit sphere.
    ball = np.random.default_rng(key).normal(size=way.shape)
    scattered = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
    point = rays.origin[hit] + found.distance[hit, None] * way
    return Rays(point + 1e-6 * np.abs(point).max() * normal, scattered)


def leaf_depths(tree: trees.Tree) -> tuple[int, float]:
    """Return the largest and the mean depth of leaves."""
    depth = trees.node_depths(tree)[: tree.size]
    return int(depth.max()), float(depth.mean())

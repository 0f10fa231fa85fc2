"""What several test files compare with: definitions in NumPy and float64."""

from itertools import product
from typing import NamedTuple

import numpy as np

from qmcjax.core.plug_ins import unwrap


def rank(rows):
    """Return the rank of a matrix over F2, whose rows are integers or sequences of digits."""
    pivots = {}
    for row in rows:
        row = row if isinstance(row, int) else int("".join(str(int(digit)) for digit in row), 2)
        while row and (top := row.bit_length()) in pivots:
            row ^= pivots[top]
        if row:
            pivots[top] = row
    return len(pivots)


def dot(a, b):
    return np.sum(a * b, axis=-1)


def everywhere(x):
    return np.ones(x.shape[:-1])


def flat(ray, point, normal, inside):
    """Return where rays cross planes: distances, normals, and how far inside of the edge of a shape."""
    origin, way = ray
    distance = dot(point - origin, normal) / dot(way, normal)
    return [(distance, normal, inside(origin + distance[..., None] * way))]


def curved(ray, center, radius, across, inside):
    """Return the same of spheres, or of cylinders, by what is across their axes."""
    p, q = across(ray[0] - center), across(ray[1])
    half, squared = dot(p, q), dot(q, q)
    root = np.sqrt(half * half - squared * (dot(p, p) - radius**2))
    distances = (-half - root) / squared, (-half + root) / squared
    points = [ray[0] + distance[..., None] * ray[1] for distance in distances]
    return [(t, across(x - center), inside(x)) for t, x in zip(distances, points, strict=True)]


def of_rectangle(ray, time, corner, u, v):
    def inside(x):
        parts = np.einsum("mij,nmj->nmi", np.linalg.pinv(np.stack([u, v], axis=-1)), x - corner)
        return np.minimum(parts, 1 - parts).min(axis=-1)

    return flat(ray, corner, np.cross(u, v), inside)


def of_box(ray, time, low, high):
    def face(axis, side):
        others = [j for j in range(3) if j != axis]
        inside = lambda x: np.minimum(x - low, high - x)[..., others].min(axis=-1)  # noqa: E731
        return flat(ray, high if side > 0 else low, side * np.eye(3)[axis], inside)

    return [hit for where in product(range(3), (-1, 1)) for hit in face(*where)]


def of_cylinder(ray, time, base, axis, radius):
    def along(a):
        return dot(a, axis) / dot(axis, axis)

    def inside(x):
        return np.minimum(along(x - base), 1 - along(x - base))

    return curved(ray, base, radius, lambda a: a - along(a)[..., None] * axis, inside)


def of_triangle(ray, time, vertices, close=None):
    """Return hits with the least of the three weights of a point."""
    if close is not None:
        part = np.asarray(time)[..., None, None, None]
        vertices = (1 - part) * vertices + part * close
    a, b, c = np.moveaxis(vertices, -2, 0)
    normal = np.cross(b - a, c - a)

    def inside(x):
        weights = [dot(np.cross(q - p, x - p), normal) for p, q in ((a, b), (b, c), (c, a))]
        return np.min(weights, axis=0) / dot(normal, normal)

    return flat(ray, a, normal, inside)


KINDS = {
    "Plane": lambda ray, time, point, axis: flat(ray, point, axis, everywhere),
    "Disc": lambda ray, time, center, axis, radius: flat(
        ray, center, axis, lambda x: radius - np.linalg.norm(x - center, axis=-1)
    ),
    "Sphere": lambda ray, time, center, radius: curved(ray, center, radius, lambda a: a, everywhere),
    "Rectangle": of_rectangle,
    "Box": of_box,
    "Cylinder": of_cylinder,
    "Triangles": of_triangle,
}


class Nearest(NamedTuple):
    """The nearest hits of rays; infinite, -1 and 0 if there is none."""

    distance: np.ndarray
    number: np.ndarray
    normal: np.ndarray
    doubt: np.ndarray
    """How near rays are to an edge, or to their origin, in the size of primitives."""
    gap: np.ndarray
    """How far behind the nearest hit the next one is."""


@np.errstate(all="ignore")
def nearest_hits(objects, origin, direction, time):
    """Test all primitives of objects of ``qmcjax.tracing`` with all rays, (n, 3) twice and (n,)."""
    origin, direction, time = (np.asarray(a, np.float64) for a in (origin, direction, time))
    # With a miss, lest there is nothing.
    miss = np.full((len(time), 1), np.inf)
    found, first = [(miss, np.full(miss.shape, -1), np.zeros((len(time), 1, 3)), miss)], 0
    for item in objects:
        ray, back = (origin, direction), np.eye(3)
        if item.motion is not None:
            matrix, translation = (np.asarray(a, np.float64) for a in unwrap(item.motion)(time))
            back = np.linalg.inv(matrix)
            ray = [np.einsum("nij,nj->ni", back, a) for a in (origin - translation, direction)]
        for shape in item.shapes:
            given = {name: np.asarray(a, np.float64) for name, a in vars(shape).items() if name != "tree"}
            given = [a for a in given.values() if a.ndim]
            size = np.max([abs(a).reshape(len(a), -1).max(axis=1) for a in given], axis=0)
            for t, normal, inside in KINDS[type(shape).__name__]([a[:, None] for a in ray], time, *given):
                ahead = (t > 0) & (t < np.inf)
                number = np.broadcast_to(first + np.arange(shape.count), t.shape)
                height = abs(t * dot(ray[1][:, None], normal)) / np.linalg.norm(normal, axis=-1)
                within = np.minimum(np.minimum(inside, t), 5 * height / np.maximum(size, 1))
                doubt = np.where(ahead, np.where(inside > 0, within, -inside), np.inf)
                away = np.where(ahead & (inside > 0), t, np.inf)
                found.append((away, number, np.broadcast_to(normal, (*t.shape, 3)) @ back, doubt))
            first += shape.count
    distance, number, normal, doubt = (np.concatenate(parts, axis=1) for parts in zip(*found, strict=True))
    best = distance.argmin(axis=1)[:, None]
    one, other = np.sort(np.concatenate([distance, miss], axis=1), axis=1)[:, :2].T
    normal = np.take_along_axis(normal, best[..., None], axis=1)[:, 0]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    gap = np.where(np.isfinite(other), (other - one) / np.maximum(one, 1), np.inf)
    return Nearest(one, np.take_along_axis(number, best, axis=1)[:, 0], normal, doubt.min(axis=1), gap)

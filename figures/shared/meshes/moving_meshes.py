"""Triangle meshes in motion: what trees over time are measured on."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.shared.meshes.mesh_models import Mesh, helicopter_parts, knots, terrain


class Moving(NamedTuple):
    times: NDArray[np.float64]
    triangles: NDArray[np.float64]
    """(k, n, 3, 3): at each of the times; vertices are on straight lines between."""
    view: Mesh
    """The mesh when the shutter opens, with its camera."""


def flying_helicopter(detail: int, segments: int = 36) -> Moving:
    """Return the helicopter over still ground, its motion in linear segments."""
    times = np.linspace(0, 1, segments + 1)
    parts = np.concatenate([part for part, _ in helicopter_parts(detail, times)], axis=1)
    return Moving(times, parts, Mesh(parts[0], (5.5, 7.2, 8.6), (-0.3, 2.0, 0.0), 50.0))


def flying_knots(detail: int) -> Moving:
    """Return the crowd of knots, each on a line of its own, some of them fast."""
    mesh = knots(detail)
    count = len(mesh.triangles) // 25
    way = np.random.default_rng(4).normal(size=(25, 1, 1, 3)) * np.array([2.5, 0.5, 2.5])
    end = mesh.triangles.reshape(25, count, 3, 3) + way
    return Moving(np.array([0.0, 1.0]), np.stack([mesh.triangles, end.reshape(-1, 3, 3)]), mesh)


def hail(detail: int, count: int) -> Moving:
    """Return small triangles that fall far over a still terrain; the first along the diagonal of all."""
    ground = terrain(detail)
    rng = np.random.default_rng(5)
    low, high = (end(ground.triangles, axis=(0, 1)) for end in (np.min, np.max))
    start = rng.uniform([0, high[1], 0], [10, high[1] + 3, 10], (count, 3))
    end = start + rng.normal(size=(count, 3)) * 0.4 - np.array([0, 3.0, 0])
    around = np.concatenate([start, end, [low, high]])
    start[0], end[0] = around.min(axis=0), around.max(axis=0)
    shapes = 0.05 * rng.normal(size=(count, 3, 3))
    stones, fallen = start[:, None] + shapes, end[:, None] + shapes
    moved = np.concatenate([ground.triangles, fallen])
    opened = np.concatenate([ground.triangles, stones])
    return Moving(np.array([0.0, 1.0]), np.stack([opened, moved]), ground._replace(triangles=opened))

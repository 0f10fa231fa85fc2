"""Sets of points of all kinds, for measures: on integer grids, so that oracles are exact."""

import math

import numpy as np

KINDS = ("random", "lattice", "grid", "planted", "cluster", "scales", "line", "boundary", "repeated")


def on_grid(kind, dims, n, side, seed=7, shear=0):
    """Return n points of {0, ..., side - 1}^dims in random order; rows of tiles are shifted by ``shear``."""
    rng = np.random.default_rng(seed)
    index, points = np.arange(n)[:, None], rng.integers(0, side, (n, dims))
    if kind == "lattice":
        points = index * points[0] + rng.integers(0, side)
    elif kind in ("grid", "planted"):
        per_axis = math.ceil(n ** (1 / dims))
        step = max(1, side // per_axis)
        points = index // per_axis ** np.arange(dims) % per_axis * step + rng.integers(0, side, dims)
        if kind == "planted":  # one closest pair, in any direction, for every second seed across a side
            other = points[rng.integers(0, n)].copy()
            points[0] = other + rng.integers(-step, step + 1, dims)
            points += seed % 2 * (side - other + rng.integers(-step // 2, step // 2 + 1, dims))
            points[:, 0] -= shear * (points[:, 1] // side) if shear else 0
    elif kind == "cluster":
        points = points[0] + rng.integers(0, max(2, side // 1000), (n, dims))
    elif kind == "scales":
        points = points[0] + (points >> rng.integers(0, 20, (n, 1)))
    elif kind == "line":
        points[:, rng.permutation(dims)[: dims - 1]] = side // 2
    elif kind == "boundary":
        points = np.where(rng.random((n, dims)) < 0.5, rng.choice([0, side - 1], (n, dims)), points)
    elif kind == "repeated":
        points = points[rng.integers(0, n, n)]
    return rng.permutation(points % side)


def cube(side, dims):
    """Return the integer points of a cube of this side, (side**dims, dims)."""
    return np.indices((side,) * dims).reshape(dims, -1).T

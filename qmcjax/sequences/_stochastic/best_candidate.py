"""Best-candidate sampling in scrambled nets in base 2: points far from all earlier ones."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.bits import hash_word
from qmcjax.core.jax_internals import alike
from qmcjax.sequences._scrambling.owen_exact import random_word

_REACH = 3
"""Cells on each side of a point's cell that contain its nearest neighbour.

The first 2**k points of a (0,2)-sequence have one in each square of two by two cells if k is even, and one in
each rectangle of two by one if k is odd: none is farther than sqrt(8) cells from the nearest.
"""


def best_candidates(words: Array, steps: Array, seeds: Array, candidates: int) -> Array:
    """Return the points of a scrambled sequence whose first two coordinates are chosen from candidates.

    ``words``: uint32 Array, shape (n, dims): the points drawn without candidates. ``steps``: uint32 Array,
    shape (dims, 32): maps indices to those of earlier points, see ``net_by_net.to_earlier``. ``seeds``:
    uint32 Array, shape (dims, 2). Returns uint32 Array, shape (n, dims).
    """
    n = words.shape[0]
    words, steps, seeds = alike((words, steps, seeds))
    numbers = jax.lax.iota(jnp.uint32, candidates)[None, :, None] * np.uint32(0x9E3779B9)
    seeds_of_candidates = hash_word(seeds[:2, None, :] + numbers)

    def put(k: Array, plane: Array) -> Array:
        return _next_net(plane, k, steps[:2, k], seeds_of_candidates)

    plane = jax.lax.fori_loop(np.uint32(0), np.uint32((n - 1).bit_length()), put, words[:, :2])
    return jnp.concatenate([plane, words[:, 2:]], axis=1)


def _next_net(points: Array, k: Array, steps: Array, seeds: Array) -> Array:
    """Place the points 2**k, ..., 2**(k + 1) - 1, one after another.

    The cells of the raster have half the side of the squares of area 2**-k, or of the short sides of the
    rectangles if k is odd. They contain at most one point each until there are 2**(k + 1). The raster stores
    numbers of points, 0 for empty cells.
    """
    n = points.shape[0]
    log_side = (k >> 1) + np.uint32(1)
    ones = (jnp.uint32(1) << log_side) - np.uint32(1)
    offsets = np.arange(-_REACH, _REACH + 1).astype(np.uint32)

    def cell(x: Array, y: Array) -> Array:
        return (x & ones) | ((y & ones) << log_side)

    def column(words: Array) -> Array:
        return words >> (np.uint32(32) - log_side)

    index = jax.lax.iota(jnp.uint32, n)
    cells = cell(column(points[:, 0]), column(points[:, 1]))
    size = 4 ** (((n - 1).bit_length() + 1) // 2)
    here = jnp.where(index < (jnp.uint32(1) << k), cells, np.uint32(size))
    raster = jnp.zeros(size, jnp.uint32).at[here].set(index + np.uint32(1), mode="drop")

    def put(index: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        points, raster = state
        earlier = jnp.stack([points[index ^ steps[j], j] for j in range(2)])
        unit = jnp.uint32(1) << (np.uint32(31) - k)
        behind = unit - np.uint32(1)
        start = (earlier ^ unit) & ~behind
        random = random_word(jnp.broadcast_to(index, seeds.shape[:2]), seeds)
        places = start[:, None] | (random & behind)

        x, y = column(start[0]) + offsets, column(start[1]) + offsets
        number = raster[cell(x[None, :], y[:, None])].ravel()
        neighbours = points[number - np.uint32(1)]
        squared = sum(
            # As signed integers, differences of words are the shortest ones on the torus.
            jnp.square((places[j][:, None] - neighbours[None, :, j]).astype(jnp.int32).astype(jnp.float32))
            for j in range(2)
        )
        nearest = jnp.where(number[None, :] > 0, squared, np.float32(np.inf)).min(axis=1)
        place = places[:, jnp.argmax(nearest)]
        point_cell = cell(column(place[0]), column(place[1]))
        return points.at[index].set(place), raster.at[point_cell].set(index + np.uint32(1))

    first = jnp.uint32(1) << k
    return jax.lax.fori_loop(first, jnp.minimum(first << 1, np.uint32(n)), put, (points, raster))[0]

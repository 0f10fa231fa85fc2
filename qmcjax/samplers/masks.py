"""How masks of blue noise are made: numbers by voids and clusters, vectors by reassignment.

Vectors are a pool of candidates, one for each pixel, arranged to minimise an energy of pairs of close pixels.
The usual method is annealing by swaps of two pixels. Here 64 pixels are reassigned at a time: for pixels
farther apart than the range of the energy, it is a sum of costs of single pixels, and the best of all 64!
permutations solves a linear assignment problem.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.sequences import sobol

Tile = NDArray[np.int64]
"""Shape (frames, side, side)."""

FILTER = 1.5
"""Standard deviation of the Gaussian of voids and clusters, in pixels and frames."""

REACH = 8
"""Pixels that are reassigned together differ by as much in at least one coordinate."""

WIDTH = 2.1
"""The weight of two pixels of a mask at distance r is exp(-(r / width)**2), by Georgiev and Fajardo."""

SWEEPS = 30
"""Mean number of reassignments per pixel."""


def mask_ranks(channels: int, side: int, frames: int) -> NDArray[np.int64]:
    """Return the ranks of a mask, shape (frames, side, side, channels): each once in a frame and channel."""
    rng = np.random.default_rng(1)
    if channels > 1:
        return vectors(channels, side, frames, SWEEPS, rng)
    ranks = void_and_cluster(side, frames, rng)
    return ranks.reshape(frames, -1).argsort(axis=1).argsort(axis=1).reshape(*ranks.shape, 1)


def void_and_cluster(side: int, frames: int, rng: np.random.Generator) -> Tile:
    """Return the ranks of a dither mask over space and time, by R. Ulichney, 1993, and A. Wolfe et al., 2022.

    The density of ones is summed over the pixels of a frame and over the frames of a pixel. The largest void
    of the ones is the tightest cluster of the zeros, since the filter's sums over both add up to a constant
    on the torus: so Ulichney's second and third phase are one here. The sums are of integers, so that ties do
    not depend on rounding.
    """
    bump = np.rint(_bump(side, side) * 2.0**40).astype(np.int64)
    near = np.flatnonzero(bump[0])
    window, in_time = bump[np.ix_(near, near)], np.rint(_bump(1, frames)[0] * 2.0**40).astype(np.int64)
    in_time[0] = 0
    density = np.zeros((frames, side, side), np.int64)
    # Ones are higher than all zeros. The extremes of all rows are kept.
    one = 1 << 60
    least, most = density[..., 0].copy(), density[..., 0].copy()

    def put(pixel: int, sign: int) -> None:
        t, y, x = np.unravel_index(pixel, density.shape)
        rows = (y + near) % side
        density[t, rows[:, None], (x + near) % side] += sign * window
        density[:, y, x] += sign * np.roll(in_time, t)
        density[t, y, x] += sign * one
        for touched in ((t, rows), (slice(None), y)) if frames > 1 else ((t, rows),):
            part = density[touched]
            least[touched], most[touched] = part.min(axis=-1), part.max(axis=-1)

    def cluster() -> int:
        row = int(np.argmax(most))
        return row * side + int(np.argmax(density.reshape(-1, side)[row]))

    def void() -> int:
        row = int(np.argmin(least))
        return row * side + int(np.argmin(density.reshape(-1, side)[row]))

    count = density.size // 10
    for pixel in rng.permutation(density.size)[:count].tolist():
        put(pixel, 1)
    while True:
        tightest = cluster()
        put(tightest, -1)
        largest = void()
        put(largest, 1)
        if largest == tightest:
            break
    prototype = np.flatnonzero(density >= one).tolist()
    ranks = np.empty(density.size, np.int64)
    for rank in reversed(range(count)):
        pixel = cluster()
        put(pixel, -1)
        ranks[pixel] = rank
    for pixel in prototype:
        put(pixel, 1)
    for rank in range(count, density.size):
        pixel = void()
        put(pixel, 1)
        ranks[pixel] = rank
    return ranks.reshape(density.shape)


def _bump(rows: int, columns: int) -> NDArray[np.float64]:
    down, right = (np.minimum(np.arange(count), count - np.arange(count)) for count in (rows, columns))
    return np.exp(-(down[:, None] ** 2 + right**2) / (2 * FILTER**2))


Cost = Callable[[Tile, int, NDArray[np.int64], NDArray[np.int64]], NDArray[np.floating]]


def far_apart(side: int, rng: np.random.Generator) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return up to 64 pixels of a sheared grid, at random: over time, any two occur together."""
    column, row = np.mgrid[: side // REACH, : side // REACH].reshape(2, -1)
    shear, top, left = rng.integers(REACH), rng.integers(side), rng.integers(side)
    y, x = (REACH * row + top) % side, (REACH * column + shear * row + left) % side
    if len(y) > 64:
        y, x = np.stack([y, x])[:, rng.permutation(len(y))[:64]]
    return (y, x) if rng.integers(2) else (x, y)


def neighbours(
    tile: Tile, frame: int, y: NDArray[np.int64], x: NDArray[np.int64], width: float
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return the candidates around pixels of a frame, and in the same pixels of other frames.

    Shape (pixels, neighbours), with their weights, above 0.001.
    """
    frames, side, _ = tile.shape
    dy, dx = np.mgrid[1 - REACH : REACH, 1 - REACH : REACH].reshape(2, -1)
    weight = np.exp(-(dy**2 + dx**2) / width**2)
    near = (weight > 1e-3) & (weight < 1)
    around = tile[frame, (y[:, None] + dy[near]) % side, (x[:, None] + dx[near]) % side]
    dt = np.arange(1, frames)
    of_time = np.exp(-(np.minimum(dt, frames - dt) ** 2) / width**2)
    soon = of_time > 1e-3
    later = tile[(frame + dt[soon]) % frames, y[:, None], x[:, None]]
    weights = np.concatenate([weight[near], of_time[soon]]).astype(np.float32)
    return np.concatenate([around, later], axis=1), weights


def arrange(cost: Cost, frames: int, side: int, sweeps: int, rng: np.random.Generator) -> Tile:
    """Return tiles of low energy, each with all candidates once, after some reassignments of each pixel.

    ``cost(tile, frame, y, x)`` is of each pixel with each of their candidates.
    """
    from scipy.optimize import linear_sum_assignment

    tile = np.stack([rng.permutation(side**2).reshape(side, side) for _ in range(frames)])
    together = min(64, (side // REACH) ** 2)
    for step in range(sweeps * tile.size // together):
        frame, (y, x) = step % frames, far_apart(side, rng)
        _, best = linear_sum_assignment(cost(tile, frame, y, x))
        tile[frame, y, x] = tile[frame, y, x][best]
    return tile


def vectors(
    channels: int, side: int, frames: int, sweeps: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return the ranks of a mask of vectors, shape (frames, side, side, channels): in each frame, a net.

    The energy is that of I. Georgiev, M. Fajardo, "Blue-noise dithered sampling", 2016. Distances of
    values are not toroidal: if they were, each channel alone would be far from blue.
    """
    pool = side**2
    index = jnp.arange(pool, dtype=jnp.uint32)
    ranks = np.asarray(sobol(channels).bits(index)).astype(np.int64) * pool >> 32
    values = (ranks / pool).astype(np.float32)

    def cost(tile: Tile, frame: int, y: NDArray, x: NDArray) -> NDArray:
        around, weight = neighbours(tile, frame, y, x, WIDTH)
        here, there = values[tile[frame, y, x]], values[around]
        squares = sum(np.square(there[:, None, :, j] - here[:, None, j]) for j in range(channels))
        return np.exp(-(squares ** (channels / 4))) @ weight

    return ranks[arrange(cost, frames, side, sweeps, rng)]

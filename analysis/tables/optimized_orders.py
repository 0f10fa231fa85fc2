"""Search for the optimised orders: permutations of quadrants, and numbers of the first samples of pixels.

The objective is the mean square of an image's error after a Gaussian filter, in closed form. For random
half-planes as integrands the covariance of the values at two points is, up to constants, minus their
distance: the number of lines through a square that separate two points is proportional to it. Over all nested
uniform scramblings of the Sobol' sequence, the expected distance of two of its points depends only on the
number of leading digits that their coordinates share. That is the number of zeros of the point with the xor
of their indices as index; so the covariance of the means of two aligned blocks is a function of the xor of
their numbers, a short array. No integrand and no scrambling is drawn, so none has an advantage.

Alternatives, as filtered errors relative to white noise by half-planes, and in brackets by the
kernel exp(-4 |a - b|**2) of smooth integrands; the order for 4 samples has 0.522 (0.258). A free permutation
of the pixels, which keeps no blocks together, ends at 0.527 (0.273) if it starts from our order, so the
hierarchy costs nothing that a search showed. Both kernels in the objective: 0.532 (0.257), no gain. For the
first samples of 64, both kernels gain too little compared to orders made for these numbers.
"""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numba  # pyright: ignore[reportMissingImports]
import numpy as np
from numpy.typing import NDArray

from qmcjax import sequences

LOG_SIDE = 6
"""Binary logarithm of the side of the tile."""

LOG_COUNTS = 7
"""There are tables for 1, 2, ..., 2**(LOG_COUNTS - 1) samples."""

FILTER = 1.5
"""Standard deviation in pixels of the Gaussian filter of the objective."""

LEAST = 1e-3
"""Pairs of pixels with less weight are omitted; the weight of a pixel with itself is 1."""

REACH = int(np.sqrt(-4 * np.log(LEAST)) * FILTER)
"""Largest distance along an axis of pixels with more weight."""

AROUND = 4
"""Tiles that share a parent: a pixel at the border of one has neighbours in another."""

SPARSE = 0.25
"""Weight of the first samples if there are 2, 8, 32, ... times as many in all; 1 if it is a power of 4."""

HOT, COLD = 0.6, 0.01
"""First and last temperature, as parts of the variance of the mean of a pixel."""

TRIALS = 1500
"""Exchanges tried per pixel, and equally many other first samples."""


class Pairs(NamedTuple):
    """The neighbours of a pixel, and the weights of its pairs with them."""

    x: NDArray[np.int64]
    y: NDArray[np.int64]
    weight: NDArray[np.float32]


class Covariances(NamedTuple):
    """Of the means of blocks by the xor of their numbers, relative to the variance of a mean."""

    inside: NDArray[np.float32]
    across: NDArray[np.float32]
    """Of blocks of two tiles, averaged over these."""


def filter_pairs() -> Pairs:
    """Return the autocorrelation of the filter, without the pixel itself."""
    y, x = np.mgrid[-REACH : REACH + 1, -REACH : REACH + 1].reshape(2, -1)
    weight = np.exp(-(x**2 + y**2) / (4 * FILTER**2))
    near = (weight > LEAST) & (weight < 1)
    return Pairs(x[near], y[near], weight[near].astype(np.float32))


def differences(digits: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return differences of scrambled coordinates that share 0, 1, ... digits, a row each, and weights.

    With k common digits, coordinates are uniform in the two halves of an interval of length 2**-k: their
    difference has the triangular density on (0, 2**-k). From ``digits`` common ones on it is taken as 0.
    """
    node, weight = np.polynomial.legendre.leggauss(64)
    difference = np.concatenate([(node + 1) / 4, (node + 3) / 4])
    density = np.tile(weight / 4, 2) * (2 - 4 * np.abs(difference - 0.5))
    return np.append(2.0 ** -np.arange(digits), 0)[:, None] * difference, density


def mean_distances(digits: int) -> NDArray[np.float64]:
    """Return the mean distance of two scrambled points, by the numbers of digits that coordinates share."""
    apart, density = differences(digits)
    distance = np.hypot(apart[:, None, :, None], apart[None, :, None, :])
    return np.einsum("ijab,a,b->ij", distance, density, density, optimize=True)


def covariances(log_count: int, log_blocks: int) -> Covariances:
    """Return the covariances of means of ``2**log_count`` points, ``2**log_blocks`` of them in a tile."""
    digits = log_count + log_blocks + AROUND.bit_length() - 1
    indices = np.arange(2**digits, dtype=np.uint32)
    zeros = 32 - np.frexp(np.asarray(sequences.sobol(2).bits(indices)).astype(np.float64))[1]
    zeros = np.minimum(zeros, digits)
    of_points = -mean_distances(digits)[zeros[:, 0], zeros[:, 1]]
    # The xor of the indices of two points of a block and another one takes all values equally often.
    of_blocks = of_points.reshape(AROUND, 2**log_blocks, 2**log_count).mean(axis=2)
    of_blocks -= of_blocks.mean()
    of_blocks /= of_blocks[0, 0]
    return Covariances(of_blocks[0].astype(np.float32), of_blocks[1:].mean(axis=0).astype(np.float32))


@numba.njit(cache=True, fastmath=True)
def change(covariance, pairs, numbers, shift, moved, x, y, flip):
    """Return the change of the energy of the pairs of a pixel if its number is xored.

    Numbers are shifted, to those of blocks. ``moved`` are quadrants of a square that move with the pixel.
    """
    left, top, half, one, other = moved
    side, old, total = numbers.shape[0], numbers[y, x], np.float32(0)
    for k in range(pairs.weight.size):
        column, row = x + pairs.x[k], y + pairs.y[k]
        i, j = column & (side - 1), row & (side - 1)
        if left <= i < left + 2 * half and top <= j < top + 2 * half:
            quadrant = (i - left) // half + 2 * ((j - top) // half)
            if quadrant == one or quadrant == other:
                continue
        table = covariance.inside if i == column and j == row else covariance.across
        apart = old ^ numbers[j, i]
        total += pairs.weight[k] * (table[(apart ^ flip) >> shift] - table[apart >> shift])
    return 2 * total


@numba.njit(cache=True, fastmath=True)
def energy(covariance, pairs, numbers, shift):
    """Return the mean square of the filtered error, relative to that of white noise."""
    side, total = numbers.shape[0], 0.0
    for y in range(side):
        for x in range(side):
            for k in range(pairs.weight.size):
                column, row = x + pairs.x[k], y + pairs.y[k]
                i, j = column & (side - 1), row & (side - 1)
                table = covariance.inside if i == column and j == row else covariance.across
                total += pairs.weight[k] * table[(numbers[y, x] ^ numbers[j, i]) >> shift]
    return 1 + total / side**2


@numba.njit(cache=True, fastmath=True)
def anneal_order(covariance, pairs, numbers, trials, hot, cold, seed):
    """Exchange quadrants, down to single pixels, in place."""
    np.random.seed(seed)
    side = numbers.shape[0]
    for trial in range(trials):
        temperature = hot * (cold / hot) ** (trial / trials)
        half = 1
        while 4 * half <= side and np.random.random() < 0.12:
            half *= 2
        left = np.random.randint(side // (2 * half)) * 2 * half
        top = np.random.randint(side // (2 * half)) * 2 * half
        one = np.random.randint(4)
        other = one ^ (1 + np.random.randint(3))
        moved = (left, top, half, one, other)
        # Both exchange their digits: the xor of numbers in either one, or both, stays the same.
        flip = numbers[top + (one >> 1) * half, left + (one & 1) * half]
        flip = (flip ^ numbers[top + (other >> 1) * half, left + (other & 1) * half]) & (3 * half * half)
        delta = np.float32(0)
        for q in (one, other):
            for y in range(top + (q >> 1) * half, top + (q >> 1) * half + half):
                for x in range(left + (q & 1) * half, left + (q & 1) * half + half):
                    delta += change(covariance, pairs, numbers, 0, moved, x, y, flip)
        if delta <= 0 or np.random.random() < np.exp(-delta / temperature):
            for q in (one, other):
                for y in range(top + (q >> 1) * half, top + (q >> 1) * half + half):
                    for x in range(left + (q & 1) * half, left + (q & 1) * half + half):
                        numbers[y, x] ^= flip


@numba.njit(cache=True, fastmath=True)
def anneal_ranks(tables, weights, pairs, numbers, trials, hot, cold, seed):
    """Change the last digits of numbers, in place: table k is of blocks of ``2**k`` samples."""
    np.random.seed(seed)
    side, moved = numbers.shape[0], (0, 0, 0, 0, 0)
    for trial in range(trials):
        temperature = hot * (cold / hot) ** (trial / trials)
        x, y = np.random.randint(side), np.random.randint(side)
        flip = 1 + np.random.randint((1 << len(tables)) - 1)
        delta = np.float32(0)
        for shift in range(len(tables)):
            if flip >> shift:
                of_blocks = change(tables[shift], pairs, numbers, shift, moved, x, y, flip)
                delta += weights[shift] * of_blocks
        if delta <= 0 or np.random.random() < np.exp(-delta / temperature):
            numbers[y, x] ^= flip


def random_order(log_side: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return the positions of a tile whose quadrants are in random orders."""
    numbers = np.zeros((1, 1), np.int64)
    for _ in range(log_side):
        digits = rng.permuted(np.tile(np.arange(4), (*numbers.shape, 1)), axis=2)
        numbers = np.block([[[numbers[..., None] * 4 + digits]]])
        side = numbers.shape[0]
        numbers = numbers.reshape(side, side, 2, 2).swapaxes(1, 2).reshape(2 * side, 2 * side)
    return numbers


def pack(positions: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return the permutations of all squares, from the tile down: 2 bits for the digit of each quadrant."""
    half, found = positions.shape[0] // 2, []
    while half:
        digits = positions[::half, ::half] // half**2 & 3
        quadrants = [digits[q >> 1 :: 2, q & 1 :: 2] << 2 * q for q in range(4)]
        found.append(np.bitwise_or.reduce(quadrants).ravel())
        half //= 2
    return np.concatenate(found).astype(np.uint8)


@cache
def search(log_count: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Return the positions of the pixels of a tile, and the numbers of their first samples."""
    pairs, trials = filter_pairs(), TRIALS * 4**LOG_SIDE
    positions = random_order(LOG_SIDE, np.random.default_rng(log_count))
    anneal_order(covariances(log_count, 2 * LOG_SIDE), pairs, positions, trials, HOT, COLD, log_count)
    numbers = positions << log_count
    if log_count:
        tables = tuple(covariances(k, 2 * LOG_SIDE + log_count - k) for k in range(log_count))
        weights = np.array([SPARSE if (log_count - k) % 2 else 1 for k in range(log_count)], np.float32)
        anneal_ranks(tables, weights, pairs, numbers, trials, HOT, COLD, log_count)
    return positions, (numbers & (2**log_count - 1)).astype(np.uint8)


def orders() -> Iterator[dict[str, NDArray]]:
    """Yield the permutations of quadrants for each number of samples."""
    yield {"permutations": np.stack([pack(search(k)[0]) for k in range(LOG_COUNTS)])}


def ranks() -> Iterator[dict[str, NDArray]]:
    """Yield the numbers of the first samples of pixels for each number of samples."""
    yield {"ranks": np.stack([search(k)[1] for k in range(LOG_COUNTS)])}

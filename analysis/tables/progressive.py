"""Make the tables of the progressive sampler: matrices of pixels and samples, and orders of the pixels.

A point belongs to a function over F_2: its coordinates are the coefficients of the function's expansions at
as many rational places. Another rational place, P, and a place Q of degree 2 or 4 are for samples and pixels.
Sample s adds the functions with poles at P, of increasing order, that the digits of s select; a pixel adds
functions with poles at Q, of an order that increases with the level of the square in the image. Then the
samples of an aligned block of ``2**k``, in the pixels of an aligned square, belong to all functions with
bounded poles at both, and a constant one: these points are a net, for each k and each such square.

In two dimensions the functions are rational in t, the coordinates are at t = 0 and 1, P is at infinity, and Q
is the zero of 1 + t + t**2, of degree 2: squares of ``2**i`` pixels per side add ``2 i`` functions. Functions
of a divisor of degree k + 2 i - 1 have no more zeros than that: t = 0. The samples are the Sobol' sequence.

In four dimensions they are those of the elliptic curve y**2 + y = x**3 + x. It has five rational places, four
of them at x = 0 and 1, but none of degree 2. Q is the zero of 1 + x + x**2, of degree 4: it remains prime,
since y**2 + y = 1 + x has no solution over F_4. With k > 1 and squares of ``4**i`` pixels per side, the
functions are all those of a divisor of degree k + 4 i: t = 1 by the theorem of Riemann and Roch. Which two of
the four functions of a level go to squares of 2 x 2 pixels is free: a short search tries all 35 planes.

The quadrants of each square may be permuted: all 24 permutations are affine over F_2, so the nets remain.
As in optimized_orders, the mean square of the filtered error over half-spaces and nested scramblings is
a sum over pairs of pixels of a table of the xor of their positions. Each number of samples has its own table,
relative to the variance of a pixel, but all have the same positions. So the mean over 1, 2, ..., 4096 samples
is the same search, with the mean of all tables.

Other choices besides the order, in two dimensions: the nets of a pixel are sets of functions g + V, with V
spanned by 1, t, ..., t**k. The functions t**i (1 + t)**(k - i) are a basis of V, and two points that differ
by one of them share an interval of volume 2**-k. They are in different halves if both halves are nets. So
there is only one way to split a net, and a pixel can only choose which half is first: a word for each pixel
to xor to the numbers of its samples. Searches for such words gained at most 0.8 % for one number of samples
without regard to others, or made all others worse; both kernels in the objective changed errors by -1 to 2 %
up to 128 samples. The cost is due to serving all 13 numbers: our order has 0.523, 0.579, 0.584 and 0.602 at
1, 4, 16 and 64 samples, orders for only one of these numbers 0.476, 0.531, 0.537 and 0.539.
"""

from collections.abc import Iterator
from itertools import combinations, islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.tables.function_fields import ONE, ZERO, Series, fields, power
from analysis.tables.optimized_orders import (
    AROUND,
    COLD,
    HOT,
    LOG_SIDE,
    Covariances,
    anneal_order,
    differences,
    energy,
    filter_pairs,
    random_order,
)

WORD = 32

LOG_COUNTS = 13
"""The search is for 1, 2, ..., 2**(LOG_COUNTS - 1) samples."""

TRIALS = 1500
"""Exchanges that are tried per pixel."""

SHORT_TRIALS, SHORT_COUNTS = 15, (0, 2, 4, 6)
"""Exchanges, and binary logarithms of numbers of samples, in the short searches."""

DIGITS = {2: 16, 4: 12}
"""Points with this number of common digits in a coordinate are considered equal in it."""

SEED = 1


class Matrices(NamedTuple):
    """Of samples and pixels: uint32 (dims, 32), a column as a word, its first row in bit 31."""

    samples: NDArray[np.uint32]
    pixels: NDArray[np.uint32]


def places(dims: int) -> Iterator[tuple[Series, Series]]:
    """Yield the expansions of x and y, of which y is 0 in two dimensions, at all places of coordinates."""
    rational, elliptic = islice(fields(), 2)
    for x, *basis in (rational if dims == 2 else elliptic).places:
        if x.order >= 0:
            yield x, ZERO if dims == 2 else basis[1]


def words(functions: list[Series]) -> NDArray[np.uint32]:
    """Return series as columns: the first coefficient in bit 31."""
    return np.array([function.coefficients(0, WORD) for function in functions], np.uint32)


def matrices(dims: int, level: tuple[int, ...]) -> Matrices:
    """Return the matrices, for a basis of the functions of a level.

    ``level``: those whose digits are last in a position come first; bits select 1, x, y and x y.
    """
    samples, pixels = [], []
    for x, y in places(dims):
        powers = [power(x, k) for k in range(WORD)]
        # The pole of x has order 2, that of y order 3: each order but 1 occurs.
        of_order = [powers[0], *(f for one in powers[:-1] for f in (one * x, one * y))]
        samples.append(words((powers if dims == 2 else of_order)[:WORD]))
        basis = (ONE, x, y, x * y)
        chosen = [sum((f for k, f in enumerate(basis) if bits >> k & 1), ZERO) for bits in level]
        divisor = (ONE + x + x * x).inverse()
        columns = [power(divisor, k + 1) * function for k in range(WORD // len(level)) for function in chosen]
        pixels.append(words(columns))
    return Matrices(np.array(samples), np.array(pixels))


def mean_distances(dims: int) -> NDArray[np.float64]:
    """Return the mean distance of two scrambled points, by the numbers of digits that coordinates share.

    A distance d is the integral of (1 - exp(-v d**2)) v**(-3/2) dv / (2 sqrt(pi)); the mean of the
    exponential is a product over coordinates, whose differences optimized_orders describes.
    """
    apart, density = differences(DIGITS[dims])
    logarithm = np.linspace(-14, 30, 440)
    single = np.exp(-np.exp(logarithm)[:, None, None] * apart[:-1] ** 2) @ density
    single = np.column_stack([single, np.ones(len(logarithm))])
    together = single
    for _ in range(dims - 1):
        together = together[..., None] * single.reshape(len(single), *(1,) * (together.ndim - 1), -1)
    step = (logarithm[1] - logarithm[0]) * np.exp(-logarithm / 2) / (2 * np.sqrt(np.pi))
    return np.asarray(np.tensordot(step, 1 - together, 1), np.float64)


def products(columns: NDArray[np.uint32], indices: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the xors of the columns that the bits of the indices select."""
    found = np.zeros_like(indices)
    for k, column in enumerate(columns):
        found ^= np.where(indices >> np.uint32(k) & np.uint32(1), column, np.uint32(0))
    return found


def covariances(made: Matrices, log_count: int, log_pixels: int) -> Covariances:
    """Return those of the means of ``2**log_count`` samples, by the xor of the positions of pixels."""
    dims = len(made.samples)
    distances, cap = mean_distances(dims), DIGITS[dims]
    position = np.arange(AROUND << log_pixels, dtype=np.uint32)
    sample = np.arange(1 << log_count, dtype=np.uint32)
    means = np.zeros(len(position))
    for part in np.array_split(np.arange(len(position)), max(1, len(position) * len(sample) >> 20)):
        common = []
        for of_samples, of_pixels in zip(*made, strict=True):
            apart = products(of_pixels, position[part])[:, None] ^ products(of_samples, sample)
            common.append(np.minimum(WORD - np.frexp(apart.astype(np.float64))[1], cap))
        means[part] = -distances[tuple(common)].mean(axis=1)
    means = means.reshape(AROUND, -1) - means.mean()
    means /= means[0, 0]
    return Covariances(means[0].astype(np.float32), means[1:].mean(axis=0).astype(np.float32))


class Found(NamedTuple):
    """An order, and filtered errors relative to white noise of the same variance for each number."""

    positions: NDArray[np.int64]
    errors: NDArray[np.float64]


def search(made: Matrices, log_counts: tuple[int, ...], trials: int) -> Found:
    """Search an order of the pixels of a tile for all these numbers of samples together."""
    pairs, tables = filter_pairs(), [covariances(made, k, 2 * LOG_SIDE) for k in log_counts]
    mean = Covariances(*(np.mean([table[k] for table in tables], axis=0) for k in (0, 1)))
    positions = random_order(LOG_SIDE, np.random.default_rng(SEED))
    anneal_order(mean, pairs, positions, trials * 4**LOG_SIDE, HOT, COLD, SEED)
    return Found(positions, np.sqrt([energy(table, pairs, positions, 0) for table in tables]))


def planes() -> Iterator[tuple[int, ...]]:
    """Yield bases of the functions of a level, whose first two members span each plane once."""
    for one, other in combinations(range(1, 16), 2):
        if one ^ other > other:
            basis, span = [one, other], {0, one, other, one ^ other}
            for function in (1, 2, 4, 8):
                if function not in span:
                    basis.append(function)
                    span |= {function ^ known for known in span}
            yield tuple(basis)


def best_plane() -> tuple[int, ...]:
    """Return the basis of a level, in four dimensions, whose short search ends best."""

    def mean(basis: tuple[int, ...]) -> float:
        return float(search(matrices(4, basis), SHORT_COUNTS, SHORT_TRIALS).errors.mean())

    return min(planes(), key=mean)


def table() -> Iterator[dict[str, NDArray]]:
    """Yield positions and matrices of two and four dimensions."""
    for dims, basis in ((2, (1, 2)), (4, best_plane())):
        made = matrices(dims, basis)
        found = search(made, tuple(range(LOG_COUNTS)), TRIALS)
        yield {
            f"positions_{dims}": found.positions.astype(np.uint16),
            f"samples_{dims}": made.samples,
            f"pixels_{dims}": made.pixels,
        }

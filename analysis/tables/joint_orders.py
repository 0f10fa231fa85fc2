"""Search for orders of all coordinates together: a linear map over F2 from the bits of a pixel to an index.

As in ``optimized_orders``, the objective is the mean squared error of an image after a Gaussian filter, in
closed form over all nested uniform scramblings. So the covariance of two blocks is a function of the xor of
their numbers. The number of a pixel's block is a linear function of the bits of its coordinates. Then the xor
of the numbers of two pixels is a linear function of the xor of their coordinates: all pixels have the same
neighbourhood up to the carries of an addition, the objective is a sum over few such xors, and the order is a
word for each bit of x and y.

Bits of a level of the quadtree go only to digits of the same and finer levels: every aligned square keeps one
contiguous aligned block of indices, and with it the net of the sequence. Changing the last digits, those of
samples in a pixel, does not change the blocks; these are searched for the first samples of the pixels.

The kernels of the covariance are those of random half spaces, minus the distance of the points [1]_, and of
smooth random integrands, exp(-4 |a - b|**2), with equal weights, relative to the errors along the Hilbert
curve. Kernels are sums of products over the coordinates: the distance is a mixture of Gaussians.

Limits, for one sample in four coordinates on a tile of 64 x 64 pixels, as filtered errors relative to those
along the Hilbert curve: 0.833 for these maps; 0.812 for linear maps without blocks in squares, but their
errors after a Gaussian of 6 pixels are larger, by 41 % for half spaces. Annealing that exchanges any two
pixels ends at 0.831 and 0.812 when started from these; permutations of quadrants, searched as in
``optimized_orders``, at 0.896. A permutation optimised for one key of the scrambling has 0.777 for that key,
where these maps have 0.823, but 0.93 and 0.96 after two random digital shifts of its points.

References
----------
.. [1] I. J. Schoenberg, "Metric spaces and completely monotone functions", 1938: the mixture.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numba  # pyright: ignore[reportMissingImports]
import numpy as np
from numpy.typing import NDArray

from analysis.tables.optimized_orders import FILTER, LEAST, REACH, differences
from qmcjax import orders, sequences

LOG_SIDE = 8
"""Levels of the quadtree whose permutations are searched."""

LOG_COUNTS = 7
"""There are tables for 1, 2, ..., 2**(LOG_COUNTS - 1) samples."""

SEQUENCES = {4: sequences.niederreiter_xing, 8: sequences.sobol}
"""By the number of coordinates."""

STARTS = 4
"""Number of searches, of which the best is kept."""

TRIALS = 100_000
"""Number of changes tried in each search."""

RANK_TRIALS = 20_000

HOT, COLD = 0.1, 1e-4
"""First and last temperature: the mean square of errors along the Hilbert curve is 1."""

RATES = np.exp(np.arange(-9.2, 16.2, 0.7))
"""Of the Gaussians whose mixture is minus the distance, a trapezoidal rule in their logarithm."""


class Kernel(NamedTuple):
    """A sum of products: ``weights @ prod_j factors[:, digits that the points share in coordinate j]``."""

    weights: NDArray[np.float64]
    factors: NDArray[np.float64]


def kernels(digits: int) -> tuple[Kernel, Kernel]:
    """Return the mean kernels of half spaces and smooth integrands, by common leading digits up to some."""
    apart, density = differences(digits)

    def gaussians(rates: NDArray) -> NDArray:
        return np.exp(-rates[:, None, None] * apart**2) @ density

    return Kernel(RATES**-0.5, gaussians(RATES)), Kernel(np.ones(1), gaussians(np.array([4.0])))


@numba.njit(cache=True)
def _of_indices(columns, weights, factors, count):
    """Return the kernel of two points by the xor of their indices."""
    dims, found = columns.shape[0], np.empty(count)
    last = factors.shape[1] - 1
    for i in range(count):
        product = weights.copy()
        for j in range(dims):
            word, k, rest = np.uint32(0), 0, i
            while rest:
                if rest & 1:
                    word ^= columns[j, k]
                rest >>= 1
                k += 1
            zeros = 0
            while zeros < last and not (word >> np.uint32(31 - zeros)) & np.uint32(1):
                zeros += 1
            product *= factors[:, zeros]
        found[i] = product.sum()
    return found


def covariances(columns: NDArray[np.uint32], log_count: int) -> list[NDArray[np.float64]]:
    """Return the covariances of points by the xor of their indices, for each kernel.

    The variance of the mean of as many independent points is 1.
    """
    digits = 2 * LOG_SIDE + log_count
    found = []
    for weights, factors in kernels(min(digits, 24)):
        of_points = _of_indices(columns, weights, factors, 2**digits)
        dims, last = len(columns), factors.shape[1] - 1
        often = 2.0 ** -np.minimum(np.arange(last + 1) + 1, last)
        mean, most = weights @ (factors @ often) ** dims, weights @ factors[:, -1] ** dims
        found.append((of_points - mean) / (most - mean) * 2**log_count)
    return found


def of_blocks(of_points: NDArray[np.float64], log_count: int, log_first: int) -> NDArray[np.float64]:
    """Return the covariances of means of the first ``2**log_first`` of ``2**log_count`` points."""
    return of_points.reshape(-1, 2**log_first).mean(axis=1) * 2.0 ** (log_first - log_count)


class Xors(NamedTuple):
    """Xors of the coordinates of pixels, as Morton codes, and weights of the pairs that have them."""

    codes: NDArray[np.int64]
    weights: NDArray[np.float64]


def filter_xors() -> Xors:
    """Return the autocorrelation of the filter by the xor of the coordinates; that of a pixel itself is 1."""
    side = 2**LOG_SIDE
    x = np.arange(side)
    along = np.zeros(side)
    for apart in range(-REACH, REACH + 1):
        often = np.bincount(x ^ (x + apart) % side, minlength=side) / side
        along += np.exp(-(apart**2) / (4 * FILTER**2)) * often
    weights = np.outer(along, along)
    row, column = np.nonzero(weights > LEAST**2)
    codes = np.zeros_like(row)
    for k in range(LOG_SIDE):
        codes |= (column >> k & 1) << 2 * k | (row >> k & 1) << 2 * k + 1
    return Xors(codes, weights[row, column])


@numba.njit(cache=True)
def product(columns, number):
    """Return the xor of the columns that the bits of a number select."""
    found, k = 0, 0
    while number:
        if number & 1:
            found ^= columns[k]
        number >>= 1
        k += 1
    return found


@numba.njit(cache=True)
def _energy(table, shift, words, codes, weights):
    """Return the mean square of the filtered error."""
    total = 0.0
    for k in range(codes.size):
        total += weights[k] * table[product(words, codes[k]) >> shift]
    return total


@numba.njit(cache=True)
def change_words(words):
    """Add one word to another of the same or a finer level, or exchange two of a level, or return None."""
    one, other = np.random.randint(words.size), np.random.randint(words.size)
    if one == other or other // 2 > one // 2:
        return words[:0]
    tried = words.copy()
    tried[one] ^= words[other]
    if one // 2 == other // 2 and np.random.random() < 0.3:
        tried[one], tried[other] = words[other], words[one]
    return tried


@numba.njit(cache=True)
def _anneal(table, codes, weights, words, trials, hot, cold, seed):
    """Return the least energy and its words."""
    np.random.seed(seed)
    energy = _energy(table, 0, words, codes, weights)
    least, best = energy, words.copy()
    for trial in range(trials):
        temperature = hot * (cold / hot) ** (trial / trials)
        tried = change_words(words)
        if not tried.size:
            continue
        found = _energy(table, 0, tried, codes, weights)
        if found <= energy or np.random.random() < np.exp((energy - found) / temperature):
            words, energy = tried, found
            if energy < least:
                least, best = energy, words.copy()
    return least, best


@numba.njit(cache=True)
def _anneal_ranks(tables, codes, weights, words, trials, hot, cold, seed):
    """Change the last digits of the words: table k is of blocks of ``2**k`` samples, lower by 1 each."""
    np.random.seed(seed)
    energies = np.array([_energy(tables[k], k, words, codes, weights) for k in range(len(tables))])
    for trial in range(trials):
        temperature = hot * (cold / hot) ** (trial / trials)
        tried = words.copy()
        flip = 1 + np.random.randint((1 << len(tables)) - 1)
        tried[np.random.randint(words.size)] ^= flip
        found = energies.copy()
        for k in range(len(tables)):
            if flip >> k:
                found[k] = _energy(tables[k], k, tried, codes, weights)
        change = found.sum() - energies.sum()
        if change <= 0 or np.random.random() < np.exp(-change / temperature):
            words, energies = tried, found
    return words


def hilbert_energy(of_pixels: NDArray[np.float64]) -> float:
    """Return the mean square of the filtered error along the Hilbert curve."""
    side = 2**LOG_SIDE
    y, x = np.mgrid[:side, :side].astype(np.uint32)
    position = np.asarray(orders.hilbert(side, side).position(x, y))
    total = 0.0
    for down in range(-REACH, REACH + 1):
        for right in range(-REACH, REACH + 1):
            apart = position ^ np.roll(position, (down, right), (0, 1))
            weight = np.exp(-(down**2 + right**2) / (4 * FILTER**2))
            total += weight * of_pixels[apart].mean()
    return total


def relative(columns: NDArray[np.uint32], log_count: int) -> list[NDArray[np.float64]]:
    """Return mean covariances of both kernels, over the errors along the Hilbert curve.

    Entry k is of the means of the first ``2**k`` samples.
    """
    of_points = covariances(columns, log_count)
    tables = []
    for log_first in range(log_count + 1):
        blocks = [of_blocks(one, log_count, log_first) for one in of_points]
        along = [hilbert_energy(one) for one in blocks]
        tables.append(np.mean([one / of for one, of in zip(blocks, along, strict=True)], axis=0))
    return tables


def rank_samples(
    words: NDArray[np.int64], of_first: list[NDArray[np.float64]], xors: Xors, log_count: int
) -> NDArray[np.int64]:
    """Search the last digits of the words, which choose the first samples of the pixels."""
    if log_count:
        words = _anneal_ranks(tuple(of_first), *xors, words, RANK_TRIALS, HOT, COLD, log_count)
    return words


def search(dims: int, log_count: int) -> NDArray[np.int64]:
    """Return the word of each bit of a Morton code: an index whose lowest digits are those of a sample."""
    xors = filter_xors()
    *of_first, of_pixels = relative(np.asarray(SEQUENCES[dims](dims).matrices), log_count)
    start = 2 ** np.arange(2 * LOG_SIDE)
    found = [_anneal(of_pixels, *xors, start, TRIALS, HOT, COLD, seed) for seed in range(STARTS)]
    _, words = min(found, key=lambda one: one[0])
    return rank_samples(words << log_count, of_first, xors, log_count)


HEAD = """\
# Dimensions, binary logarithm of the number of samples, and the indices of bits 0 of x, 0 of y, 1 of x, ...
# Made by python -m analysis.tables optimized_joint.txt
"""


def table() -> Iterator[str]:
    """Yield the words, by numbers of dimensions and of samples."""
    yield HEAD
    for dims in SEQUENCES:
        for log_count in range(LOG_COUNTS):
            words = search(dims, log_count)
            yield " ".join([str(dims), str(log_count), *(f"{word:x}" for word in words)]) + "\n"

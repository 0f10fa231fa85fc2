"""Search for orders of pixels and words of frames together, for animations in four coordinates.

In an animation, point i of frame t is point i of the Sobol' sequence xor a word of t, as in
:func:`qmcjax.sequences.in_time`: the triangle L of binomial coefficients times a point of another digital
sequence with upper triangular regular matrices T_j. For any such T_j, each coordinate is stratified in every
aligned window of pixels and frames. Up to scramblings, no other matrices have this property: with k columns,
all windows of k rows must be regular, so k bits determine each column, row after row, which gives L times an
upper triangular matrix.

The index of a pixel's block is a linear map of the bits of its coordinates, as in ``joint_orders``. So
the covariance of two samples in space and time depends only on the xor of their coordinates and frames. The
mean squares of errors after several filters in space and time are sums over few such xors. Annealing finds
the words of the bits of x and y, and the first columns of T_j, for the smallest geometric mean.

The filters are those of figure ``designed-samplers``: a Gaussian of 1.5 pixels for one frame, with a moving
average of 0.1, and with a Gaussian of 1.5 frames; only the moving average; only blocks of eight frames.
"""

from collections.abc import Callable, Iterator

import jax.numpy as jnp
import numba  # pyright: ignore[reportMissingImports]
import numpy as np
from numpy.typing import NDArray

from analysis.tables.joint_orders import (
    LOG_SIDE,
    Xors,
    change_words,
    filter_xors,
    kernels,
    product,
    rank_samples,
    relative,
)
from analysis.tables.optimized_orders import FILTER
from qmcjax import sequences
from qmcjax.core.bits import pascal

DIMS = 4
LOG_COUNTS = 3
"""There are tables for 1, 2, and 4 samples; larger numbers use the last one."""

LOG_FRAMES = 5
"""Columns of T_j that are searched."""

TIMES = (2, 0, 1, 3)
"""Coordinates of the Sobol' sequence with the first words, and the further columns of T_j."""

DIGITS = 12
"""Digits of points that count."""

LEAST = 3e-3
"""Xors of pixels with less weight are omitted."""

STARTS, TRIALS = 3, 20_000
HOT, COLD = 0.01, 2e-4
"""First and last temperature, of the logarithm of the mean square."""

TIME_MOVES = 0.3
"""Fraction of changes that concern frames."""

IN_TIME, ALL = np.array([0, 0, 0, 1, 1]) / 2, np.array([1, 1, 1, 8, 2]) / 13
"""Weights of the filters: frames are searched for those in time alone, then together with the pixels for all.

The best and the worst frames for the moving average alone differ by 5 %, so that it counts for more.
"""

MOVING_AVERAGE, BLOCK = 0.1, 8


def covariances() -> NDArray[np.float32]:
    """Return the mean covariance of both kernels, by common leading digits of each coordinate."""
    found = 0.0
    for weights, factors in kernels(DIGITS):
        pairs = np.einsum("ra,rb->rab", factors, factors).reshape(len(weights), -1)
        of_points = (weights * pairs.T) @ pairs
        often = 2.0 ** -np.minimum(np.arange(DIGITS + 1) + 1, DIGITS)
        mean, most = weights @ (factors @ often) ** DIMS, weights @ factors[:, -1] ** DIMS
        found = found + (of_points.ravel() - mean) / (most - mean) / 2
    return np.asarray(found, np.float32)


def frame_weights() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return weights of xors of frames: of filters after the one in space, and of those in time alone."""
    frames = 2**LOG_FRAMES
    t = np.arange(frames)

    def of_xors(autocorrelation: Callable[[NDArray], NDArray], reach: int) -> NDArray[np.float64]:
        found = np.zeros(frames)
        for lag in range(-reach, reach + 1):
            often = np.bincount(t ^ (t + lag) % frames, minlength=frames) / frames
            found += autocorrelation(np.array(lag)) * often
        return found / found[0]

    average = of_xors(lambda lag: (1 - MOVING_AVERAGE) ** np.abs(lag), 150)
    gauss = of_xors(lambda lag: np.exp(-(lag**2) / (4 * FILTER**2)), 12)
    return np.stack([t == 0, average, gauss]).astype(float), np.stack([average, t < BLOCK]).astype(float)


@numba.njit(cache=True)
def _products(columns, numbers):
    """Return the products of all columns of all coordinates, a row each, with the numbers of theirs."""
    found = np.empty(numbers.shape, np.int64)
    for j in range(len(columns)):
        for k in range(numbers.shape[1]):
            found[j, k] = product(columns[j], numbers[j, k])
    return found


@numba.njit(cache=True, fastmath=True)
def _energies(table, zeros, of_pixels, of_frames, of_samples, xors, filters):
    """Return mean squares of errors after the filters; those of white noise are 1."""
    codes, weights = xors
    with_space, alone = filters
    frames, samples = with_space.shape[1], 1 << of_samples.shape[1]
    words = _products(of_frames, np.broadcast_to(np.arange(frames), (4, frames)))
    within = _products(of_samples, np.broadcast_to(np.arange(samples), (4, samples)))
    side = zeros.max() + 1
    filtered, plain = np.zeros(frames), np.zeros(frames)
    for k in range(codes.size):
        point = np.array([product(of_pixels[j], codes[k]) for j in range(4)])
        for s in range(samples):
            a, b = point[0] ^ within[0, s], point[1] ^ within[1, s]
            c, d = point[2] ^ within[2, s], point[3] ^ within[3, s]
            for t in range(frames):
                place = zeros[a ^ words[0, t]] * side + zeros[b ^ words[1, t]]
                value = table[(place * side + zeros[c ^ words[2, t]]) * side + zeros[d ^ words[3, t]]]
                filtered[t] += weights[k] * value
                if codes[k] == 0:
                    plain[t] += value
    return np.append(with_space @ filtered, alone @ plain)


@numba.njit(cache=True)
def _anneal(table, zeros, pixels, words, times, triangle, samples, xors, filters, shares, trials, seed):
    """Change digits of times above the diagonal, and words of pixels as in ``joint_orders``."""
    np.random.seed(seed)
    energy = least = np.inf
    best_words, best_times = words, times
    for trial in range(trials):
        tried_words, tried_times = words, times.copy()
        if len(xors.codes) == 1 or np.random.random() < TIME_MOVES:
            for _ in range(1 + np.random.randint(2)):
                k = 1 + np.random.randint(times.shape[1] - 1)
                tried_times[np.random.randint(4), k] ^= 1 << (DIGITS - 1 - np.random.randint(k))
        else:
            tried_words = change_words(words)
            if not tried_words.size:
                continue
        of_pixels = _products(pixels, np.broadcast_to(tried_words, (4, words.size)))
        of_frames = _products(triangle, tried_times)
        found = _energies(table, zeros, of_pixels, of_frames, samples, xors, filters)
        mean = (shares * np.log(found)).sum()
        temperature = HOT * (COLD / HOT) ** (trial / trials)
        if mean <= energy or np.random.random() < np.exp((energy - mean) / temperature):
            words, times, energy = tried_words, tried_times, mean
            if mean < least:
                least, best_words, best_times = mean, words, times
    return best_words, best_times


def _leading(columns: NDArray[np.uint32]) -> NDArray[np.int64]:
    return (columns >> np.uint32(32 - DIGITS)).astype(np.int64)


def search(log_count: int) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Return the words of bits of pixels as ``joint_orders`` does, and columns of times, uint32."""
    columns = np.asarray(sequences.sobol(DIMS).matrices)
    unit = np.uint32(1) << np.arange(31, 31 - DIGITS, -1, dtype=np.uint32)
    # Its lowest bit is the last digit.
    triangle = np.tile(_leading(np.asarray(pascal(jnp.asarray(unit))))[::-1], (DIMS, 1))
    zeros = np.array([DIGITS - int(word).bit_length() for word in range(2**DIGITS)])
    first = _leading(columns[np.array(TIMES), :LOG_FRAMES])
    every, filters = filter_xors(), frame_weights()
    kept = every.weights > LEAST
    near = Xors(every.codes[kept], every.weights[kept])
    pixels = _leading(columns[:, log_count : log_count + 2 * LOG_SIDE])
    samples = _leading(columns[:, :log_count])
    table, start = covariances(), 2 ** np.arange(2 * LOG_SIDE)
    alone = Xors(np.zeros(1, np.int64), np.ones(1))
    found = []
    for seed in range(STARTS):
        words, times = start, first
        for xors, shares, trials in ((alone, IN_TIME, TRIALS), (near, ALL, TRIALS)):
            words, times = _anneal(
                table, zeros, pixels, words, times, triangle, samples, xors, filters, shares, trials, seed
            )
        of_pixels = _products(pixels, np.broadcast_to(words, (DIMS, words.size)))
        energies = _energies(table, zeros, of_pixels, _products(triangle, times), samples, near, filters)
        found.append((ALL @ np.log(energies), words, times))
    _, words, times = min(found, key=lambda one: one[0])
    *of_first, _ = relative(columns, log_count)
    of_times = times.astype(np.uint32) << np.uint32(32 - DIGITS)
    return rank_samples(words << log_count, of_first, every, log_count), of_times


HEAD = """\
# Binary logarithm of the number of samples, the indices of bits 0 of x, 0 of y, 1 of x, ..., and the columns
# of the matrices of frames, one coordinate after the other
# Made by python -m analysis.tables optimized_moving.txt
"""


def table() -> Iterator[str]:
    """Yield the words, by number of samples."""
    yield HEAD
    for log_count in range(LOG_COUNTS):
        words, times = search(log_count)
        yield " ".join([str(log_count), *(f"{word:x}" for word in [*words, *times.ravel()])]) + "\n"

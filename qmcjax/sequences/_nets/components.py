"""Generating vectors of lattices, component by component.

For n a prime or a power of two, a component only matters up to its sign, and all k with the same divisor of n
are multiples of the powers of one generator, up to signs. So the sums over k for all candidates are cyclic
correlations, which take O(n log n) by the fast Fourier transform [1]_.

.. [1] D. Nuyens, R. Cools, "Fast algorithms for component-by-component construction of rank-1 lattice rules
   in shift-invariant reproducing kernel Hilbert spaces", Math. Comp. 75, 2006.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.number_theory import is_prime
from qmcjax.core.parameters import known
from qmcjax.sequences._nets.rank1_lattice import BinaryRank1Lattice, Rank1Lattice, rank1_of

_LIMIT = 2**22
"""Of points, for memory."""

_DIMS = 2**12

_LARGEST = 1e100
"""Of products, whose squares are added."""

_SEARCHED, _SEARCHED_DIMS = 2**13, 32
"""The search of all Korobov lattices takes a second in 10 dimensions."""


def korobov(n: int, dims: int, a: int | None = None) -> Rank1Lattice | BinaryRank1Lattice:
    """Make the Korobov lattice, the rank-1 lattice of the vector (1, a, a**2, ...).

    Parameters
    ----------
    n : int, number of points, in [1, 2**32]
    dims : int, in [1, 65536]
    a : int, in [0, n), optional
        By default the smallest one with the least error in the space of :func:`cbc_lattice`, with weights
        1 / j**2, of all for n at most 2**13 and 32 dimensions.

    Returns
    -------
    Sequence
        The points ``i (1, a, a**2, ...) / n`` modulo 1, with exact ``bits`` if n is a power of two, else
        rounded once, but never to 1.

    References
    ----------
    .. [1] S. Dammertz, A. Keller, "Image Synthesis by Rank-1 Lattices", Monte Carlo and
       Quasi-Monte Carlo Methods 2006, Springer, 2007.

    Examples
    --------
    >>> print(korobov(5, dims=3, a=2).points(3))
    [[0.  0.  0. ]
     [0.2 0.4 0.8]
     [0.4 0.8 0.6]]
    """
    n = checks.integer("n", n, 1, 2**32)
    dims = checks.integer("dims", dims, 1, 2**16)
    a = _best_multiplier(n, dims) if a is None else checks.integer("a", a, 0, n - 1)
    return rank1_of(n, tuple(pow(a, j, n) for j in range(dims)))


@lru_cache
def _best_multiplier(n: int, dims: int) -> int:
    if n > _SEARCHED or dims > _SEARCHED_DIMS:
        raise ValueError(
            f"a must be given for more than {_SEARCHED} points or {_SEARCHED_DIMS} dimensions, got n={n} and "
            f"dims={dims}"
        )
    units = [a for a in range(min(1, n - 1), n // 2 + 1) if math.gcd(a, n) == 1] or [0]
    kernel, k = _kernel(np.arange(n) / n), np.arange(n)
    errors = []
    for a in units:
        error, component = np.ones(n), 1
        for j in range(1, dims + 1):
            error, component = error * (1 + kernel[k * component % n] / j**2), component * a % n
        errors.append(error.mean() - 1)
    # Equal up to rounding.
    return next(a for a, error in zip(units, errors, strict=True) if error <= min(errors) + 2**-44)


def cbc_lattice(
    n: int, dims: int, weights: ArrayLike | None = None, order_weights: ArrayLike | None = None
) -> Rank1Lattice | BinaryRank1Lattice:
    r"""Make a rank-1 lattice for periodic functions, or smooth ones, by component-by-component construction.

    Each component minimises the squared worst-case error in the weighted Korobov space of smoothness 2, for
    the components before it. With ``weights`` gamma and ``order_weights`` Gamma, that error is the mean over
    all points x of ::

        sum over nonempty sets u of coordinates:  Gamma[len(u)] product of gamma_j 2 pi^2 B_2(x_j) for j in u

    where B_2(x) = x^2 - x + 1/6. Divided by 2 pi^2 in each coordinate, it is that of shifted lattices in the
    Sobolev space of functions with square integrable mixed first derivatives, which need not be periodic.

    Parameters
    ----------
    n : int, number of points, a prime or a power of two, at most 2**22
    dims : int, in [1, 4096]
    weights : array of positive numbers, shape (dims,), optional
        gamma_j: how much coordinate j matters, by default 1 / j**2 for j = 1, 2, ...
    order_weights : array of numbers, shape (most,), optional
        Gamma_1, Gamma_2, ...: how much sets of 1, 2, ... coordinates matter; larger sets do not. Not
        negative. By default 1 for all sizes (product weights).

    Returns
    -------
    Sequence
        As from :func:`rank1_lattice`, which takes the vector of any other construction. The first component
        is 1. Among equally good ones the smallest is taken.

    Notes
    -----
    O(dims n log n) time, times ``len(order_weights)`` if given; 1,000 dimensions of 2**20 points take about a
    minute. The mean of a function that is not periodic converges faster after a random shift,
    :func:`rotate`, and :func:`qmcjax.warps.tent`.

    References
    ----------
    .. [1] D. Nuyens, R. Cools, "Fast algorithms for component-by-component construction of rank-1 lattice
       rules in shift-invariant reproducing kernel Hilbert spaces", Math. Comp. 75, 2006.
    .. [2] F. Y. Kuo, C. Schwab, I. H. Sloan, "Quasi-Monte Carlo methods for high-dimensional integration: the
       standard (weighted Hilbert space) setting and beyond", ANZIAM J. 53, 2011, Sect. 5.

    Examples
    --------
    >>> print((cbc_lattice(13, dims=3).points(2)[1] * 13).round().astype(int))
    [1 5 3]
    """
    n = checks.integer("n", n, 1, _LIMIT)
    if n & (n - 1) and not is_prime(n):
        raise ValueError(f"n must be a prime or a power of two, got {n}")
    dims = checks.integer("dims", dims, 1, _DIMS)
    gamma = _weights("weights", np.arange(1.0, dims + 1) ** -2 if weights is None else weights)
    if gamma.shape != (dims,):
        raise ValueError(f"weights must have the shape ({dims},) of the coordinates, got {gamma.shape}")
    orders = None if order_weights is None else _weights("order_weights", order_weights, zero=True)
    return rank1_of(n, tuple(_vector(n, gamma, orders)))


def _weights(name: str, value: Any, zero: bool = False) -> NDArray[np.float64]:
    array = known(name, value)
    if array.ndim != 1 or not len(array):
        raise ValueError(f"{name} must have one axis, got shape {array.shape}")
    if not np.isfinite(array).all() or array.min() < 0 or (not zero and array.min() == 0):
        wanted = "finite and not negative" if zero else "finite and positive"
        raise ValueError(f"{name} must be {wanted}, got {checks.shown(value)}")
    return array


def _vector(n: int, gamma: NDArray[np.float64], orders: NDArray[np.float64] | None) -> list[int]:
    levels = _levels(n)
    kernel = [_kernel(level / n) for level in levels]
    spectra = [np.fft.rfft(values) for values in kernel]
    # Sums over the sets of l coordinates so far, of their products; or all products, as if of one set.
    rest = 0 if orders is None else len(orders) - 1
    sums = [[np.ones(len(level))] + [np.zeros(len(level))] * rest for level in levels]
    candidates, chosen = np.minimum(levels[0], n - levels[0]), []
    for weight in gamma:
        if orders is None:
            products = [of_level[0] for of_level in sums]
        else:
            products = [orders @ np.stack(of_level) for of_level in sums]
        place = _best(levels, products, spectra, candidates) if chosen else 0
        chosen.append(int(candidates[place]) % n)
        for level, values, of_level in zip(levels, kernel, sums, strict=True):
            factor = weight * np.roll(values, -(place % len(level)))
            if orders is None:
                of_level[0] = of_level[0] * (1 + factor)
            else:
                of_level[:] = [q + factor * low for q, low in zip(of_level, [0.0, *of_level], strict=False)]
        if sums[-1][-1].max() > _LARGEST:
            raise ValueError(f"weights must be smaller: products over all coordinates exceed {_LARGEST}")
    return chosen


def _kernel(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return 2 * np.pi**2 * (x * x - x + 1 / 6)


def _levels(n: int) -> list[NDArray[np.int64]]:
    """Return the k up to signs, by their common divisor with n, times powers of a generator modulo n.

    The first level has the candidates. Where k and -k are equal, all candidates have the same products.
    """
    if n & (n - 1):
        return [_powers(_primitive_root(n), (n - 1) // 2, n), np.zeros(1, np.int64)]
    divisors = [2**j for j in range(n.bit_length())]
    # The units modulo 2**m are the powers of 5, up to signs.
    return [d * _powers(5, max(n // d // 4, 1), n // d) % n for d in divisors]


def _powers(base: int, count: int, n: int) -> NDArray[np.int64]:
    powers = np.ones(1, np.int64)
    while len(powers) < count:
        powers = np.concatenate([powers, powers * pow(base, len(powers), n) % n])
    return powers[:count]


def _primitive_root(n: int) -> int:
    """Return the smallest generator of the units modulo a prime."""
    factors = [d for d in range(1, math.isqrt(n) + 1) if (n - 1) % d == 0]
    orders = [d for d in factors + [(n - 1) // d for d in factors] if d < n - 1]
    return next(g for g in range(1, n) if all(pow(g, d, n) != 1 for d in orders))


def _best(
    levels: list[NDArray[np.int64]],
    products: list[NDArray[np.float64]],
    spectra: list[NDArray[np.complex128]],
    candidates: NDArray[np.int64],
) -> int:
    """Return the place of the smallest candidate with the least sum of products times kernels."""
    length = len(candidates)
    total, error = np.zeros(length // 2 + 1, np.complex128), 0.0
    for level, values, spectrum in zip(levels, products, spectra, strict=True):
        # Without its mean, which all candidates share, a sum is rounded less. The correlation of a level
        # repeats: its spectrum is at every (length / len(level))-th frequency.
        step, centred = length // len(level), values - values.mean()
        total[::step][: len(spectrum)] += step * np.conj(np.fft.rfft(centred)) * spectrum
        rounded = 2**-48 * np.linalg.norm(centred) + 2**-52 * np.linalg.norm(values)
        error += rounded * np.linalg.norm(spectrum) / np.sqrt(len(level))
    scores = np.fft.irfft(total, length)
    tied = np.flatnonzero(scores <= scores.min() + error)  # equal up to rounding
    return int(tied[np.argmin(candidates[tied])])

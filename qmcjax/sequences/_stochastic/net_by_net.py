"""Scrambled sequences, generated net by net, in base 2 and in base b; pmj02 is one of them."""

from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax.core import checks, draws
from qmcjax.core.bits import high_product
from qmcjax.core.digits import word
from qmcjax.core.jax_internals import alike
from qmcjax.sequences._digital.digital import Digital
from qmcjax.sequences._digital.halton import RadicalInverses
from qmcjax.sequences._digital.prime_digital import PrimeDigital
from qmcjax.sequences._protocol.plug_in import Tabulated
from qmcjax.sequences._scrambling.owen_exact import node_of, permute, random_word, random_word_of
from qmcjax.sequences._stochastic.random import first_fraction

_DIGIT, _BEHIND = 2**15, 2**15 + 1
"""Replaces the depth of a node: for the first digit of a point, or the digits after the shared ones."""


def component(sequence: RadicalInverses | PrimeDigital, dim: int, seeds: Array, n: int) -> Array:
    """Return one coordinate of the first n points as 32-bit fractions, uint32 (n,)."""
    base = sequence.bases[dim]
    count = _resolved(base)
    if n > base**count:
        raise ValueError(f"n must be at most {base**count} in base {base}, got {n}")
    shifts = np.zeros((count, count), np.uint32)
    if isinstance(sequence, PrimeDigital):
        with jax.ensure_compile_time_eval():
            shifts = _to_earlier(sequence.matrix(dim)[:count, :count], base)
    return _component(jnp.asarray(shifts), seeds[dim], base, n)


def _resolved(base: int) -> int:
    """Return the number of digits of 32-bit fractions: the largest K with ``base**K <= 2**32``."""
    count = 1
    while base ** (count + 1) <= 2**32:
        count += 1
    return count


def _to_earlier(matrix: NDArray[np.uint32], base: int) -> NDArray[np.uint32]:
    """Return the summands of the lower k digits of an index for each unit of digit k, modulo the base.

    Point a * base**k + j shares its first k digits with the point of index j plus a times row k, digit by
    digit: U_k s = u for the upper left block U_k of the generator matrix and the k numbers u above the
    diagonal in its column k. The Faure matrices are upper triangular.

    ``matrix``: uint32 array, shape (K, K): upper triangular, ones on the diagonal. ``base``: a prime. Returns
    uint32 array, shape (K, K): row k has k numbers, followed by zeros.
    """
    shifts = np.zeros(matrix.shape, np.int64)
    for k in range(len(matrix)):
        rest = matrix[:, k].astype(np.int64)
        for row in range(k - 1, -1, -1):
            shifts[k, row] = rest[row]
            rest[:k] = (rest[:k] - rest[row] * matrix[:k, row].astype(np.int64)) % base
    return shifts.astype(np.uint32)


@partial(jax.jit, static_argnames=("base", "n"))
def _component(shifts: Array, seeds: Array, base: int, n: int) -> Array:
    count = _resolved(base)
    index = jax.lax.iota(jnp.uint32, n)

    def draw(which: int, number: int) -> Array:
        random = random_word_of(node_of(index, seeds), jnp.uint32(which), jnp.uint32(0), seeds)
        return high_product(random, jnp.full_like(random, np.uint32(number)))

    behind = draw(_BEHIND, base ** (count - 1))
    # The digits of all points, as integers below base**count.
    points = draw(_DIGIT, base)[:1] * word(base ** (count - 1)) + behind[:1]
    size = 1
    for k in range(count):
        if size >= n:
            break
        total = min(size * (base - 1), n - size)
        top = np.uint32(1) + jax.lax.iota(jnp.uint32, -(-total // size))
        earlier = _earlier(top, shifts[k], base, k).ravel()[:total]
        added = np.uint32(1) + permute(
            jnp.repeat(top, size)[:total] - np.uint32(1),
            node_of(earlier, seeds),
            jnp.uint32(k),
            base - 1,
            seeds,
        )
        unit = np.uint32(base ** (count - 1 - k))
        leading = points.at[earlier].get(mode="promise_in_bounds") // unit
        digit = leading % np.uint32(base)
        leading = leading - digit + (digit + added) % np.uint32(base)
        finer = behind[size : size + total] // np.uint32(base**k)
        points = jnp.concatenate([points, leading * unit + finer])
        size += total
    with jax.enable_x64(True):
        return first_fraction(points.astype(jnp.uint64), base**count).astype(jnp.uint32)


def _earlier(top: Array, shifts: Array, base: int, k: int) -> Array:
    """Return the indices of the earlier points for new ones, shape (len(top), base**k).

    ``top``: uint32 Array: digit k of the new points. ``shifts``: uint32 Array, shape (K,).
    """
    earlier = jnp.zeros((top.shape[0], 1), jnp.uint32)
    for place in range(k):
        digits = (jax.lax.iota(jnp.uint32, base)[None, :] + top[:, None] * shifts[place]) % np.uint32(base)
        earlier = digits[:, :, None] * np.uint32(base**place) + earlier[:, None, :]
        earlier = earlier.reshape(top.shape[0], -1)
    return earlier


MOST_POINTS = 2**24
MOST_COORDINATES = 2**28


def net_by_net(sequence: Digital | RadicalInverses | PrimeDigital, n: int, key: Array | int) -> Tabulated:
    """Draw the first n points of an Owen-scrambled sequence net by net, with two hashes per coordinate.

    The first b**k points of a component in base b have one point in each interval of length b**-k. If each
    interval is split into b parts, the next (b - 1) b**k points fill the empty ones: a point shares the first
    k digits of an earlier one, given by the generator matrix, followed by one of the remaining digits, and
    random ones. This is the distribution of nested uniform scrambling, as of :func:`owen_exact`.

    Parameters
    ----------
    sequence : Digital, RadicalInverses or PrimeDigital
        For example ``sobol``, ``larcher_pillichshammer``, ``digital``, ``halton`` or ``faure``. Its first
        b**k points must have one point in each interval of length b**-k in each coordinate. Known before
        tracing unless in base 2.
    n : int
        In [1, 2**24], with ``n * dims`` at most 2**28 and n at most the largest power b**k <= 2**32 of each
        base. The points of a smaller n are the first of a larger one.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Tabulated
        With ``size`` n. If b is not 2, the points lie in the elementary intervals of their digits in ``bits``
        and in float64.

    Notes
    -----
    In base b > 2, this is the uncorrelated swapping of [1]_: digits are drawn independently.

    References
    ----------
    .. [1] A. Helmer, P. Christensen, A. Kensler, "Stochastic Generation of (t, s) Sample Sequences",
       Eurographics Symposium on Rendering, 2021, Sect. 4.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = net_by_net(sequences.sobol(2), 4, key=1).points(4)
    >>> print(sorted((points[:, 0] * 4).astype(int).tolist()))
    [0, 1, 2, 3]
    >>> points = net_by_net(sequences.halton(2), 9, key=1).points(9)
    >>> print(sorted((points[:, 1] * 9).astype(int).tolist()))
    [0, 1, 2, 3, 4, 5, 6, 7, 8]
    """
    if not isinstance(sequence, Digital | RadicalInverses | PrimeDigital):
        raise TypeError(
            f"sequence must be digital in base 2, or a Halton, Faure or van der Corput sequence, got "
            f"{checks.shown(sequence)}"
        )
    if isinstance(sequence, PrimeDigital) and isinstance(sequence.tables, Tracer):
        raise ValueError("sequence must be known before tracing unless in base 2, got a tracer in it")
    n = checked_size(n, sequence.dims)
    if isinstance(sequence, Digital):
        return draw(to_earlier(sequence.matrices), checks.prng_key("key", key), n)
    seeds = _seeds(checks.prng_key("key", key), sequence.dims)
    # The radical inverse in base 2: point 2**k + j shares k digits with point j.
    binary = jnp.uint32(1) << jax.lax.iota(jnp.uint32, 32)[None]
    columns = [
        _words(binary, seeds[dim : dim + 1], n)[:, 0] if base == 2 else component(sequence, dim, seeds, n)
        for dim, base in enumerate(sequence.bases)
    ]
    return Tabulated(jnp.stack(columns, axis=1))


def checked_size(n: int, dims: int) -> int:
    """Return the number of points, or raise a ValueError."""
    n = checks.integer("n", n, 1, MOST_POINTS)
    if n * dims > MOST_COORDINATES:
        raise ValueError(f"n must be at most 2**28 / dims, got n={n} and dims={dims}")
    return n


def draw(steps: Array, key: Array, n: int) -> Tabulated:
    """Draw points in base 2, with ``steps`` from :func:`to_earlier`."""
    return Tabulated(_words(steps, _seeds(key, steps.shape[0]), n))


def _seeds(key: Array, dims: int) -> Array:
    return draws.bits(key, (dims, 2), jnp.uint32)


def to_earlier(matrices: Array | NDArray[np.uint32]) -> Array:
    """Return words to xor that map indices from 2**k on to earlier points with the same first k digits.

    Word k of a coordinate is column k of V in C V = L, with V upper and L lower triangular: the point of
    this index, V's column, begins with k zeros (the "xor-values" of Sect. 4.2, with bit k added). Both V
    and L exist exactly if the first 2**k points are stratified for all k.

    ``matrices``: uint32 array, shape (dims, 32). Returns uint32 Array, shape (dims, 32).
    """
    points, indices = _eliminated(jnp.asarray(matrices))
    if not isinstance(points, Tracer):
        diagonal = np.asarray(points) >> np.arange(31, -1, -1, dtype=np.uint32) & np.uint32(1)
        if not diagonal.all():
            dim, k = np.argwhere(diagonal == 0)[0]
            raise ValueError(
                f"sequence must have one of its first {2 ** (k + 1)} points in each interval of length "
                f"2**-{k + 1}, got a different number in coordinate {dim}"
            )
    return indices


@jax.jit
def _eliminated(matrices: Array) -> tuple[Array, Array]:
    """Return the columns of L and of V."""

    def column(k: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        def clear(row: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
            digit = np.uint32(0) - (state[0][:, k] >> (31 - row).astype(jnp.uint32) & np.uint32(1))
            points, indices = (words.at[:, k].set(words[:, k] ^ (digit & words[:, row])) for words in state)
            return points, indices

        return jax.lax.fori_loop(0, k, clear, state)

    unit = jnp.uint32(1) << jax.lax.iota(jnp.uint32, 32)
    state = alike((matrices, jnp.broadcast_to(unit[None], matrices.shape)))
    return jax.lax.fori_loop(0, 32, column, state)


@partial(jax.jit, static_argnames="n")
def _words(steps: Array, seeds: Array, n: int) -> Array:
    """Return the coordinates as 32-bit fractions, uint32 (n, dims)."""

    def component(steps: Array, seeds: Array) -> Array:
        random = random_word(jax.lax.iota(jnp.uint32, n), seeds)
        words = random[:1]
        for k in range((n - 1).bit_length()):
            index = 2**k + jax.lax.iota(jnp.uint32, min(2**k, n - 2**k))
            earlier = words.at[index ^ steps[k]].get(mode="promise_in_bounds")
            words = jnp.concatenate([words, _beside(earlier, random[2**k : 2 ** (k + 1)], k)])
        return words

    return jax.vmap(component, out_axes=1)(steps, seeds)


def _beside(earlier: Array, random: Array, k: int) -> Array:
    """Return points that share the first k digits with earlier ones, but not the next; the rest is random."""
    unit = np.uint32(2 ** (31 - k))
    behind = unit - np.uint32(1)
    return ((earlier ^ unit) & ~behind) | (random & behind)


def pmj02(n: int, key: Array | int) -> Tabulated:
    """Make the first n points of a progressive multi-jittered (0,2)-sequence.

    Every aligned block of 2**m points is a (0,m,2)-net. The first N = 4**k points have one point in each of
    2**k by 2**k squares. Point N + i is in the square of point i for i < N, diagonally opposite within it;
    point 2 N + i is in one of the two remaining quarters, and point 3 N + i in the other.

    Parameters
    ----------
    n : int, in [1, 2**24]; the points of a smaller n are the first of a larger one
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Tabulated, two dimensions

    Notes
    -----
    In [1]_ each square chooses which quarter comes third. Here a random bit makes one choice for all squares
    of one size, horizontally or vertically next to their first point: otherwise the points from 2 N to 3 N
    would not be a net.

    The renumbered Sobol' sequence has this order. Read the digits of an index as a polynomial over F2, i_0 +
    i_1 x + i_2 x^2 + ...: the digits of the second coordinate are its coefficients in powers of x + 1. So a
    point is in the first of the 2**k by 2**k squares if x^k (x + 1)^k divides its polynomial. In the new
    index, digit 2 k stands for this product, and digit 2 k + 1 for the product times x or times x + 1. Then
    the points are scrambled net by net [2]_.

    References
    ----------
    .. [1] P. Christensen, A. Kensler, C. Kilpatrick, "Progressive Multi-Jittered Sample Sequences", 2018.
    .. [2] A. Helmer, P. Christensen, A. Kensler, "Stochastic Generation of (t, s) Sample Sequences", 2021.

    Examples
    --------
    >>> points = pmj02(4, key=0).points(4)
    >>> print(((points[0] < 0.5) != (points[1] < 0.5)).tolist())
    [True, True]
    """
    n = checked_size(n, 2)
    choices_key, points_key = draws.split(checks.prng_key("key", key))
    # If the factor is x + 1 instead of x, digit 2 k + 1 of the index is added to digit 2 k.
    choices = draws.bits(choices_key, (), jnp.uint32) & np.uint32(0x55555555)
    steps = jnp.asarray(_steps())
    return draw(steps ^ (steps >> 1 & choices), points_key, n)


@cache
def _steps() -> NDArray[np.uint32]:
    """Return the maps from indices to those of earlier points, for the factor x at all levels."""
    columns = np.empty((2, 32), np.uint32)
    polynomial = 1
    for k in range(16):
        times_x = polynomial << 1
        # In powers of x + 1, x becomes x + 1 and vice versa.
        columns[:, 2 * k] = _reversed(polynomial)
        columns[:, 2 * k + 1] = _reversed(times_x), _reversed(times_x ^ polynomial)
        polynomial = (times_x ^ polynomial) << 1
    with jax.ensure_compile_time_eval():
        return np.asarray(to_earlier(columns))


def _reversed(word: int) -> int:
    return int(f"{word:032b}"[::-1], 2)

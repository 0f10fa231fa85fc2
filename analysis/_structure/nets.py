"""The quality parameter t of nets, by counts of points in elementary intervals or by ranks of matrices."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._host import call_back_count
from analysis._structure.intervals import cells, fractions
from qmcjax.core import checks, number_theory

_WORD = 32


class _Net(abc.ABC):
    """Input of the search for t; states stand for a choice of leading digits of some coordinates."""

    m: int
    dims: int
    root: Any = ()

    def even_digits(self, state: Any, used: int, axis: int, limit: int) -> int:
        """Return up to how many more digits, of one other coordinate, the intervals are filled evenly."""
        for digit in range(limit):
            state = self.refine(state, axis, digit)
            if state is None:
                return digit
        return limit

    @abc.abstractmethod
    def refine(self, state: Any, axis: int, digit: int) -> Any:
        """Return the state with one more digit of a coordinate, None if intervals are then not even.

        It has all previous digits of the coordinate.
        """


class _MatrixNet(_Net):
    """The rows of the matrices; a state of the search is a basis of the rows chosen so far.

    With d_j digits of coordinate j, the interval of a point is the product of the first d_j rows of
    C_j, for all j, with the digits of its index. All intervals contain equally many points if and only if
    this map is onto, that is, if these rows are independent.
    """

    def __init__(self, m: int, rows: list[list[Any]]):
        self.m, self.dims, self._rows = m, len(rows), rows


class _BinaryNet(_MatrixNet):
    """Rows over F_2, as Python integers. Each row of a basis lacks the leading ones of the previous rows."""

    def refine(self, state: tuple[int, ...], axis: int, digit: int) -> tuple[int, ...] | None:
        row = self._rows[axis][digit]
        for vector in state:
            row = min(row, row ^ vector)
        return (*state, row) if row else None


class _PrimeNet(_MatrixNet):
    """Rows over F_q, as arrays. A basis contains pairs of a column and a vector that is 1 there."""

    def __init__(self, m: int, rows: list[list[Any]], q: int):
        super().__init__(m, rows)
        self._q = q

    def refine(self, state: tuple, axis: int, digit: int) -> tuple | None:
        row = self._rows[axis][digit]
        for column, vector in state:
            row = (row - row[column] * vector) % self._q
        column = int(np.argmax(row != 0))
        if row[column] == 0:
            return None
        return (*state, (column, row * pow(int(row[column]), -1, self._q) % self._q))


def _matrix_net(matrices: NDArray, base: int, m: int | None) -> _MatrixNet:
    """Return the net of the first ``base**m`` points of generator matrices, packed in words or not."""
    q = number_theory.prime("base", base)
    if matrices.dtype.kind not in "iu":
        raise ValueError(
            f"points_or_matrices must be integers where m is given or there are three axes, "
            f"got {matrices.dtype} {matrices.shape} with m={m}"
        )
    if matrices.ndim == 2:
        matrices = _unpack(matrices, q)
    if matrices.ndim != 3 or 0 in matrices.shape:
        raise ValueError(f"points_or_matrices must have shape (s, rows, columns), got {matrices.shape}")
    largest = min(matrices.shape[1:])
    m = matrices.shape[2] if m is None else m
    m = checks.integer("m", m, 0, largest)
    elements = (matrices[:, :m, :m] % q).astype(np.int64)
    if q > 2:
        return _PrimeNet(m, [list(rows) for rows in elements], q)
    packed = np.packbits(elements.astype(np.uint8), axis=-1)
    return _BinaryNet(m, [[int.from_bytes(row.tobytes()) for row in rows] for rows in packed])


def _unpack(words: NDArray, q: int) -> NDArray:
    """Return packed matrices, column k with its first row in bit 31, as digits (s, 32, 32)."""
    if q != 2 or words.dtype != np.uint32 or words.shape[1] != _WORD:
        raise ValueError(
            "points_or_matrices must be uint32 of shape (s, 32) with base=2, or have shape "
            f"(s, rows, columns), got {words.dtype} {words.shape} with base={q}"
        )
    row = np.arange(_WORD, dtype=np.uint32)
    return words[:, None, :] >> (np.uint32(_WORD - 1) - row)[None, :, None] & np.uint32(1)


_ONE_INTEGER = jax.ShapeDtypeStruct((), jnp.int32)


def t_value(points_or_matrices: ArrayLike, base: int = 2, m: int | None = None) -> int:
    """Return the quality parameter t of a net: the smallest t for which it is a (t,m,s)-net.

    The base**m points are a (t,m,s)-net if every elementary interval of volume base**(t - m) contains
    base**t of them (Definition 4 of [1]_). Smaller is better; t = m holds for any points.

    Parameters
    ----------
    points_or_matrices : ArrayLike
        Without ``m``, an array with two axes contains points, and t is found by counting: shape (n, s), n
        a power of the base, float32 or float64 in [0, 1), or uint32 fractions of 2**32.

        With ``m``, it contains generator matrices, and t is found from ranks: uint32 of shape (s, 32)
        with column k of C_j as a word, its first row in bit 31 (the ``matrices`` of a digital
        sequence in base 2; without ``m`` they would be read as points). Integers with three axes
        (s, rows, columns) are always generator matrices, over F_base, with entries modulo the base.
    base : int, in [2, 65535]; a prime for matrices
    m : int, optional
        The net is the first base**m points of the sequence of the matrices (any aligned block has the same
        t), given by their upper left m x m blocks. For three axes, the number of columns by default.

    Returns
    -------
    int
        In [0, m]. If JAX traces the points or matrices (``jit``, ``vmap``), an int32 Array.

    Notes
    -----
    Counting takes O(n) for each shape of intervals examined, ranks at most O(m**2). The number of shapes is
    at least binom(m - t + s - 1, s - 1), that of shapes with m - t digits, and at most that for t = 0. If a
    shape is filled uniformly, so are all coarser ones, so one pass determines t.

    Floats represent fractions rounded to nearest: an interval [a / b**d, (a + 1) / b**d) begins at the float
    nearest to a / b**d and ends before the one nearest to (a + 1) / b**d. So every a / b**k with b**k below
    2**24 in float32, below 2**53 in float64, is counted in the interval of the exact fraction, unlike in
    plain arithmetic: about half of these floats are just below their fraction. In base 2 the ends are floats
    and nothing is rounded. uint32 fractions are exact in any base. Pass points with more digits than float32
    represents in float64 or as words; this is required for more than 2**24 points.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.1.4 and Eq. 5.9.
    .. [2] H. Niederreiter, "Random Number Generation and Quasi-Monte Carlo Methods", 1992, Sect. 4.3.

    Examples
    --------
    >>> t_value([[0.0, 0.0], [0.25, 0.5], [0.5, 0.25], [0.75, 0.75]])
    0
    >>> from qmcjax import sequences
    >>> t_value(sequences.sobol(5).matrices, m=20)
    5
    """
    if isinstance(points_or_matrices, Tracer):
        return call_back_count(lambda known: t_value(known, base, m), _ONE_INTEGER, points_or_matrices)
    net = _net(points_or_matrices, base, m)
    return net.m - _strength(net, range(net.dims))


def projection_t_values(
    points_or_matrices: ArrayLike, base: int = 2, m: int | None = None, size: int = 2
) -> dict[tuple[int, ...], int]:
    """Return t of all projections of a net onto pairs of coordinates, triples, and so on.

    Parameters
    ----------
    points_or_matrices, base, m
        As for :func:`t_value`.
    size : int, the number of coordinates of a projection, in [1, s]

    Returns
    -------
    dict
        From the coordinates, in increasing order, to t; to int32 Arrays if JAX traces.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> projection_t_values(sequences.sobol(4).matrices, m=10)
    {(0, 1): 0, (0, 2): 1, (0, 3): 2, (1, 2): 1, (1, 3): 1, (2, 3): 1}
    """
    if isinstance(given := points_or_matrices, Tracer):
        dims = given.shape[0 if m is not None or given.ndim == 3 else -1]
        size = checks.integer("size", size, 1, dims)
        outline = {axes: _ONE_INTEGER for axes in combinations(range(dims), size)}
        return call_back_count(lambda known: projection_t_values(known, base, m, size), outline, given)
    net = _net(points_or_matrices, base, m)
    size = checks.integer("size", size, 1, net.dims)
    return {axes: net.m - _strength(net, axes) for axes in combinations(range(net.dims), size)}


def _net(points_or_matrices: ArrayLike, base: int, m: int | None) -> _Net:
    name = "points_or_matrices"
    given = _arguments.array(name, points_or_matrices, "an array of points or of matrices")
    if m is not None or given.ndim == 3:
        return _matrix_net(given, base, m)
    return _PointNet(fractions(given, name), checks.integer("base", base, 2, number_theory.FIELD_LIMIT - 1))


def _strength(net: _Net, axes: Sequence[int]) -> int:
    """Return the largest k for which the net is even for all shapes of k digits of these coordinates.

    The last coordinate of a shape takes all remaining digits. If it cannot take all of them, k is reduced to
    what it can take. Shapes of the smaller k that come earlier in the search need no second look: each is
    part of one that was even.
    """
    strength = net.m

    def search(state: Any, used: int, first: int) -> None:
        nonlocal strength
        for i in range(first, len(axes)):
            if used >= strength:
                return
            strength = used + net.even_digits(state, used, axes[i], strength - used)
            refined, digit = state, 0
            while i + 1 < len(axes) and used + digit + 1 < strength:
                refined = net.refine(refined, axes[i], digit)
                digit += 1
                search(refined, used + digit, i + 1)

    search(net.root, 0, 0)
    return strength


class _PointNet(_Net):
    """Points to be counted; a state of the search is the number of the interval of each point."""

    def __init__(self, points: NDArray, base: int):
        n, self.dims = points.shape
        self.m = 0
        while base**self.m < n:
            self.m += 1
        if base**self.m != n:
            raise ValueError(f"points must be a power of base={base} in number, got n={n}")
        self._base = base
        self._columns = np.ascontiguousarray(cells(points, n).T)
        self.root = np.zeros(n, np.int64)

    def even_digits(self, state: NDArray, used: int, axis: int, limit: int) -> int:
        base = self._base
        leading = self._columns[axis] // base ** (self.m - limit)
        counts = np.bincount(state * base**limit + leading, minlength=base ** (used + limit))
        while (counts != counts[0]).any():
            counts = counts.reshape(-1, base).sum(axis=1)
            limit -= 1
        return limit

    def refine(self, state: NDArray, axis: int, digit: int) -> NDArray:
        base = self._base
        return state * base + self._columns[axis] // base ** (self.m - 1 - digit) % base

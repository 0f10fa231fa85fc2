"""Digital sequences over prime fields: Faure's, modified ones, and those of searched matrices."""

import math
from dataclasses import field
from functools import cache
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks, number_theory, tables
from qmcjax.core.digits import digit_count, digit_spans, exact_fraction
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.cells import packed
from qmcjax.sequences._digital.digital import Digital, digital
from qmcjax.sequences._protocol.base import FEW, DigitSequence


@frozen_pytree
class PrimeDigital(DigitSequence):
    """Coordinate j of point i is C_j times the digits of i, over F_q (thesis Eq. 5.9).

    Tables contain the products with all numbers of a few digits. Each digit of a product has a bit field wide
    enough for the sum of the table entries of an index; the sum is reduced modulo q.
    """

    bases: tuple[int, ...] = field(metadata={"static": True})
    """The prime q, for all coordinates."""
    tables: Array
    """uint32 (dims, words, entries): the concatenated tables of all spans of digits."""
    called: str = field(default="faure", metadata={"static": True})
    """Name of the function that makes such a sequence."""

    reported = ("dims", "base")

    @property
    def base(self) -> int:
        """The prime q."""
        return self.bases[0]

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        return self._fractions(index, np.array(dim), dtype)

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if len(dims) <= FEW:
            return super().coordinates(index, dims, dtype)
        return self._fractions(index[..., None], np.array(dims).reshape((1,) * index.ndim + (-1,)), dtype)

    def spans(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        digits = iter(self._digits(index, dims))
        numbers = []
        for span in digit_spans(self.base):
            of_span = list(islice(digits, span))
            number = of_span[-1]
            for digit in of_span[-2::-1]:
                number = number * np.uint32(self.base) + digit
            numbers.append(number)
        return numbers

    def radical_bases(self) -> tuple[int | None, ...]:
        """Return the base for each component with a lower triangular or traced matrix."""
        if isinstance(self.tables, Tracer):
            return self.bases
        return tuple(
            self.base if not np.any(np.triu(matrix, 1)) and np.all(np.diagonal(matrix)) else None
            for matrix in map(self.matrix, range(self.dims))
        )

    def index_digits(self, component: int, count: int) -> None:
        """Return None if the matrix of the component is the identity or traced."""
        if isinstance(self.tables, Tracer):
            return
        matrix = self.matrix(component)
        if np.any(matrix != np.eye(len(matrix))):
            super().index_digits(component, count)

    def matrix(self, component: int) -> NDArray[np.uint32]:
        """Return a generator matrix: column k contains the digits of point base**k."""
        powers = np.uint32(self.base) ** np.arange(digit_count(self.base), dtype=np.uint32)
        return np.asarray(_digits_of(self, jnp.asarray(powers), jnp.uint32(component)))

    def _fractions(self, index: Array, dims: np.ndarray, dtype: DTypeLike) -> Array:
        digits = self._digits(index, dims)
        leading = digits[0]
        for digit in digits[1:-1]:
            leading = leading * np.uint32(self.base) + digit
        return exact_fraction(leading, digits[-1], self.base, dtype)

    def _digits(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        """Return the digits after the radix point, the first one first."""
        base = np.uint32(self.base)
        _, words, entries = self.tables.shape
        tables = self.tables.ravel()
        sums = [jnp.zeros_like(index)] * words
        rest = index
        start = jnp.asarray(dims.astype(np.uint32)) * np.uint32(words * entries)
        for size in (self.base**span for span in digit_spans(self.base)):
            quotient = rest // np.uint32(size)
            number = rest - quotient * np.uint32(size)
            for w in range(words):
                place = number + start + np.uint32(w * entries)
                sums[w] = sums[w] + tables.at[place].get(mode="promise_in_bounds")
            rest, start = quotient, start + np.uint32(size)
        width, per_word = _fields(self.base)
        mask = np.uint32(2**width - 1)
        return [
            ((sums[k // per_word] >> (k % per_word * width)) & mask) % base
            for k in range(digit_count(self.base))
        ]


@jax.jit
def _digits_of(sequence: PrimeDigital, index: Array, dim: Array) -> Array:
    return jnp.stack(sequence._digits(index, dim))


def prime_digital(matrices: np.ndarray, base: int, called: str = "faure") -> PrimeDigital:
    """Make the digital sequence of matrices over F_q, int64 (dims, K, K), for the K digits of an index."""
    width, per_word = _fields(base)
    dims, count, _ = matrices.shape
    words = -(-count // per_word)
    tables = []
    first = 0
    for span in digit_spans(base):
        number = np.arange(base**span)
        digits = np.stack([number // base**k % base for k in range(span)])
        product = matrices[:, :, first : first + span] @ digits % base
        packed = np.zeros((dims, words, len(number)), np.uint32)
        for k in range(count):
            packed[:, k // per_word] |= product[:, k].astype(np.uint32) << np.uint32(k % per_word * width)
        tables.append(packed)
        first += span
    return PrimeDigital((base,) * dims, jnp.asarray(np.concatenate(tables, axis=-1)), called)


def _fields(base: int) -> tuple[int, int]:
    """Return the width of a bit field for a sum of one digit per table, and the number of fields per word."""
    width = (len(digit_spans(base)) * (base - 1)).bit_length()
    return width, 32 // width


FAURE_DIMS = 1024
FAURE_BASES = 2**13
"""Limit of bases: each coordinate has tables of two words for each value of its three digits."""


def faure(dims: int, base: int | None = None, modified: int | None = None) -> PrimeDigital | Digital:
    """Make the Faure (0,s)-sequence, or its renumbering with a Larcher-Pillichshammer component.

    Component i, counted from 0, is generated by the power i of Pascal's matrix: the element in row j and
    column r is binom(r, j) i**(r - j) modulo the base. Every aligned block of base**m points is a
    (0,m,s)-net, and the first base**m points with n / base**m as an additional coordinate are a
    (0,m,s+1)-net.

    Parameters
    ----------
    dims : int, in [1, 1024]
    base : int, optional
        A prime in [dims, 8192), by default the smallest: nets have more points in larger bases.
    modified : int, optional
        The component, in [0, dims - 1], with the upper triangular matrix of ones. All others change with it.
        The nets of the first base**m points are the same, numbered differently.

    Returns
    -------
    PrimeDigital or Digital
        With exact ``bits`` in base 2. In other bases every value is an exact fraction, rounded once.

    Notes
    -----
    The thesis states C_i^-1 = C_(s-i) for a_i = i - 1, with i from 1. The inverse of the matrix for a_i is
    the one for -a_i modulo q: the index is correct for s = q if counted from 0, with a_i = i > 0. Counted
    from 1, C_i^-1 is C_(q+2-i) for i > 1, and C_1 is its own inverse.

    References
    ----------
    .. [1] H. Faure, "Discrepance de suites associees a un systeme de numeration (en dimension s)", 1982.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Eq. 5.22, Theorem 2 and "Modifying Faure's (0,s)-Sequences".

    Examples
    --------
    >>> print((faure(3).points(9) * 9).round().astype(int).T)
    [[0 3 6 1 4 7 2 5 8]
     [0 3 6 4 7 1 8 2 5]
     [0 3 6 7 1 4 5 8 2]]
    """
    dims = checks.integer("dims", dims, 1, FAURE_DIMS)
    if base is None:
        base = number_theory.next_prime(dims)
    base = number_theory.prime("base", base, low=max(dims, 2), high=FAURE_BASES - 1)
    matrices = faure_matrices(dims, base, digit_count(base))
    if modified is not None:
        component = checks.integer("modified", modified, 0, dims - 1)
        ones = np.triu(np.ones_like(matrices[0]))
        matrices = renumbered(matrices, component, ones, base)
    if base == 2:
        return digital(packed(matrices))
    return prime_digital(matrices, base)


def faure_matrices(dims: int, base: int, size: int) -> np.ndarray:
    """Return the upper left blocks of the Faure generator matrices, int64 (dims, size, size) (Eq. 5.22)."""
    entries = [
        [[math.comb(r, j) * i ** (r - j) % base if j <= r else 0 for r in range(size)] for j in range(size)]
        for i in range(dims)
    ]
    return np.array(entries, np.int64)


def renumbered(
    matrices: NDArray[np.int64], component: int, replacement: NDArray[np.int64], q: int
) -> NDArray[np.int64]:
    """Return C_k D with D = C_j^-1 C' for component j: C' replaces C_j (thesis, Theorem 2).

    An upper triangular D renumbers the points among the first q**m, for every m. The printed proof equates
    the upper left block of a product with the product of the upper left blocks, which holds for such D only.
    With other D the first q**m points are a net, but fewer may not be.
    """
    return matrices @ (number_theory.inverse(matrices[component], q) @ replacement % q) % q


QUAD_DIMS = 32


def quad_optimized(dims: int) -> PrimeDigital:
    """Make a sequence in base 3 with good nets as consecutive pairs and quadruples of coordinates.

    Coordinates 2 k and 2 k + 1 are a (0,2)-sequence. In coordinates 4 k to 4 k + 3, each aligned block of
    3**m points is a (t,m,4)-net with t = 1 for m <= 8, that is up to 6561 points, t = 2 for m <= 13,
    t = 3 for m <= 17 and t = 4 for m <= 20. (0,4)-sequences need base 4 or more.

    Parameters
    ----------
    dims : int, in [1, 32]

    Notes
    -----
    ``analysis.tables.quadruples`` found the matrices column by column, each by a local search. The idea to
    optimise consecutive pairs and quadruples is from [1]_, which searches Sobol's construction over F_3; the
    matrices here are our own. The numbering of the points differs between quadruples, and was chosen for
    small t of other pairs of coordinates, too.

    Niederreiter's quadruple for x, x + 1, x + 2 and x^2 + 1 [2]_ has t <= 1 for all m, but its pairs can have
    t = 1.

    References
    ----------
    .. [1] V. Ostromoukhov, N. Bonneel, D. Coeurjolly, J.-C. Iehl, "Quad-Optimized Low-Discrepancy
       Sequences", SIGGRAPH, 2024.
    .. [2] H. Niederreiter, "Low-discrepancy and low-dispersion sequences", 1988.

    Examples
    --------
    >>> points = quad_optimized(4).points(9)
    >>> print(sorted((points[:, 2] * 9).round().astype(int).tolist()))
    [0, 1, 2, 3, 4, 5, 6, 7, 8]
    """
    dims = checks.integer("dims", dims, 1, QUAD_DIMS)
    return prime_digital(_quad_matrices()[:dims].astype(np.int64), 3, "quad_optimized")


@cache
def _quad_matrices() -> NDArray[np.uint8]:
    """Read the matrices, shape (32, 21, 21)."""
    lines = tables.rows("sequences", "quadruples.txt")
    return np.array([[list(row) for row in line] for line in lines], np.uint8)

"""Digital sequences in base 2 by constructions other than Sobol's, or with other direction numbers."""

from dataclasses import field
from functools import cache
from importlib import resources
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.bits import pascal
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.cells import packed
from qmcjax.sequences._digital.digital import Digital, digital, identity
from qmcjax.sequences._digital.direction_numbers import read_direction_numbers, sobol_of
from qmcjax.sequences._digital.sobol_matrix import matrices_of
from qmcjax.sequences._protocol.binary import BinarySequence

# fmt: off
_CASCADE = (
    1, 1, 2, 2, 2, 2, 4, 3, 18, 2, 2, 2, 2, 23, 9, 8, 3, 1, 39, 8, 29, 1, 3, 23, 31, 35, 13, 60, 36, 35, 24,
)
# fmt: on
"""The component of Joe and Kuo's table, counted from 1, that maps each dimension to the next."""

CASCADED_DIMS = 1 + len(_CASCADE)


@frozen_pytree
class DigitalNet(Digital):
    """The 2**m points of matrices of order m, which do not extend to a sequence."""

    m: int = field(default=32, metadata={"static": True})

    called = "cascaded_net"
    reported = ("dims", "m")

    @property
    def size(self) -> int:
        return 2**self.m

    def inverted(self, log_side: int) -> Any:
        """Raise: there are no frames."""
        return BinarySequence.inverted(self, log_side)


def cascaded_net(m: int, dims: int) -> DigitalNet:
    """Make a net of 2**m points with (0,m,2)-nets in all consecutive pairs of dimensions.

    The first coordinate is i / 2**m. Each further coordinate is a component of the Sobol' sequence, with 2**m
    times the previous coordinate as index.

    Parameters
    ----------
    m : int, in [1, 32]
    dims : int, in [1, 32]; fewer dimensions are the first ones

    Returns
    -------
    DigitalNet
        The net for m is not part of the net for m + 1.

    Notes
    -----
    The construction is that of [1]_. Our own search (``analysis/tables/sobol_components.py``) chose the
    components among those of Joe and Kuo, one by one, for small t of all pairs, and of three and four
    consecutive dimensions, for m = 4 to 14. The choice matters: with Pascal's matrix P, that of x + 1, in all
    dimensions, every third dimension is the same, since (P J)**3 is the identity, where J reverses the
    digits. Over all pairs of the 32 dimensions, the mean of t is 2.1, 2.7 and 3.3 for m = 8, 12 and 15, and
    the largest t is 6, 8 and 11. For :func:`sobol` the mean is 2.2, 2.5 and 2.9, the largest 5, 5 and 6.

    References
    ----------
    .. [1] L. Paulin, D. Coeurjolly, J.-C. Iehl, N. Bonneel, A. Keller, V. Ostromoukhov, "Cascaded Sobol'
       Sampling", ACM Trans. Graph. 40(6), 2021.

    Examples
    --------
    >>> print((cascaded_net(2, 4).points(4) * 4).astype(int))
    [[0 0 0 0]
     [1 2 3 1]
     [2 3 1 2]
     [3 1 2 3]]
    """
    m = checks.integer("m", m, 1, 32)
    dims = checks.integer("dims", dims, 1, CASCADED_DIMS)
    matrices = matrices_of(max(_CASCADE) + 1)
    columns = np.zeros((dims, 32), np.uint32)
    columns[0, :m] = np.uint32(1) << np.arange(32 - m, 32, dtype=np.uint32)
    for dim, component in enumerate(_CASCADE[: dims - 1]):
        digits = columns[dim, :m, None] >> np.arange(32 - m, 32, dtype=np.uint32) & np.uint32(1)
        columns[dim + 1, :m] = np.bitwise_xor.reduce(digits * matrices[component - 1, :m], axis=1)
    return DigitalNet(jnp.asarray(columns), m=m)


ONE_TWO_DIMS = 20


def one_two(dims: int) -> Digital:
    """Make a Sobol' sequence with (1,2)-sequences in base 2 as components 2 k and 2 k + 1.

    The first pair is that of :func:`sobol`, a (0,2)-sequence.

    Parameters
    ----------
    dims : int, in [1, 20]; fewer dimensions are the first ones

    Returns
    -------
    Digital
        The value t of the pairs is verified for all nets of up to 2**32 points.

    Notes
    -----
    In Sobol's construction, only x and x + 1 give a (0,2)-sequence. The polynomials p and p**2 + p + 1 can
    reach t = 1 [1]_. The direction numbers are from our own search (``analysis/tables/sobol_components.py``)
    and differ from those of [1]_. It covers all p of degrees up to 7 for which both polynomials are
    irreducible: such p have degrees 1, 2, 5, 6 and 7.

    References
    ----------
    .. [1] N. Bonneel, D. Coeurjolly, J.-C. Iehl, V. Ostromoukhov, "Sobol' Sequences with Guaranteed-Quality
       2D Projections", ACM Trans. Graph. 44(4), 2025.

    Examples
    --------
    >>> print((one_two(4).points(4) * 4).astype(int))
    [[0 0 0 0]
     [2 2 2 2]
     [1 3 3 1]
     [3 1 1 3]]
    """
    dims = checks.integer("dims", dims, 1, ONE_TWO_DIMS)
    with resources.as_file(tables.file("sequences", "one_two.txt")) as path:
        numbers = read_direction_numbers(path)
    return digital(sobol_of(numbers).matrices[:dims])


SZ_DIMS = 256


def sz(dims: int) -> Digital:
    """Make a (0,256)-sequence in base 256 from (0,16)-, (0,4)- and (0,2)-sequences in bases 16, 4 and 2.

    Components 2 k and 2 k + 1 are a (0,2)-sequence in base 2 for each k, components 4 k to 4 k + 3 a
    (0,4)-sequence in base 4, components 16 k to 16 k + 15 a (0,16)-sequence in base 16, and all 256 a
    (0,256)-sequence in base 256. Fewer dimensions are the first ones; the first two are those of
    :func:`sobol`.

    Parameters
    ----------
    dims : int, in [1, 256]

    Notes
    -----
    Sequences with these properties were introduced in [1]_, with matrices from a search over two alphabets of
    2 x 2 blocks. Ours are constructed instead, and may differ. Let F be the field of 2**q elements for q = 1,
    2, 4, 8, and C_F(a) the generator matrix of the Faure sequence for a in F: its element in row j and column
    r is binom(r, j) a**(r - j). To write it as a binary matrix, replace each element by the q x q matrix of
    multiplication by it. If the elements are numbered as Conway's nimbers [2]_, the number c is the sum of
    its bit 0 in F_2, bit 1 in F_4, bits 2 and 3 in F_16 and bits 4 to 7 in F_256, and component c has the
    matrix

        C_2(c & 1) C_4(c & 2) C_16(c & 12) C_256(c & 240).

    Proof: C_F(a) C_F(b) = C_F(a + b). By Lucas' theorem, C_F(a) for a in F is B C_E(a**2), where E is the
    field with the square of the size of F, and B is block diagonal and invertible, with one block for each
    digit of E. So the product up to F is D C_F(a), where D is such a matrix for F, and a runs through all
    elements of F with the bits of c up to F. These are components of the Faure sequence over F, multiplied
    from the right by the rest of the product, which is the same for all components of a group. Neither D nor
    the rest changes t = 0: the rest, too, is upper triangular with unit diagonal, in blocks of the digits of
    F.

    Pairs of coordinates that are not (0,2)-sequences can be worse than those of :func:`sobol`. At 512
    Owen-scrambled points, the RMS errors of :func:`sobol` are .72, .98, .92 and .81 times as large in
    coordinates 0, 2; 0, 3; 1, 2 and 1, 3, on average over half-planes, discs, smooth bumps and products, and
    .46 and .55 times for the smooth ones in coordinates 0, 2. In the first four dimensions together they are
    .65 to .85 times as large for 2**7, 2**9, 2**11 and 2**13 points, which are not powers of 4, and .98 to
    1.26 times for 2**6, ..., 2**14.

    References
    ----------
    .. [1] A. G. M. Ahmed et al., "SZ Sequences: Binary-Constructed (0, 2^q)-Sequences", arXiv 2505.20434,
       2025.
    .. [2] J. H. Conway, "On Numbers and Games", 1976, chapter 6.
    .. [3] H. Niederreiter, "Point sets and sequences with small discrepancy", 1987: (0,s)-sequences over any
       finite field.

    Examples
    --------
    >>> print((sz(4).points(4) * 4).astype(int))
    [[0 0 0 0]
     [2 2 2 2]
     [1 3 1 3]
     [3 1 3 1]]
    """
    dims = checks.integer("dims", dims, 1, SZ_DIMS)
    words = packed(np.stack([_sz_matrix(dim) for dim in range(dims)]))
    return Digital(jnp.asarray(words), (identity, pascal)[:dims], called="sz")


def _sz_matrix(component: int) -> NDArray[np.int64]:
    matrix = np.eye(32, dtype=np.int64)
    for bits, part in ((1, 1), (2, 2), (4, 12), (8, 240)):
        if component & part:
            matrix = matrix @ _field_pascal(component & part, bits) % 2
    return matrix


def _field_pascal(element: int, bits: int) -> NDArray[np.int64]:
    """Return C_F(element) for the field F of 2**bits elements, as a binary matrix."""
    # Column k contains the product with the element of bit k.
    products = [_nim_product(element, 1 << k) for k in range(bits)]
    factor = np.array(products) >> np.arange(bits)[:, None] & 1
    matrix, power = np.zeros((32, 32), np.int64), np.eye(bits, dtype=np.int64)
    for distance in range(32 // bits):
        odd = np.arange(32 // bits - distance) & distance == 0  # binom(j + distance, j), by Kummer's theorem.
        matrix += np.kron(np.diag(odd, distance), power)
        power = power @ factor % 2
    return matrix


def _nim_product(a: int, b: int, half: int = 4) -> int:
    """Multiply elements of the field of 2**(2 half) numbers, pairs over the field of 2**half.

    Sums are xors. The number i = 2**half has the square i + 2**(half - 1).
    """
    if half == 0:
        return a & b
    low_a, high_a, low_b, high_b = a % 2**half, a >> half, b % 2**half, b >> half
    lows = _nim_product(low_a, low_b, half // 2)
    highs = _nim_product(high_a, high_b, half // 2)
    cross = _nim_product(low_a ^ high_a, low_b ^ high_b, half // 2)
    return (cross ^ lows) << half ^ lows ^ _nim_product(highs, 1 << (half - 1), half // 2)


NIEDERREITER_XING_DIMS = 11


def niederreiter_xing(dims: int) -> Digital:
    """Make a Niederreiter-Xing sequence, a (t,s)-sequence in base 2 with small t.

    t is 0 for 1 and 2 dimensions, 1 for 3 and 4, and 2, 3, 4, 5, 7, 8, 9 for 5 to 11. In up to 4 dimensions
    no sequence in base 2 has a smaller t. For :func:`sobol`, t is bounded by 0, 0, 1, 3, 5, 8, 11, 15, 19,
    23, 27 [3]_.

    Parameters
    ----------
    dims : int, in [1, 11]
        Each number of dimensions has its own matrices, except for 1 and 3, which are the first of 2 and 4.

    Notes
    -----
    The construction is that of [1]_ for function fields over F_2 of genus t with one rational place more than
    dimensions; in four dimensions the field of the elliptic curve y^2 + y = x^3 + x. Digits are those of
    functions at a fixed place; each coordinate has functions with poles at one of the other places.
    ``analysis/tables/niederreiter_xing.py``, which makes the matrices, gives the theorem and its proof. The
    matrices differ from those of [2]_, which have the same t.

    A small t of all coordinates does not imply good projections. In four dimensions, every pair has t = 1
    for m >= 4, and every single coordinate for m = 5, 10, 15, ...; the first two coordinates of :func:`sobol`
    have t = 0. For 2**6 to 2**14 Owen-scrambled points, the RMS errors of :func:`sobol` are 1.20 times as
    large in all four dimensions, on average over half-spaces, balls, smooth bumps and products, but .83 times
    as large in the first two coordinates, .96 and .97 times in coordinates 1, 2 and 0, 2, and 1.16 to 1.19
    times in the other pairs. In eight dimensions, pairs have t = 2.1 on average for m = 6, 8, ..., 14, those
    of :func:`sobol` 1.7.

    Digital sequences in base 2 with t <= 1 in four dimensions end at 2**9 points if a single coordinate has
    t = 0, and at 2**5 if a pair has: exhaustive searches over all generator matrices, column by column, find
    no others.

    References
    ----------
    .. [1] C. Xing, H. Niederreiter, "A construction of low-discrepancy sequences using global function
       fields", Acta Arith. 73, 1995, Theorem 1.
    .. [2] G. Pirsic, "A software implementation of Niederreiter-Xing sequences", 2002.
    .. [3] H. Niederreiter, "Random Number Generation and Quasi-Monte Carlo Methods", 1992, Sect. 4.5.

    Examples
    --------
    >>> print((niederreiter_xing(4).points(4) * 4).astype(int))
    [[0 0 0 0]
     [2 2 2 2]
     [1 3 3 1]
     [3 1 1 3]]
    """
    dims = checks.integer("dims", dims, 1, NIEDERREITER_XING_DIMS)
    known = _niederreiter_xing_matrices()
    return digital(known[min(size for size in known if size >= dims)][:dims])


@cache
def _niederreiter_xing_matrices() -> dict[int, NDArray[np.uint32]]:
    """Read the matrices, by the number of dimensions."""
    lines = tables.rows("sequences", "niederreiter_xing.txt")
    found: dict[int, NDArray[np.uint32]] = {}
    for dims, *_ in lines:
        words = [[int(word, 16) for word in line[1:]] for line in lines if line[0] == dims]
        found[int(dims)] = np.array(words, np.uint32)
    return found

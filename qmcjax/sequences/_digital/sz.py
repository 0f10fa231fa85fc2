"""(0, 2**q)-sequences in base 2**q as binary digital sequences, including those of subfields."""

from functools import lru_cache

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.bits import pascal, reverse
from qmcjax.sequences._digital.digital import Digital, identity
from qmcjax.sequences._digital.matrix_products import packed, selected

SZ_DIMS = 256

_SIZE = 64
"""Order of the matrices: the digits of a 64-bit index."""


def sz(dims: int) -> Digital:
    """Make a (0,256)-sequence in base 256 of (0,16)-, (0,4)- and (0,2)-sequences in bases 16, 4 and 2.

    Components 2 k and 2 k + 1 are a (0,2)-sequence in base 2 for each k, components 4 k to 4 k + 3 a
    (0,4)-sequence in base 4, components 16 k to 16 k + 15 a (0,16)-sequence in base 16, and all 256 a
    (0,256)-sequence in base 256. Fewer dimensions are the first of these: the first two are :func:`sobol`'s.

    Parameters
    ----------
    dims : int, in [1, 256]

    Notes
    -----
    Sequences with these properties are introduced in [1]_; their matrices are found by a search over two
    alphabets of 2 x 2 blocks. Ours are constructed instead, and may differ. Let F be the field of 2**q
    elements for q = 1, 2, 4, 8, and C_F(a) the generator matrix of Faure's sequence for a in F: its element
    in row j and column r is binom(r, j) a**(r - j). As a binary matrix, it has the q x q matrix of
    multiplication by an element in place of that element. With the elements numbered as Conway's nimbers
    [2]_, the number c is a sum of its bit 0 in F_2, bit 1 in F_4, bits 2 and 3 in F_16 and bits 4 to 7 in
    F_256, and component c has the matrix

        C_2(c & 1) C_4(c & 2) C_16(c & 12) C_256(c & 240).

    Why this works: C_F(a) C_F(b) = C_F(a + b). By Lucas' theorem, C_F(a) for a in F is B C_E(a**2), where E
    is the field of the square of F's size, and B has only diagonal blocks, invertible, one for each digit of
    E. So the product up to F is D C_F(a), where D is such a matrix for F, and a in F runs through all
    elements with the bits of c up to F. These are components of Faure's sequence over F, times the rest of
    the product from the right, the same for all components of a group. Neither D nor the rest changes t = 0:
    the rest is upper triangular with unit diagonal, in blocks of the digits of F, too.

    Pairs of coordinates that are no (0,2)-sequence can be worse than those of :func:`sobol`, whose RMS errors
    at 512 Owen-scrambled points are .72, .98, .92 and .81 times as large in coordinates 0, 2; 0, 3; 1, 2 and
    1, 3, on average over half-planes, discs, smooth bumps and products, and .46 and .55 times for the smooth
    ones in coordinates 0, 2. In the first four dimensions together they are .65 to .85 times as large for
    2**7, 2**9, 2**11 and 2**13 points, which are no powers of 4, and .98 to 1.26 times for 2**6, ..., 2**14.

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
    words = np.stack([_columns(dim)[:32] for dim in range(dims)])
    return Digital(jnp.asarray(words), (identity, pascal)[:dims], _beyond, "sz")


def _beyond(dim: int, high: Array) -> Array:
    return reverse(selected(_columns(dim)[32:], high))


@lru_cache(maxsize=SZ_DIMS)
def _columns(component: int) -> NDArray[np.uint32]:
    """Return the first 32 rows of the 64 columns of a component's matrix, the first row in bit 31."""
    matrix = np.eye(_SIZE, dtype=np.int64)
    for bits, part in ((1, 1), (2, 2), (4, 12), (8, 240)):
        if component & part:
            matrix = matrix @ _pascal(component & part, bits) % 2
    return packed(matrix[None, :32])[0]


def _pascal(element: int, bits: int) -> NDArray[np.int64]:
    """Return C_F(element) for the field F of 2**bits elements, as a binary matrix."""
    count = _SIZE // bits
    matrix = np.zeros((count, bits, count, bits), np.int64)
    power = 1
    for distance in range(count):
        # Column k holds the product with the element of bit k.
        columns = [_nim_product(power, 1 << k) for k in range(bits)]
        block = np.array([[column >> i & 1 for column in columns] for i in range(bits)])
        for j in range(count - distance):
            if j & distance == 0:  # binom(j + distance, j) is odd, by Kummer's theorem.
                matrix[j, :, j + distance] = block
        power = _nim_product(power, element)
    return matrix.reshape(_SIZE, _SIZE)


def _nim_product(a: int, b: int, half: int = 4) -> int:
    """Multiply elements of the field of 2**(2 half) numbers: pairs over the field of 2**half.

    Sums are xors, and the numbers below 2**half are the subfield. The number i = 2**half has the square
    i + 2**(half - 1).
    """
    if half == 0:
        return a & b
    low_a, high_a, low_b, high_b = a % 2**half, a >> half, b % 2**half, b >> half
    lows = _nim_product(low_a, low_b, half // 2)
    highs = _nim_product(high_a, high_b, half // 2)
    cross = _nim_product(low_a ^ high_a, low_b ^ high_b, half // 2)
    return (cross ^ lows) << half ^ lows ^ _nim_product(highs, 1 << (half - 1), half // 2)

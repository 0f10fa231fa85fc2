"""Digital sequences of small t in base 2, from function fields with many rational places."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.sequences._digital.digital import Digital, digital

NIEDERREITER_XING_DIMS = 11


def niederreiter_xing(dims: int) -> Digital:
    """Make a Niederreiter-Xing sequence, a (t,s)-sequence in base 2 of small t.

    The value t is 0 for 1 and 2 dimensions, 1 for 3 and 4, and 2, 3, 4, 5, 7, 8, 9 for 5 to 11. In base 2
    none can be smaller in up to 4 dimensions. For :func:`sobol`, t is bounded by 0, 0, 1, 3, 5, 8, 11, 15,
    19, 23, 27 [3]_.

    Parameters
    ----------
    dims : int, in [1, 11]
        Each number of dimensions has matrices of its own, but 1 and 3, which are the first of 2 and 4.

    Notes
    -----
    The construction is that of [1]_ for function fields over F_2 of genus t with one rational place more than
    dimensions; in four dimensions the elliptic curve y^2 + y = x^3 + x. A fixed place gives the digits of
    functions, which have poles at one of the others for each coordinate (its theorem and proof:
    ``analysis/tables/make_niederreiter_xing.py``, which makes the matrices). They are not those of [2]_,
    which have the same t.

    A small t of all coordinates does not mean good projections. In four dimensions, every pair has t = 1
    for m >= 4, and every single coordinate for m = 5, 10, 15, ...; the first two coordinates of Sobol's
    have t = 0. For 2**6 to 2**14 points, Owen-scrambled, Sobol's RMS errors are 1.20 times as large in all
    four dimensions, on average over half-spaces, balls, smooth bumps and products, but .83 times as large in
    the first two coordinates, .96 and .97 times in coordinates 1, 2 and 0, 2, and 1.16 to 1.19 times in the
    other pairs. In eight dimensions, pairs have t = 2.1 on average for m = 6, 8,
    ..., 14, Sobol's 1.7.

    Digital sequences in base 2 with t <= 1 in four dimensions end at 2**9 points if a single coordinate has
    t = 0, and at 2**5 if a pair has: exhaustive searches find no others
    (``analysis/tables/search_columns.py``).

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
    known = _matrices()
    return digital(known[min(size for size in known if size >= dims)][:dims])


@cache
def _matrices() -> dict[int, NDArray[np.uint32]]:
    """Read the matrices, by the number of dimensions."""
    lines = tables.rows("sequences", "niederreiter_xing.txt")
    found: dict[int, NDArray[np.uint32]] = {}
    for dims, *_ in lines:
        words = [[int(word, 16) for word in line[1:]] for line in lines if line[0] == dims]
        found[int(dims)] = np.array(words, np.uint32)
    return found

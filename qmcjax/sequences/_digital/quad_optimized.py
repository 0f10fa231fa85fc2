"""A digital sequence in base 3 with optimised consecutive pairs and quadruples of coordinates."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.sequences._digital.prime_digital import PrimeDigital, prime_digital

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
    Found by ``analysis.tables.make_quadruples``: matrices that grow column by column, each column by a local
    search. Optimising consecutive pairs and quadruples is the idea of [1]_, which searches Sobol's
    construction over F_3; the matrices here are our own. The points of the quadruples are numbered in
    different ways, chosen for small t of other pairs of coordinates, too.

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
    return prime_digital(_matrices()[:dims].astype(np.int64), 3, "quad_optimized")


@cache
def _matrices() -> NDArray[np.uint8]:
    """Read the matrices, shape (32, 21, 21)."""
    lines = tables.rows("sequences", "quadruples.txt")
    return np.array([[list(row) for row in line] for line in lines], np.uint8)

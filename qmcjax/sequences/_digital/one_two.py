"""Sobol' components with (1,2)-sequences as pairs, from searched direction numbers."""

from importlib import resources

from qmcjax.core import checks, tables
from qmcjax.sequences._digital.digital import Digital, digital
from qmcjax.sequences._digital.direction_numbers import read_direction_numbers, sobol_of

ONE_TWO_DIMS = 20


def one_two(dims: int) -> Digital:
    """Make a Sobol' sequence with (1,2)-sequences in base 2 as components 2 k and 2 k + 1.

    The first pair is that of :func:`sobol`, a (0,2)-sequence.

    Parameters
    ----------
    dims : int, in [1, 20]; fewer dimensions are the first of these

    Returns
    -------
    Digital
        The value t of the pairs is verified for all nets of up to 2**32 points.

    Notes
    -----
    In Sobol's construction x and x + 1 give the only (0,2)-sequence. The polynomials p and p**2 + p + 1 can
    reach t = 1 [1]_. The direction numbers are from our own search (``analysis/tables/make_one_two.py``), for
    all p of degrees up to 7 with both polynomials irreducible: such p have degrees 1, 2, 5, 6 and 7. They are
    not those of [1]_.

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

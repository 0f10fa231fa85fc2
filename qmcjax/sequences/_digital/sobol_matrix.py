"""Generator matrices of Sobol' components from irreducible polynomials, given or those of Joe and Kuo."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, number_theory, tables


class DirectionNumbers(NamedTuple):
    """Direction numbers of a component of a Sobol' sequence."""

    polynomial: int
    """An irreducible polynomial over F2 other than x, of degree s in [1, 32].

    Bit i is the coefficient of x**i: x**3 + x + 1 is 0b1011. Sobol' uses primitive polynomials; t is known
    for irreducible ones, too.
    """
    initial: tuple[int, ...]
    """The odd numbers m_1, ..., m_s: m_k is less than 2**k."""


def validate_numbers(polynomial: Any, initial: Any) -> DirectionNumbers:
    """Return direction numbers, or raise an error that names ``polynomial`` or ``initial``."""
    polynomial = checks.integer("polynomial", polynomial, 2, 2**33 - 1)
    if not number_theory.is_irreducible(polynomial):
        raise ValueError(f"polynomial must be irreducible over F2, and not x, got {polynomial:#b}")
    degree = polynomial.bit_length() - 1
    wanted = f"{degree} integers, the degree's number"
    given = checks.known_array("initial", initial, np.integer, wanted)
    if given.shape != (degree,):
        raise ValueError(f"initial must be {wanted}, got {checks.shown(initial)}")
    numbers = tuple(int(number) for number in given)
    for k, number in enumerate(numbers, start=1):
        if number % 2 == 0 or not 0 < number < 2**k:
            raise ValueError(f"initial must be odd numbers m_k in (0, 2**k), got m_{k}={number}")
    return DirectionNumbers(polynomial, numbers)


def columns_of(numbers: Sequence[DirectionNumbers], count: int = 32) -> NDArray[np.uint32]:
    """Return the first columns of the matrices of components, uint32 (components, count), by Eq. 5.13 [1]_.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.1.
    .. [2] P. Bratley, B. L. Fox, "Algorithm 659: Implementing Sobol's Quasirandom Sequence
       Generator", ACM Trans. Math. Softw. 14, 1988.
    """
    degrees = np.array([len(initial) for _, initial in numbers])
    matrices = np.zeros((len(numbers), count), np.uint32)
    for degree in np.unique(degrees):
        rows = np.flatnonzero(degrees == degree).tolist()
        polynomials = np.array([numbers[row].polynomial for row in rows], np.uint64)
        initial = np.array([numbers[row].initial for row in rows], np.uint64)
        matrices[rows] = _columns_of_degree(polynomials, initial, count)
    return matrices


def _columns_of_degree(
    polynomials: NDArray[np.uint64], initial: NDArray[np.uint64], count: int
) -> NDArray[np.uint64]:
    """Return columns as fractions v_k = m_k / 2**k of 32 digits.

    Products of m_k with powers of two become right shifts of v_k, so the next column does not need digits
    beyond 32.
    """
    components, degree = initial.shape
    columns = np.zeros((components, count), np.uint64)
    columns[:, :degree] = initial << np.arange(31, 31 - degree, -1, dtype=np.uint64)
    for k in range(degree, count):
        oldest = columns[:, k - degree]
        column = oldest ^ (oldest >> np.uint64(degree))
        for i in range(1, degree):
            column ^= (polynomials >> np.uint64(degree - i) & np.uint64(1)) * columns[:, k - i]
        columns[:, k] = column
    return columns


@lru_cache(maxsize=16)
def matrices_of(dims: int) -> np.ndarray:
    """Return the matrices of components 1 to dims - 1 by Eq. 5.13 (0 is the identity), read-only."""
    matrices = columns_of(joe_kuo_numbers(slice(dims - 1)))
    matrices.flags.writeable = False
    return matrices


@lru_cache
def columns_beyond(dim: int) -> np.ndarray:
    """Return the first 32 rows of columns 32 to 63 of the matrix of component ``dim`` > 0, as fractions."""
    return columns_of(joe_kuo_numbers(slice(dim - 1, dim)), 64)[0, 32:]


def joe_kuo_numbers(components: slice) -> list[DirectionNumbers]:
    """Return direction numbers of components, from component 1 on."""
    table = tables.arrays("sequences", "joe_kuo.npz", "polynomials", "initial")
    pairs = zip(*(array[components].tolist() for array in table), strict=True)
    return [DirectionNumbers(p, tuple(initial[: p.bit_length() - 1])) for p, initial in pairs]

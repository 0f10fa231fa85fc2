"""The generator matrix of a Sobol' component from a primitive polynomial."""

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core import checks


def sobol_matrix(polynomial: int, initial: ArrayLike) -> Array:
    """Construct the generator matrix of one component of a Sobol' sequence.

    Parameters
    ----------
    polynomial : int
        A primitive polynomial over F2 of degree s in [1, 32], the coefficient of x**i in bit i:
        x**3 + x + 1 is 0b1011.
    initial : int ArrayLike, shape (s,)
        m_1, ..., m_s: m_k is odd and less than 2**k.

    Returns
    -------
    uint32 Array, shape (32,)
        Column k, its first row in bit 31: a row of the ``matrices`` of :func:`digital`. Regular and
        upper triangular.

    Raises
    ------
    ValueError
        If ``polynomial`` is not primitive, or ``initial`` has another length, or a number in it is
        even or too large.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.1, Eq. 5.13.
    .. [2] P. Bratley, B. L. Fox, "Algorithm 659: Implementing Sobol's Quasirandom Sequence
       Generator", ACM Trans. Math. Softw. 14, 1988.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> print(bool((sobol_matrix(0b111, [1, 3]) == sequences.sobol(3).matrices[2]).all()))
    True
    """
    polynomial = checks.integer("polynomial", polynomial, 2, 2**33 - 1)
    if not _is_primitive(polynomial):
        raise ValueError(f"polynomial must be primitive over F2, got {polynomial:#b}")
    degree = polynomial.bit_length() - 1
    wanted = f"{degree} integers, the degree's number"
    given = checks.known_array("initial", initial, np.integer, wanted)
    if given.shape != (degree,):
        raise ValueError(f"initial must be {wanted}, got {checks.shown(initial)}")
    numbers = [int(number) for number in given]
    for k, number in enumerate(numbers, start=1):
        if number % 2 == 0 or not 0 < number < 2**k:
            raise ValueError(f"initial must be odd numbers m_k in (0, 2**k), got m_{k}={number}")
    for k in range(degree, 32):
        number = numbers[k - degree]
        for i in range(1, degree + 1):
            if polynomial >> (degree - i) & 1:
                number ^= numbers[k - i] << i
        numbers.append(number)
    return jnp.asarray([number << (31 - k) for k, number in enumerate(numbers)], jnp.uint32)


def _is_primitive(polynomial: int) -> bool:
    """Tell whether the powers of x modulo the polynomial have period 2**degree - 1 (Definition 10)."""
    period = 2 ** (polynomial.bit_length() - 1) - 1
    return _power_of_x(period, polynomial) == 1 and all(
        _power_of_x(period // prime, polynomial) != 1 for prime in _prime_factors(period)
    )


def _power_of_x(exponent: int, polynomial: int) -> int:
    power, square = 1, _reduced(0b10, polynomial)
    while exponent:
        if exponent & 1:
            power = _product(power, square, polynomial)
        square = _product(square, square, polynomial)
        exponent >>= 1
    return power


def _product(a: int, b: int, polynomial: int) -> int:
    product = 0
    for i in range(b.bit_length()):
        if b >> i & 1:
            product ^= a << i
    return _reduced(product, polynomial)


def _reduced(value: int, polynomial: int) -> int:
    while value.bit_length() >= polynomial.bit_length():
        value ^= polynomial << (value.bit_length() - polynomial.bit_length())
    return value


def _prime_factors(number: int) -> list[int]:
    factors, candidate = [], 2
    while candidate * candidate <= number:
        if number % candidate:
            candidate += 1
        else:
            factors.append(candidate)
            number //= candidate
    return [*factors, number] if number > 1 else factors

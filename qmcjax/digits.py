"""Digits in any base: the radical inverse."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.bits import reverse, to_unit

__all__ = ["radical_inverse"]

_BELOW_ONE = np.float32(1 - 2.0**-24)


def radical_inverse(index: Array, base: int, dtype: DTypeLike = jnp.float32) -> Array:
    """Reflect the digits of an index in base ``base`` at the radix point.

    The reflected digits are collected as an exact integer and divided once, in float64: no error
    accumulates, and every uint32 index has its own value.

    Parameters
    ----------
    index : uint32 Array, shape (...)
    base : int
        In [2, 2**16].
    dtype : float32 or float64
        The result is rounded to nearest, but never up to 1.

    Returns
    -------
    Array of ``dtype``, shape (...), in [0, 1)

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Eq. 1.

    Examples
    --------
    >>> print(radical_inverse(jnp.uint32(5), 3))  # 5 is 12 in base 3, reflected 0.21
    0.7777778
    """
    if base == 2:
        return to_unit(reverse(index), dtype)
    # base**count <= 2**32 < base**(count + 1): count reflected digits fit a word, and one more is left.
    count = 0
    while base ** (count + 1) <= 2**32:
        count += 1
    numerator = jnp.zeros_like(index)
    rest = index
    for _ in range(count):
        quotient = rest // np.uint32(base)
        numerator = numerator * np.uint32(base) + (rest - quotient * np.uint32(base))
        rest = quotient
    with jax.enable_x64(True):
        exact = numerator.astype(jnp.float64) * np.float64(base) + rest.astype(jnp.float64)
        # Division by a constant is compiled to a product with its rounded reciprocal: one bit is lost.
        # A divisor that formally depends on the numerator is divided by.
        value = exact / (exact * 0.0 + np.float64(base ** (count + 1)))
        if dtype == jnp.float64:
            return value
        return jnp.minimum(value.astype(jnp.float32), _BELOW_ONE)

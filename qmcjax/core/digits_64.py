"""Radical inverses of 64-bit indices, given as two words."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.bits import below_one, reverse, to_unit
from qmcjax.core.digits import digit_count, digit_reversed, radical_inverse


def limit_64(base: int) -> int:
    """Return the number of indices of :func:`radical_inverse_64`, in [2**48, 2**64)."""
    return 2**32 * base ** (digit_count(base) - 1)


def radical_inverse_64(high: Array, low: Array, base: int, dtype: DTypeLike = jnp.float32) -> Array:
    """Reflect the digits of a 64-bit index at the radix point.

    ``high``, ``low``: uint32 Array, shape (...): the index ``high * 2**32 + low``, below :func:`limit_64`.
    ``base``: in [2, 2**16]. ``dtype``: float32 or float64: in base 2 the first 32 digits. In other bases
    float64 is off by less than 2**-52, and float32 is this value rounded to nearest; neither is ever 1.
    Returns Array of ``dtype``, shape (...), in [0, 1).
    """
    if base == 2:
        return to_unit(reverse(low), dtype)
    count = digit_count(base) - 1
    with jax.enable_x64(True):
        index = (high.astype(jnp.uint64) << 32) | low.astype(jnp.uint64)
        # Both the first ``count`` digits and the others are numbers below 2**32.
        rest = index // np.uint64(base**count)
        first = (index - rest * np.uint64(base**count)).astype(jnp.uint32)
        tail = radical_inverse(rest.astype(jnp.uint32), base, jnp.float64)
        value = (digit_reversed(first, base, count).astype(jnp.float64) + tail) * np.float64(1 / base**count)
        if dtype == jnp.float64:
            return jnp.minimum(value, np.float64(1 - 2.0**-53))
        return jnp.minimum(value.astype(jnp.float32), below_one(np.float32))

"""Polynomials on [0, 1] in Bernstein form, with coefficients along the first axis of arrays.

Values lie between the smallest and the largest coefficient. Where rays, triangles and spheres move linearly,
every condition for a hit is such a polynomial of time.
"""

from math import comb

import jax.numpy as jnp
from jax import Array

NOWHERE = 2
"""Replaces a root in (0, 1) that does not exist."""


def product(a: Array, b: Array) -> Array:
    """Return the coefficients of a product."""
    m, n = len(a) - 1, len(b) - 1
    scaled, other = a * _binomials(m, a), b * _binomials(n, b)
    rest = [(0, 0)] * (a.ndim - 1)
    terms = [jnp.pad(scaled * other[j][None], [(j, n - j), *rest]) for j in range(n + 1)]
    return sum(terms[1:], terms[0]) / _binomials(m + n, a)


def restricted(a: Array, start: Array, end: Array) -> Array:
    """Return the coefficients of the same polynomial with [start, end] mapped to [0, 1]."""
    degree = len(a) - 1
    result = []
    for last in range(degree + 1):
        # The blossom at `start` degree - last times, and at `end` last times.
        values = a
        for step in range(degree):
            at = (end if step < last else start)[None]
            values = (1 - at) * values[:-1] + at * values[1:]
        result.append(values)
    return jnp.concatenate(result)


def middle(a: Array) -> Array:
    """Return the value at 1/2."""
    return jnp.sum(a * _binomials(len(a) - 1, a), axis=0) / 2 ** (len(a) - 1)


def _binomials(degree: int, like: Array) -> Array:
    numbers = jnp.asarray([comb(degree, k) for k in range(degree + 1)], like.dtype)
    return numbers.reshape(-1, *(1,) * (like.ndim - 1))


def crossings(a: Array) -> tuple[Array, Array, Array]:
    """Return where quadratics change sign in (0, 1), in order, and their signs before that.

    ``r = s / (1 - s)`` is a root of ``a[0] + 2 a[1] r + a[2] r^2``, with the coefficients as they are, and s
    is a quotient of numbers of the same sign: nothing cancels [1]_ except a discriminant near 0, and the
    degree may drop. Signs agree with the roots returned: after all of them the sign is that of ``a[2]``.

    Returns
    -------
    first, second : Array
        ``NOWHERE`` without a root; both are equal at a double root.
    sign : Array
        -1, 0 or 1; 0 only where all coefficients are 0.

    References
    ----------
    .. [1] W. Kahan, "On the Cost of Floating-Point Computation Without Extra-Precise Arithmetic", 2004.
    """
    largest = jnp.maximum(jnp.maximum(abs(a[0]), abs(a[1])), abs(a[2]))
    inverse = 1 / jnp.where(largest > 0, largest, 1)
    zero, one, two = a[0] * inverse, a[1] * inverse, a[2] * inverse
    squared = one * one - zero * two
    root = jnp.sqrt(jnp.maximum(squared, 0))
    sum_ = -(one + jnp.where(one >= 0, root, -root))

    def between(numerator: Array, denominator: Array) -> Array:
        same = ((numerator > 0) & (denominator > 0)) | ((numerator < 0) & (denominator < 0))
        total = jnp.where(same, numerator + denominator, 1)
        return jnp.where(same & (squared >= 0), numerator / total, NOWHERE)

    ends = between(sum_, two), between(zero, sum_)
    sign = jnp.sign(jnp.where(zero != 0, zero, jnp.where(one != 0, one, two)))
    return jnp.minimum(*ends), jnp.maximum(*ends), sign

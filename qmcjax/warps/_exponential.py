"""Exponential numbers by the inverse of their distribution function."""

from dataclasses import field

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.maps import to_cube
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp


def of_parts(parts: Array) -> Array:
    """Return -log(1 - p), to 2 units in the last place: XLA's log1p loses 7 bits in float64."""
    rest = 1 - parts
    return (parts - (1 - rest)) / rest - jnp.log(rest)


def parts_of(values: Array) -> Array:
    """Return 1 - exp(-x) in [0, 1), the inverse: a step of Newton's method after XLA's expm1."""
    near = to_cube(-jnp.expm1(-values))
    return to_cube(near + (1 - near) * (values - of_parts(near)))


@frozen_pytree
class Exponential(Warp):
    """See :func:`exponential`."""

    dims: int = field(metadata={"static": True})

    def _values(self, points: Array) -> Array:
        return of_parts(points)

    def _points(self, values: Array) -> Array:
        return parts_of(values)

    def _density(self, values: Array) -> Array:
        inside = jnp.all(values >= 0, axis=-1)
        return jnp.where(inside, jnp.exp(-jnp.sum(jnp.maximum(values, 0), axis=-1)), 0)


def exponential(dims: int = 1) -> Exponential:
    """Make the map to independent exponential numbers of rate 1.

    Each coordinate goes through the inverse of the distribution function, with all digits at both ends: 0
    maps to 0, and the largest value is 16.6 in float32. In float64 values are within 2 units in the last
    place, those of the inverse within 4. Divide by a rate.

    Parameters
    ----------
    dims : int
        In [1, 65536].

    Examples
    --------
    >>> print(exponential()([[0.0], [0.5]]))
    [[0.       ]
     [0.6931472]]
    """
    return Exponential(checks.integer("dims", dims, 1, 2**16))

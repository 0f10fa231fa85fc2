"""Exponential numbers by the inverse of their distribution function."""

from dataclasses import field

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.maps import to_cube
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp


@frozen_pytree
class Exponential(Warp):
    """See :func:`exponential`."""

    dims: int = field(metadata={"static": True})

    def _values(self, points: Array) -> Array:
        return -jnp.log1p(-points)

    def _points(self, values: Array) -> Array:
        return to_cube(-jnp.expm1(-values))

    def _density(self, values: Array) -> Array:
        inside = jnp.all(values >= 0, axis=-1)
        return jnp.where(inside, jnp.exp(-jnp.sum(jnp.maximum(values, 0), axis=-1)), 0)


def exponential(dims: int = 1) -> Exponential:
    """Make the map to independent exponential numbers of rate 1.

    Each coordinate goes through the inverse of the distribution function, with all digits at both ends: 0
    maps to 0, and the largest value is 16.6 in float32. Divide by a rate.

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

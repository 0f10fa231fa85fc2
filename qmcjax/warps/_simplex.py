"""Non-negative numbers of sum 1."""

import math
from dataclasses import field

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.maps import to_cube
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp, rounding
from qmcjax.warps._exponential import of_parts, parts_of

_MOST = 32
"""Dimensions with a density, the factorial of dims, that is finite in float32."""


@frozen_pytree
class Simplex(Warp):
    """See :func:`simplex`."""

    dims: int = field(metadata={"static": True})

    @property
    def length(self) -> int:
        return self.dims + 1

    def _values(self, points: Array) -> Array:
        cut = of_parts(points) / self._left(points)  # minus the logarithm of the part that each step leaves
        rest = jnp.exp(-jnp.cumsum(cut, axis=-1))
        before = jnp.concatenate([jnp.ones_like(rest[..., :1]), rest[..., :-1]], axis=-1)
        return jnp.concatenate([before * parts_of(cut), rest[..., -1:]], axis=-1)

    def _points(self, values: Array) -> Array:
        rest = jnp.cumsum(values[..., ::-1], axis=-1)[..., :0:-1]
        part = to_cube(values[..., :-1] / jnp.where(rest > 0, rest, 1))
        return parts_of(self._left(values) * of_parts(part))

    def _density(self, values: Array) -> Array:
        allowed = self.length * rounding(values)
        inside = jnp.all(values >= 0, axis=-1) & (abs(jnp.sum(values, axis=-1) - 1) <= allowed)
        return jnp.where(inside, jnp.full_like(values[..., 0], math.factorial(self.dims)), 0)

    def _left(self, like: Array) -> Array:
        """Return the number of coordinates from each one to the last."""
        exponents = np.arange(self.dims, 0, -1, dtype=like.dtype)
        return jnp.asarray(exponents.reshape((1,) * (like.ndim - 1) + (-1,)))


def simplex(dims: int) -> Simplex:
    """Make the map to non-negative numbers of sum 1, uniformly: Dirichlet's distribution with all ones.

    A value has ``dims`` + 1 coordinates. Multiplied by the corners of a triangle, a tetrahedron and so on it
    is a uniform point of that. Coordinate by coordinate a part of the rest is cut off: the map is monotone in
    each, and invertible, unlike that by sorting.

    Parameters
    ----------
    dims : int
        In [1, 32]. The density, ``dims`` factorial, is per volume of all coordinates but one.

    Examples
    --------
    >>> print(simplex(2)([[0.75, 0.5]]))
    [[0.5  0.25 0.25]]
    """
    return Simplex(checks.integer("dims", dims, 1, _MOST))

"""Normal numbers by the inverse of their distribution function."""

import math
from dataclasses import field

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import ndtr, ndtri

from qmcjax.core import checks
from qmcjax.core.maps import to_cube
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp

_CELLS = {np.dtype(np.float32): 2.0**-24, np.dtype(np.float64): 2.0**-32}
"""Side of the cell of points that sequences round down to one coordinate."""


@frozen_pytree
class Normal(Warp):
    """See :func:`normal`."""

    dims: int = field(metadata={"static": True})

    def _values(self, points: Array) -> Array:
        dtype = np.dtype(points.dtype)
        # Processors may take numbers below the least normal one for 0.
        zero = points < np.finfo(dtype).tiny
        return ndtri(jnp.where(zero, points + dtype.type(_CELLS[dtype] / 2), points))

    def _points(self, values: Array) -> Array:
        return to_cube(ndtr(values))

    def _density(self, values: Array) -> Array:
        squared = jnp.sum(values * values, axis=-1)
        return jnp.exp(-squared / 2 - self.dims / 2 * math.log(2 * math.pi))


def normal(dims: int = 1) -> Normal:
    """Make the map to independent standard normal numbers.

    Each coordinate goes through the inverse of the distribution function: it is monotone, so intervals stay
    intervals.

    Parameters
    ----------
    dims : int
        In [1, 65536].

    Notes
    -----
    Coordinates of sequences are the lower ends of cells of side 2**-24 in float32, 2**-32 in float64. Of
    these, 0 has no finite value: it becomes the centre of its cell, which gives -5.42 and -6.34. All other
    numbers in (0, 1) are taken exactly, with an error of a few units in the last place in both tails. The
    largest values are 5.29 and 6.23 there, so the mean over all cells is a little below 0: by 3e-7 and 1e-9.
    Derivatives are the reciprocals of the density. The inverse of x < 0 is within 3 (1 + x**2) units in the
    last place.

    The first point of an unscrambled sequence is 0 in all coordinates, an outlier for any number of points:
    scramble it (:func:`qmcjax.sequences.owen`).

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = sequences.owen(sequences.sobol(2), key=1).points(4096)
    >>> values = normal(2)(points)
    >>> print(bool(abs(values.mean()) < 1e-3), bool(abs(values.std() - 1) < 1e-2))
    True True
    """
    return Normal(checks.integer("dims", dims, 1, 2**16))

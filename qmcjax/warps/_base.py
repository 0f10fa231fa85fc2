"""The interface of all warps, with checks of points and values."""

import abc

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core.parameters import floats, require
from qmcjax.core.pytrees import jit


class Warp(abc.ABC):
    """A map of the unit cube to a set of values with a known density.

    It maps points, shape (..., dims), to values, shape (..., length). Derivatives are finite at all points.
    """

    dims: int
    """Number of coordinates of a point."""

    @property
    def length(self) -> int:
        """Number of coordinates of a value."""
        return self.dims

    def __call__(self, points: ArrayLike) -> Array:
        """Map points to values.

        Parameters
        ----------
        points : float ArrayLike, shape (..., dims)
            In [0, 1), as sequences return them.

        Returns
        -------
        Array, shape (..., length), of the dtype of ``points``
            Finite.
        """
        return _compiled(self, "_values", points_of_cube(points, self.dims))

    def inverse(self, values: ArrayLike) -> Array:
        """Map values back to points.

        Parameters
        ----------
        values : float ArrayLike, shape (..., length)
            Values outside the image map to an arbitrary point of the cube.

        Returns
        -------
        Array, shape (..., dims), in [0, 1), of the dtype of ``values``
        """
        return _compiled(self, "_points", floats("values", values, (self.length,)))

    def density(self, values: ArrayLike) -> Array:
        """Return the probability density of the values of uniform points.

        Parameters
        ----------
        values : float ArrayLike, shape (..., length)

        Returns
        -------
        Array, shape (...), of the dtype of ``values``
            0 outside the image, up to rounding. Whether a value lies on a surface is not checked.
        """
        return _compiled(self, "_density", floats("values", values, (self.length,)))

    @abc.abstractmethod
    def _values(self, points: Array) -> Array:
        """Map points to values."""

    @abc.abstractmethod
    def _points(self, values: Array) -> Array:
        """Map values to points."""

    @abc.abstractmethod
    def _density(self, values: Array) -> Array:
        """Return the density."""


@jit("method")
def _compiled(warp: Warp, method: str, given: Array) -> Array:
    """Call a method as one compiled program: op by op, ``normal`` would compile twenty."""
    return getattr(warp, method)(given)


def points_of_cube(points: ArrayLike, dims: int) -> Array:
    """Return points as an array, or raise an error that names them."""
    array = floats("points", points, (dims,))
    require("points", array, lambda known: (known >= 0) & (known < 1), f"in [0, 1) in {array.dtype}")
    return array


def rounding(values: Array) -> float:
    """Return the distance that rounding may move a value of size 1 outside the image."""
    return 16 * float(jnp.finfo(values.dtype).eps)

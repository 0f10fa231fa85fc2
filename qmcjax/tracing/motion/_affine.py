"""Affine motion of rotation, scale and translation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import floats, numbers
from qmcjax.core.plug_ins import unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing.motion._rotations import rotation_matrix


@frozen_pytree
class Affine:
    """A map x -> matrix x + translation that depends on time."""

    matrix: Any
    """(3, 3), or a path of such matrices or of unit quaternions."""
    translation: Any
    """(3,), or a path of points."""

    def __call__(self, time: ArrayLike) -> tuple[Array, Array]:
        """Return matrices (..., 3, 3) and translations (..., 3) at times of shape (...)."""
        time = floats("time", time)
        matrix, translation = (
            jnp.asarray(unwrap(part)(time)) if callable(unwrap(part)) else jnp.asarray(part)
            for part in (self.matrix, self.translation)
        )
        if matrix.shape[-1] == 4:
            matrix = rotation_matrix(matrix)
        shapes = (matrix, (3, 3)), (translation, (3,))
        matrix, translation = (
            jnp.broadcast_to(part, (*time.shape, *shape)).astype(time.dtype) for part, shape in shapes
        )
        return matrix, translation

    @property
    def knots(self) -> Any:
        """Times between which all points move linearly, shape (k,); None if they do not.

        They do if the matrix is constant, and the translation is constant or a path with knots.
        """
        path = unwrap(self.translation)
        if callable(unwrap(self.matrix)):
            return None
        return getattr(path, "knots", None) if callable(path) else np.zeros(0)

    def reach(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return a box, (3,) and (3,), that contains the image of another box at all times in [0, 1].

        ``bounds()`` of a path bounds its points, and ``reach(low, high)`` its matrices; rotations keep points
        in a ball. Other paths have no known bound: the box is the whole space.
        """
        low, high = (floats(name, end, (3,), finite=False) for name, end in (("low", low), ("high", high)))
        path = unwrap(self.matrix)
        if hasattr(path, "reach"):
            low, high = path.reach(low, high)
        elif not callable(path):
            low, high = _image(jnp.asarray(path).astype(low.dtype), low, high)
        else:
            of_one = jax.eval_shape(path, jax.ShapeDtypeStruct((), low.dtype))
            farthest = jnp.sqrt(jnp.sum(jnp.maximum(abs(low), abs(high)) ** 2))
            radius = farthest if of_one.shape[-1] == 4 else jnp.full_like(farthest, jnp.inf)
            low, high = jnp.broadcast_to(-radius, low.shape), jnp.broadcast_to(radius, high.shape)
        path = unwrap(self.translation)
        if hasattr(path, "bounds"):
            moved = path.bounds()
        else:
            moved = (-jnp.inf, jnp.inf) if callable(path) else (path, path)
        return low + jnp.asarray(moved[0], low.dtype), high + jnp.asarray(moved[1], low.dtype)


def _image(matrix: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return the box of the image of a box, which may be infinite."""
    ends = [jnp.where(matrix == 0, 0, matrix * end[None, :]) for end in (low, high)]
    return jnp.minimum(*ends).sum(axis=1), jnp.maximum(*ends).sum(axis=1)


def affine(
    matrix: ArrayLike | Callable[[Array], Array] | None = None,
    translation: ArrayLike | Callable[[Array], Array] | None = None,
) -> Affine:
    """Make the motion of an object from rotation, scale and translation.

    Parameters
    ----------
    matrix : float ArrayLike, shape (3, 3), or callable, optional
        A path maps times, shape (...), to matrices (..., 3, 3) or to unit quaternions (..., 4). The identity
        by default.
    translation : float ArrayLike, shape (3,), or callable, optional
        A path maps times to points, shape (..., 3). None by default.

    Examples
    --------
    >>> from qmcjax.tracing.motion import quaternion
    >>> turn = affine(lambda time: quaternion([0, 0, 1], jnp.pi * time), [0, 0, 1])
    >>> print(turn(jnp.float32(0.5))[0].round(6))
    [[ 0. -1.  0.]
     [ 1.  0.  0.]
     [ 0.  0.  1.]]
    """
    matrix = np.eye(3) if matrix is None else matrix
    translation = np.zeros(3) if translation is None else translation
    given = ("matrix", matrix, (3, 3)), ("translation", translation, (3,))
    for name, value, _ in given:
        if callable(value):
            checks.function(name, value, "of times")
    parts = (
        wrap(name, value) if callable(value) else numbers(name, value, shape) for name, value, shape in given
    )
    return Affine(*parts)

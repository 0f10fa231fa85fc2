"""Affine motion: composition and decomposition of rotation, scale and translation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import floats, known, numbers, together
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


class Decomposition(NamedTuple):
    """A map x -> rotation(scale x) + translation."""

    translation: NDArray[np.float64]
    """(3,)."""
    rotation: NDArray[np.float64]
    """(4,): a unit quaternion (x, y, z, w), w not negative."""
    scale: NDArray[np.float64]
    """(3, 3), symmetric: scale along three orthogonal axes, all negative if the map is a reflection."""


def decompose(matrix: ArrayLike) -> Decomposition:
    """Split an affine map into scale, rotation and translation.

    The linear part is the product of the rotation and the symmetric factor of its polar decomposition; this
    rotation is the closest one [1]_.

    Parameters
    ----------
    matrix : float ArrayLike, shape (4, 4)
        Regular, finite and known before tracing. It acts on columns: the last column is the translation, the
        last row (0, 0, 0, 1).

    References
    ----------
    .. [1] K. Shoemake, T. Duff, "Matrix Animation and Polar Decomposition", 1992.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 2.3.

    Examples
    --------
    >>> found = decompose([[0, -2, 0, 5], [2, 0, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])
    >>> print(found.translation, found.rotation.round(4), found.scale.diagonal().round(6))
    [5. 6. 7.] [0.     0.     0.7071 0.7071] [2. 2. 2.]
    """
    given = known("matrix", matrix)
    if given.shape != (4, 4) or not np.isfinite(given).all() or (given[3] != (0, 0, 0, 1)).any():
        raise ValueError(
            f"matrix must be finite, 4 x 4, with the last row (0, 0, 0, 1), got {given.tolist()}"
        )
    linear = given[:3, :3]
    left, factors, right = np.linalg.svd(linear)
    if not factors[-1] > factors[0] * 1e-12:
        raise ValueError(f"matrix must be invertible, got the singular values {factors.tolist()}")
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    scale = sign * (right.T * factors) @ right
    return Decomposition(given[:3, 3].copy(), _quaternion(sign * left @ right), scale)


def _quaternion(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quaternion q of a rotation from q q^T: its largest row has no cancellation."""
    m = matrix
    products = np.array(
        [
            [1 + m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
            [m[0, 1] + m[1, 0], 1 - m[0, 0] + m[1, 1] - m[2, 2], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1 - m[0, 0] - m[1, 1] + m[2, 2], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    q = products[np.argmax(products.diagonal())]
    return q / np.linalg.norm(q) * (1 if q[3] >= 0 else -1)


def compose(translation: Any, rotation: Any, scale: Any) -> Array:
    """Invert :func:`decompose`: matrices (..., 4, 4).

    Translations have shape (..., 3), rotations (..., 4), unit quaternions, and scales (..., 3, 3).
    """
    translation, rotation = floats("translation", translation, (3,)), floats("rotation", rotation, (4,))
    scale = floats("scale", scale, (3, 3))
    one = together(translation=translation[..., 0], rotation=rotation[..., 0], scale=scale[..., 0, 0])[0]
    shape = one.shape
    linear = jnp.broadcast_to(rotation_matrix(rotation) @ scale, (*shape, 3, 3))
    upper = jnp.concatenate([linear, jnp.broadcast_to(translation[..., None], (*shape, 3, 1))], axis=-1)
    row = jnp.broadcast_to(jnp.asarray([0, 0, 0, 1], upper.dtype), (*upper.shape[:-2], 1, 4))
    return jnp.concatenate([upper, row], axis=-2)

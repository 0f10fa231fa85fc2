"""Matrices as translation, rotation and scale, for separate interpolation."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core.parameters import floats, known, together
from qmcjax.tracing.motion._quaternions import rotation_matrix


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
        raise ValueError(f"matrix must be regular, got the singular values {factors.tolist()}")
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

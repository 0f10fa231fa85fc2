"""Motions of objects, from a part that is linear and one that is not."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike

from qmcjax.core.parameters import numbers
from qmcjax.core.plug_ins import held, unheld
from qmcjax.core.pytrees import pytree
from qmcjax.tracing.motion._quaternions import rotation_matrix


@pytree
@dataclass(frozen=True)
class Affine:
    """A map x -> matrix x + translation that depends on time."""

    matrix: Any
    """(3, 3), or a path of such matrices or of unit quaternions."""
    translation: Any
    """(3,), or a path of points."""

    def __call__(self, time: ArrayLike) -> tuple[Array, Array]:
        """Return matrices (..., 3, 3) and translations (..., 3) at times of shape (...)."""
        time = jnp.asarray(time)
        matrix, translation = (
            jnp.asarray(unheld(part)(time)) if callable(unheld(part)) else jnp.asarray(part)
            for part in (self.matrix, self.translation)
        )
        if matrix.shape[-1] == 4:
            matrix = rotation_matrix(matrix)
        shapes = (matrix, (3, 3)), (translation, (3,))
        matrix, translation = (
            jnp.broadcast_to(part, (*time.shape, *shape)).astype(time.dtype) for part, shape in shapes
        )
        return matrix, translation


def affine(
    matrix: ArrayLike | Callable[[Array], Array] | None = None,
    translation: ArrayLike | Callable[[Array], Array] | None = None,
) -> Affine:
    """Make the motion of an object: where it is at any time, turned, scaled and moved.

    Parameters
    ----------
    matrix : float ArrayLike, shape (3, 3), or callable, optional
        A path maps times, shape (...), to matrices (..., 3, 3) or to unit quaternions (..., 4). The identity
        by default.
    translation : float ArrayLike, shape (3,), or callable, optional
        A path maps times to points, shape (..., 3). None by default.

    Returns
    -------
    Affine
        ``motion(time)``: matrix and translation.

    Raises
    ------
    TypeError
        If an argument is neither callable nor of real numbers.
    ValueError
        If a shape does not fit or a number is not finite.

    Examples
    --------
    >>> from qmcjax.tracing.motion import quaternion
    >>> turn = affine(lambda time: quaternion([0, 0, 1], jnp.pi * time), [0, 0, 1])
    >>> print(turn(jnp.float32(0.5))[0].round(6))
    [[ 0. -1.  0.]
     [ 1.  0.  0.]
     [ 0.  0.  1.]]
    """
    given = (
        ("matrix", np.eye(3) if matrix is None else matrix, (3, 3)),
        (
            "translation",
            np.zeros(3) if translation is None else translation,
            (3,),
        ),
    )
    parts = (
        held(name, value) if callable(value) else numbers(name, value, shape) for name, value, shape in given
    )
    return Affine(*parts)

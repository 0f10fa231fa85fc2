"""Evaluation of motions at given times, and between them on straight lines."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import cast, floats, numbers, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing.motion._paths import interpolate


def evaluate_motion(motion: Any, time: Array) -> tuple[Array, Array]:
    """Return matrices (..., 3, 3) and translations (..., 3) at times of shape (...), or raise an error."""
    given = motion(time)
    try:
        matrix, translation = map(jnp.asarray, given)
        shapes = matrix.shape, translation.shape
    except (TypeError, ValueError):
        raise TypeError(
            f"motion must map times to a matrix and a translation, got {checks.shown(given)}"
        ) from None
    if shapes != ((*time.shape, 3, 3), (*time.shape, 3)):
        raise ValueError(
            f"motion must map times {time.shape} to matrices {(*time.shape, 3, 3)} and translations "
            f"{(*time.shape, 3)}, got {shapes[0]} and {shapes[1]}"
        )
    return matrix, translation


@frozen_pytree
class Straightened:
    """Matrices and translations, interpolated linearly between times."""

    knots: Any
    """(k,), increasing."""
    matrix: Any
    """(k, 3, 3)."""
    translation: Any
    """(k, 3)."""

    def __call__(self, time: ArrayLike) -> tuple[Array, Array]:
        """Return matrices (..., 3, 3) and translations (..., 3) at times of shape (...)."""
        time = floats("time", time)
        knots, matrix, translation = cast((self.knots, self.matrix, self.translation), time.dtype)
        rows = jnp.concatenate([matrix.reshape(-1, 9), translation], axis=1)
        row = interpolate(knots, rows, time)
        return jnp.stack(row[:9], axis=-1).reshape(*time.shape, 3, 3), jnp.stack(row[9:], axis=-1)


def straightened(motion: Callable[[Array], tuple[Array, Array]], times: ArrayLike) -> Straightened:
    """Approximate a motion by linear segments: every point moves on straight lines between given times.

    Objects are exact at these times; in between, rotating objects shrink, half-way by the fraction
    1 - cos(angle / 2) of their radius.

    Parameters
    ----------
    motion : callable
        From times, shape (n,), to (matrix, translation), shapes (n, 3, 3) and (n, 3).
    times : float ArrayLike, shape (k,)
        Two or more, increasing. The motion rests before the first and after the last.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.2.1.

    Examples
    --------
    >>> from qmcjax.tracing.motion import affine, quaternion
    >>> turn = affine(lambda time: quaternion([0, 0, 1], jnp.pi / 2 * time))
    >>> print(straightened(turn, [0.0, 1.0])(0.5)[0].round(6))
    [[ 0.5 -0.5  0. ]
     [ 0.5  0.5  0. ]
     [ 0.   0.   1. ]]
    """
    checks.function("motion", motion, "of times")
    knots = numbers("times", times, (None,))
    require("times", knots, lambda t: len(t) > 1 and (t[1:] > t[:-1]).all(), "two or more, increasing")
    return Straightened(knots, *evaluate_motion(motion, jnp.asarray(knots)))

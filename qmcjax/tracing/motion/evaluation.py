"""Evaluation of motions: checks what a user's callable returns."""

from typing import Any

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks


def moved(motion: Any, time: Array) -> tuple[Array, Array]:
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

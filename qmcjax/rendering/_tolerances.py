"""How small the standard error of each value of an image must become."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks

Tolerance = float | Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike]


_OF = "of means and variances"


def check(tolerance: Any, relative: Any) -> None:
    """Raise unless each is None or one positive number; the first may be a function."""
    for name, value in (("tolerance", tolerance), ("relative", relative)):
        if value is None:
            continue
        if name == "tolerance" and callable(value):
            checks.function(name, value, _OF, 2)
            continue
        checks.positive(name, value)
        if np.ndim(value):
            raise TypeError(f"{name} must be one number for all pixels, got {checks.shown(value)}")


def missed(
    tolerance: Tolerance | None,
    relative: float | None,
    mean: NDArray[np.float64],
    variance: NDArray[np.float64],
    of_error: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return ``of_error`` over the square of the allowed error of each value: 0 where nothing varies.

    The allowed error is the larger one of ``tolerance``, or what it returns for the means and their
    variances, and of ``relative`` times the brightest channel of the pixel.
    """
    allowed: Any = 0.0 if tolerance is None else tolerance
    if callable(allowed):
        try:
            found = allowed(mean, variance)
        except TypeError as error:
            shown = checks.shown(tolerance)
            raise TypeError(f"tolerance must be a function {_OF}, got {shown}: {error}") from error
        allowed = _returned(found, mean)
    if relative is not None:
        brightest = abs(mean) if mean.ndim == 2 else abs(mean).max(axis=-1, keepdims=True)
        allowed = np.maximum(allowed, relative * brightest)
    squares = np.broadcast_to(np.square(allowed), of_error.shape)
    found = np.where(of_error > 0, np.inf, np.zeros_like(of_error))
    return np.divide(of_error, squares, out=found, where=squares > 0)


def _returned(found: Any, mean: NDArray[np.float64]) -> NDArray[np.float64]:
    allowed = np.asarray(found)
    if allowed.dtype.kind not in "fiu" or not np.all(allowed > 0):
        raise ValueError(f"tolerance must return positive numbers, got {checks.shown(found)}")
    shapes = (), mean.shape[:2], mean.shape, (*mean.shape[:2], 1)
    if allowed.shape not in shapes:
        raise ValueError(
            f"tolerance must return one number, or an array of shape {mean.shape[:2]} or {mean.shape}, got "
            f"{checks.shown(found)}"
        )
    return allowed[..., None] if mean.ndim == 3 and allowed.ndim == 2 else allowed

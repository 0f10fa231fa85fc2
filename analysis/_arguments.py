"""Checks of the arguments of measures: points, images, numbers. Each error names the argument and its value.

A wrong type is a TypeError, a wrong value a ValueError, as in :mod:`qmcjax.core.checks`.
"""

import math
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax.core import checks

FLOATS = (np.float16, np.float32, np.float64)
"""Types of coordinates that float64 represents exactly."""


def array(name: str, value: Any, wanted: str) -> NDArray[Any]:
    """Return an array of numbers, or raise a TypeError."""
    if isinstance(value, Tracer):
        raise TypeError(f"{name} must be {wanted}, known and not traced by JAX, got {value}")
    try:
        given = np.asarray(value)
    except (TypeError, ValueError):
        given = np.asarray(None)
    if given.dtype.kind not in "iuf":
        raise TypeError(f"{name} must be {wanted}, got {checks.shown(value)}")
    return given


def validate_shape(
    name: str, given: Any, least: int = 1, most_dims: int | None = None, least_dims: int = 1
) -> Any:
    """Return points, traced or not; raise a ValueError unless their number and dimensions are allowed."""
    if given.ndim != 2 or given.shape[0] < least or not least_dims <= given.shape[1]:
        at_least = f"n >= {least} and d >= {least_dims}"
        raise ValueError(f"{name} must have shape (n, d) with {at_least}, got {given.shape}")
    if most_dims is not None and given.shape[1] > most_dims:
        raise ValueError(f"{name} must have at most {most_dims} dimensions, got d={given.shape[1]}")
    return given


def points(
    value: Any,
    name: str = "points",
    *,
    least: int = 1,
    least_dims: int = 1,
    most_dims: int | None = None,
    vector: bool = False,
    traced: bool = False,
    closed: bool = False,
    dtypes: tuple[Any, ...] = FLOATS,
) -> Any:
    """Return points in their own dtype; raise unless they are in [0, 1)^d, or [0, 1]^d if ``closed``.

    ``value``: from NumPy, JAX, or nested lists. ``name``: name of the argument, for messages. ``least``,
    ``least_dims``, ``most_dims``: allowed numbers of points and dimensions. ``vector``: whether an array of
    one axis is a set in one dimension. ``traced``: whether JAX may trace them; their values are not checked
    then. ``dtypes``: allowed dtypes of coordinates: floats in [0, 1), or uint32 fractions of 2**32. Returns
    array, shape (n, d), or a Tracer of this shape.
    """
    wanted = f"an array of {', '.join([np.dtype(dtype).name for dtype in dtypes])}"
    given: Any = value if traced and isinstance(value, Tracer) else array(name, value, wanted)
    if given.dtype not in dtypes:
        raise TypeError(f"{name} must be {wanted}, got {given.dtype} {given.shape}")
    if vector and given.ndim == 1:
        given = given[:, None]
    validate_shape(name, given, least, most_dims, least_dims)
    if not isinstance(given, Tracer) and given.dtype.kind == "f":
        outside = ~((given >= 0) & ((given <= 1) if closed else (given < 1)))
        if outside.any():
            interval = "[0, 1]" if closed else "[0, 1)"
            raise ValueError(f"{name} must be in {interval}, got {given[outside][0].item()!r}")
    return given


def real_array(name: str, value: Any) -> Any:
    """Return real numbers as float64, or if JAX traces them in their own dtype, as floats."""
    wanted = "an array of real numbers"
    if not isinstance(value, Tracer):
        return array(name, value, wanted).astype(np.float64)
    if not (jnp.issubdtype(value.dtype, np.integer) or jnp.issubdtype(value.dtype, np.floating)):
        raise TypeError(f"{name} must be {wanted}, got {value.dtype} {value.shape}")
    return value if jnp.issubdtype(value.dtype, np.floating) else value.astype(float)


def check_finite(name: str, values: NDArray[np.float64]) -> None:
    """Raise a ValueError that names the first value that is not finite, and its place."""
    infinite = ~np.isfinite(values)
    if infinite.any():
        at = tuple(int(k) for k in np.argwhere(infinite)[0])
        raise ValueError(f"{name} must be finite, got {values[at]} at {at}")


def error(image: Any, reference: Any, animated: bool = False) -> Any:
    """Return the error of an image, shape (height, width, channels), traced if either is, or raise.

    ``animated``: whether the first axis is time. One reference may then serve all frames.
    """
    given, exact = real_array("image", image), real_array("reference", reference)
    if exact.shape not in (given.shape, given.shape[1:] if animated else given.shape):
        raise ValueError(f"image and reference must have the same shape, got {given.shape} and {exact.shape}")
    if given.ndim not in (2 + animated, 3 + animated) or given.size == 0:
        pixels = "(frames, height, width" if animated else "(height, width"
        raise ValueError(f"image must have shape {pixels}) or {pixels}, 3), got {given.shape}")
    for name, values in (("image", given), ("reference", exact)):
        if not isinstance(values, Tracer):
            check_finite(name, values)
    if traced := [values for values in (given, exact) if isinstance(values, Tracer)]:
        dtype = jnp.result_type(*traced)
        given, exact = jnp.asarray(given, dtype), jnp.asarray(exact, dtype)
    exact = exact if exact.ndim == given.ndim else exact[None]
    return (given - exact).reshape(*given.shape[: 2 + animated], -1)


def real(name: str, value: Any, wanted: str, holds: Callable[[float], bool]) -> float:
    """Return a number as a float; raise unless it satisfies a condition."""
    given = array(name, value, wanted)
    if given.ndim:
        raise TypeError(f"{name} must be {wanted}, got {checks.shown(value)}")
    if not holds(number := float(given)):
        raise ValueError(f"{name} must be {wanted}, got {checks.shown(value)}")
    return number


def positive(name: str, value: Any) -> float:
    """Return a positive finite number as a float."""
    return real(name, value, "positive and finite", lambda x: 0 < x < math.inf)


def not_negative(name: str, value: Any) -> float:
    """Return a finite number, at least 0, as a float."""
    return real(name, value, "finite and at least 0", lambda x: 0 <= x < math.inf)


def root(square: Array) -> Any:
    """Return the square root of a traced number; its derivative at 0 is set to 0."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1)), 0)
